"""What ``cc.cite`` prints is BibTeX, and names the same sources as the docstrings do."""

from __future__ import annotations

import re
import subprocess
import sys
import unicodedata
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import ClassVar

import pytest

import cartctl as cc
from cartctl.algebra import inverses
from cartctl.errors import ParameterError, SolverNotFound
from cartctl.solvers import solver_class
from cartctl.solvers.citing import references

ROOT = Path(__file__).parent.parent
REQUIRED = {
    "article": {"author", "title", "journal", "year"},
    "inproceedings": {"author", "title", "booktitle", "year"},
    "techreport": {"author", "title", "institution", "year"},
    "software": {"author", "title", "year"},
}
POLICIES = [getattr(inverses, name) for name in inverses.__all__ if name != "InversePolicy"]


def parsed(text: str) -> dict[str, tuple[str, dict[str, str]]]:
    """Key -> (kind, fields): every character of the text belongs to an entry, braces balance."""
    found, at = {}, 0
    while text[at:].strip():
        head = re.compile(r"\s*@(\w+)\{([\w-]+),").match(text, at)
        assert head, text[at : at + 60]
        at, fields = head.end(), {}
        while not (end := re.compile(r"\s*\}").match(text, at)):
            name = re.compile(r"\s*(\w+) = \{").match(text, at)
            assert name, text[at : at + 60]
            depth, at = 1, name.end()
            begin = at
            while depth:
                depth += {"{": 1, "}": -1}.get(text[at], 0)
                at += 1
            assert text[at] == "," and name[1] not in fields
            fields[name[1]] = " ".join(text[begin : at - 1].split())
            at += 1
        at = end.end()
        assert head[2] not in found
        found[head[2]] = (head[1], fields)
    return found


ENTRIES = parsed("\n".join(references().values()))


def surname(field: str) -> str:
    """The first author's, in letters without accents, as docstrings have it."""
    plain = re.sub(r"\\[\"'`^~]|[{}]", "", field.partition(",")[0])
    return unicodedata.normalize("NFKD", plain).encode("ascii", "ignore").decode()


@pytest.mark.parametrize("key", ENTRIES)
def test_every_entry_is_whole(key: str) -> None:
    kind, fields = ENTRIES[key]
    assert REQUIRED[kind] <= set(fields) and all(fields.values())
    assert re.fullmatch(r"(19|20)\d\d", fields["year"])
    assert key == "cartctl" or key.endswith(fields["year"])
    assert re.fullmatch(r"10\.\d{4,9}/\S+", fields.get("doi", "10.1000/none"))
    assert re.fullmatch(r"\d+--\d+", fields.get("pages", "1--2"))
    for author in fields["author"].split(" and "):
        assert author.startswith("{") or ", " in author


def test_the_file_has_nothing_else() -> None:
    text = (ROOT / "cartctl/solvers/references.bib").read_text(encoding="utf-8")
    assert set(re.findall(r"^@\w+\{([\w-]+),", text, re.MULTILINE)) == set(references())
    used = {key for name in cc.solvers() for key in solver_class(name).sources}
    used |= {key for policy in POLICIES for key in policy.sources}
    assert used | {"cartctl"} == set(references())


@pytest.mark.parametrize("name", cc.solvers())
def test_a_solver_cites_what_its_docstring_names(name: str) -> None:
    kind = solver_class(name)
    entries = parsed(cc.cite(name))
    assert list(entries) == list(kind.sources) and entries
    agree(import_module(kind.__module__).__doc__ or "", entries)


@pytest.mark.parametrize("policy", POLICIES)
def test_a_policy_cites_what_its_docstring_names(policy: type[cc.InversePolicy]) -> None:
    entries = parsed(cc.cite(policy()))
    assert list(entries) == list(policy.sources) == list(parsed(cc.cite(policy))) and entries
    agree(policy.__doc__ or "", entries)


def agree(text: str, entries: dict[str, tuple[str, dict[str, str]]]) -> None:
    """The years of the text are those of the entries, and it names each first author."""
    assert set(re.findall(r"\b(?:19|20)\d\d\b", text)) == {fields["year"] for _, fields in entries.values()}
    for _, fields in entries.values():
        assert surname(fields["author"]) in text


def test_a_policy_of_ones_choice_is_cited_with_its_solver() -> None:
    assert list(parsed(cc.cite(cc.TaskPriority(cc.SelectivelyDamped())))) == [*cc.TaskPriority.sources, "buss2005"]
    assert cc.cite(cc.TaskPriority()) == cc.cite("task-priority") == cc.cite(cc.TaskPriority)


def test_several_methods_share_their_entries() -> None:
    both = parsed(cc.cite("sns", "sns-greedy"))
    assert list(both) == ["flacco2012", "flacco2015", "fiore2023"]


def test_a_method_of_ones_own() -> None:
    @dataclass(frozen=True)
    class Mine(cc.DLS):
        sources: ClassVar[tuple[str, ...]] = ("wampler1986", "@misc{mine2026,\n  title = {Mine},\n}")

    assert list(parsed(cc.cite(Mine()))) == ["wampler1986", "mine2026"]
    Mine.sources = ()
    with pytest.raises(ParameterError, match="names no source"):
        cc.cite(Mine())
    Mine.sources = ("wampler1985",)
    with pytest.raises(ParameterError, match="'wampler1985' is no key of references.bib.*wampler1986"):
        cc.cite(Mine())
    with pytest.raises(SolverNotFound, match="sns"):
        cc.cite("snss")


def test_cartctl_itself_is_cited_as_citation_cff_says() -> None:
    _, fields = parsed(cc.cite())["cartctl"]
    said = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f'title: "{fields["title"]}"' in said and fields["author"].strip("{}") in said
    assert f"version: {cc.__version__}" in said and f"Version {cc.__version__}" in fields["note"]
    assert repr(cc.cite()) == str(cc.cite())


def test_the_command_line_prints_the_same() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "cartctl", "cite", "sns", "dls"], capture_output=True, text=True, check=True
    )
    assert done.stdout == cc.cite("sns", "dls") + "\n"
