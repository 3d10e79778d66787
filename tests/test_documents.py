"""The README and the site's pages say what is true: Python runs, files exist, figures are a file's."""

from __future__ import annotations

import csv
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
GENERATED = {
    ROOT / "docs" / "reference",
    ROOT / "docs" / "lectures",
}  # when the site is built, from what is tested elsewhere
DOCS = [str(p.relative_to(ROOT)) for p in sorted(ROOT.glob("docs/**/*.md")) if p.parent not in GENERATED]
PAGES = ["README.md", *DOCS]
SNIPPETS = [
    (p, i, s)
    for p in PAGES
    for i, s in enumerate(re.findall(r"```python\n(.*?)```", (ROOT / p).read_text(), re.DOTALL))
]


@pytest.mark.parametrize(("page", "number", "code"), SNIPPETS, ids=[f"{p}-{i}" for p, i, _ in SNIPPETS])
def test_snippets_run(page: str, number: int, code: str, tmp_path: Path) -> None:
    (tmp_path / "urdf").symlink_to(ROOT / "urdf")
    done = subprocess.run(
        [sys.executable, "-W", "error::UserWarning", "-c", code], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("page", [*(str(p.relative_to(ROOT)) for p in sorted(ROOT.glob("*.md"))), *DOCS])
def test_links_lead_somewhere(page: str) -> None:
    for link in re.findall(r"\]\(([^)#\s]+)(?:#[\w-]+)?\)", (ROOT / page).read_text()):
        if "://" not in link:
            assert ((ROOT / page).parent / link).exists(), f"{page}: {link}"
        else:
            assert re.fullmatch(r"https://[a-z0-9-]+(\.[a-z0-9-]+)+(/[\w.~%/+-]*)?", link), f"{page}: {link}"


def result(name: str, **where: str) -> dict[str, str]:
    with (ROOT / "benchmarks" / "results" / name).open() as file:
        (row,) = [r for r in csv.DictReader(file) if all(r[key] == value for key, value in where.items())]
    return row


def test_the_how_to_index_names_every_page_by_its_title() -> None:
    listed = dict(re.findall(r"^- \[(.+)\]\(how-to/(.+)\.md\)$", (ROOT / "docs/guide.md").read_text(), re.MULTILINE))
    titles = {p.read_text().splitlines()[0].removeprefix("# "): p.stem for p in (ROOT / "docs/how-to").glob("*.md")}
    assert listed == titles


def test_the_readmes_race_is_the_files() -> None:
    """Each figure as the file has it, rounded as the sentence has it; benchmarks/race/words.py writes it again."""
    text = " ".join((ROOT / "README.md").read_text().split())
    said = re.search(r"<!-- race -->(.*?)<!-- /race -->", text)
    assert said is not None
    with (ROOT / "benchmarks/results/race.csv").open() as file:
        rows = {(r["job"], r["who"]): r for r in csv.DictReader(file)}
    tracks = {
        who: row for (job, who), row in rows.items() if job == "track" and who != "cartctl simulate_batch, approach"
    }
    lost = {who for who, row in tracks.items() if not row["success"].startswith("limits")}
    assert len(tracks) >= 9 and all(f"; {who} did not finish" in said[1] for who in lost)
    tracks = {who: row for who, row in tracks.items() if who not in lost}

    def short(value: float) -> str:
        return f"{value:.1f}" if value < 10.0 else f"{value:.0f}"

    names = {"cartctl simulate_batch": "`cc.simulate_batch`", "cartctl Controller.step": "`Controller.step`"}
    for who, row in tracks.items():
        assert re.search(rf"[ ;]{names.get(who, who)} {short(float(row['median_us']))}[,.;]", said[1]), who
    off = {who: float(row["error"].split(" um, ")[0]) for who, row in tracks.items()}
    mine = max(off.pop(who) for who in names)
    assert f"cartctl strays up to {mine:.0f} um from the path, the others {min(off.values()):.2g} (" in said[1]
    assert f" to {max(off.values()):.2g} (" in said[1]
    assert max(off.values()) < mine  # as docs/comparison.md says
    own, other = (rows["ik", who] for who in ("cartctl inverse_kinematics", "roboticstoolbox ik_LM"))
    assert f"{short(float(own['median_us']))} us and {own['success']} found" in said[1]
    assert f"`ik_LM` {short(float(other['median_us']))} us and {other['success']}." in said[1]


def test_the_readmes_race_is_what_its_script_would_write() -> None:
    done = subprocess.run(
        [sys.executable, "benchmarks/race/words.py", "--check"], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_the_readmes_comparison_is_the_files() -> None:
    text = (ROOT / "README.md").read_text()
    table = re.search(r"<!-- table: every_method -->\n(.*?)<!-- /table -->", text, re.DOTALL)
    assert table is not None
    with (ROOT / "benchmarks/results/every_method.csv").open() as file:
        rows = list(csv.DictReader(file))
    heads = [h.strip() for h in table[1].splitlines()[0].strip("| ").split("|")]
    expected = ["| " + " | ".join(r[h] for h in heads) + " |" for r in rows]
    assert [line for line in table[1].splitlines() if line.startswith("| ")][1:] == expected and len(expected) == 10
    assert rows[0]["pin"] in table[1] and rows[0]["date"] in table[1]


def test_ten_thousand_runs_fit_a_gibibyte_as_the_page_says() -> None:
    with (ROOT / "benchmarks/results/bench_memory.csv").open() as file:
        rows = {row["workers"]: row for row in csv.DictReader(file)}
    assert set(rows) == {"1", "2"} and all(row["runs"] == "10000" for row in rows.values())
    assert all(int(row["all_MiB"]) < 1024 for row in rows.values())
    grown = [int(row["all_MiB"]) - int(row["all_MiB_at_a_tenth"]) for row in rows.values()]
    assert max(grown) < 100  # for nine times as many runs: what writing the table takes
    said = f"{rows['1']['all_MiB']} MiB alone, {rows['2']['all_MiB']} MiB with two workers"
    assert said in " ".join((ROOT / "docs/how-to/bench.md").read_text().split())


def test_every_target_of_the_makefile_in_the_readme_exists() -> None:
    makefile = (ROOT / "Makefile").read_text()
    for target in set(re.findall(r"`?make (\w+)", (ROOT / "README.md").read_text() + (ROOT / ".ci/run").read_text())):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_the_number_of_robots_is_right() -> None:
    import cartctl as cc

    assert f"lists {len(cc.robots())} by name" in (ROOT / "README.md").read_text()


def shell_lines() -> list[tuple[str, str]]:
    """Every line that a page tells a reader to type into a shell, without its comment."""
    found = []
    for page in PAGES:
        text = (ROOT / page).read_text()
        lines = [line for block in re.findall(r"```sh\n(.*?)```", text, re.DOTALL) for line in block.splitlines()]
        lines += re.findall(r"`((?:cartctl|python) [^`]+)`", text)
        found += [(page, line.partition("#")[0].strip()) for line in lines if line.startswith(("cartctl", "python"))]
    return sorted(set(found))


@pytest.mark.parametrize(("page", "line"), shell_lines())
def test_what_a_page_says_to_type_exists(page: str, line: str) -> None:
    """Verbs and their options are those of the command line, scripts are files."""
    import typer

    from cartctl.cli.app import app

    words = line.partition(">>")[0].split()
    if words[0] == "python":
        assert (ROOT / words[1]).is_file()
        return
    command = typer.main.get_command(app)
    while len(words) > 1 and words[1] in getattr(command, "commands", {}):
        command, words = command.commands[words[1]], words[1:]
    assert not getattr(command, "commands", None) or len(words) == 1 or words[1].isupper(), f"no verb {words[1:2]}"
    options = {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)}
    unknown = [word for word in words[1:] if word.startswith("--") and word not in {*options, "--help"}]
    assert not unknown
