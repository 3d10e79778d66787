"""The documentation site: built without a warning, whole, and complete in what it promises for every method."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
import warnings
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest

import cartctl as cc
from tests.chromium import needs_chromium, shoot

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
SECTIONS = ["Equation", "What it assumes", "How it fails", "Source"]
pytest.importorskip("sphinx", minversion="9.0", reason="the site is built with Sphinx 9 or newer (Python >= 3.11)")


@pytest.fixture(autouse=True)
def paths(monkeypatch: pytest.MonkeyPatch) -> None:
    for folder in (DOCS, DOCS / "_ext"):
        monkeypatch.syspath_prepend(str(folder))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built once as `make docs` builds it, whatever the number of processes the tests run in."""
    base = tmp_path_factory.getbasetemp()
    base = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    out, said = base / "site", base / "site.log"
    try:
        (base / "site.begun").mkdir()
    except FileExistsError:  # another process builds it
        deadline = time.monotonic() + 300.0
        while not said.exists():
            assert time.monotonic() < deadline, "the process that builds the site does not come to an end"
            time.sleep(0.2)
    else:
        done = subprocess.run(
            [sys.executable, "-m", "sphinx", "-q", "-E", "-b", "html", "-W", "--keep-going", str(DOCS), str(out)],
            capture_output=True, text=True, check=False, cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)},
        )  # fmt: skip
        (base / "site.part").write_text(f"{done.returncode}\n{done.stderr}", encoding="utf-8")
        (base / "site.part").rename(said)
    code, _, errors = said.read_text(encoding="utf-8").partition("\n")
    assert code == "0", errors[-4000:]
    return out


class Page(HTMLParser):
    """What a page loads, leads to, and calls by an id."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.leads: list[str] = []
        self.ids: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        given = {key: value or "" for key, value in attributes}
        self.ids |= {given[key] for key in ("id", "name") if key in given}
        if tag in ("script", "img", "iframe", "source", "object") and (
            address := given.get("src") or given.get("data")
        ):
            self.loads.append(address)
        if tag == "link" and given.get("rel") in ("stylesheet", "icon", "preload"):
            self.loads.append(given["href"])
        if tag == "a" and "href" in given:
            self.leads.append(given["href"])


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    return {path.resolve(): Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}


def test_a_page_loads_nothing_from_elsewhere(pages: dict[Path, Page], site: Path) -> None:
    assert len(pages) > 60
    for path, page in pages.items():
        for address in page.loads:
            assert "//" not in address, f"{path.name} loads {address}"
            assert (path.parent / unquote(urlsplit(address).path)).exists(), f"{path.name}: {address}"
    for sheet in site.rglob("*.css"):
        assert not re.search(r"url\(\s*[\"']?https?:|@import", sheet.read_text(encoding="utf-8")), sheet


def test_every_link_leads_to_a_place(pages: dict[Path, Page]) -> None:
    for path, page in pages.items():
        for address in page.leads:
            parts = urlsplit(address)
            if parts.scheme in ("http", "https"):
                assert "." in parts.netloc, f"{path.name}: {address}"
                continue
            assert not parts.scheme, f"{path.name}: {address}"
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert target.exists(), f"{path.name}: {address}"
            if parts.fragment and target in pages:
                assert unquote(parts.fragment) in pages[target].ids, f"{path.name}: {address}"


def test_formulas_are_drawn_by_the_browser(site: Path) -> None:
    text = (site / "methods" / "sns.html").read_text(encoding="utf-8")
    assert text.count("<math") > 5
    for path in site.rglob("*.html"):
        prose = re.sub(r"<(pre|code|script)\b.*?</\1>", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
        assert not re.search(r"\\(frac|lVert|begin|text|dot)\b|\$\$", prose), path.name


def test_every_public_name_has_its_place_in_the_reference(pages: dict[Path, Page]) -> None:
    ids = set().union(*(page.ids for page in pages.values()))
    missing = [name for name in cc.__all__ if name != "__version__" and f"cartctl.{name}" not in ids]
    assert not missing


def test_every_notebook_is_a_page_with_its_outputs(site: Path) -> None:
    listed = (site / "notebooks.html").read_text(encoding="utf-8")
    for notebook in sorted((ROOT / "notebooks").glob("*.ipynb")):
        text = (site / "lectures" / f"{notebook.stem}.html").read_text(encoding="utf-8")
        cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
        drawn = sum("image/png" in output.get("data", {}) for cell in cells for output in cell.get("outputs", []))
        assert len(re.findall(rf'src="[^"]*{notebook.stem}-\d+\.png"', text)) == drawn
        assert text.count("highlight-python") == sum(cell["cell_type"] == "code" for cell in cells)
        assert f'href="lectures/{notebook.stem}.html"' in listed


@pytest.mark.parametrize("name", cc.solvers())
def test_a_method_has_its_page(name: str) -> None:
    text = (DOCS / "methods" / f"{name}.md").read_text(encoding="utf-8")
    assert text.startswith(f"# `{name}`: ")
    assert [head for head in re.findall(r"^## (.*)$", text, re.MULTILINE) if head in SECTIONS] == SECTIONS
    for directive in ("method-facts", "method-figure", "method-sources"):
        assert f"```{{{directive}}} {name}\n" in text
    assert re.search(r"^\$\$\n.+?^\$\$\n", text, re.MULTILINE | re.DOTALL)
    assert f"\n{name} <{name}>\n" in (DOCS / "methods" / "index.md").read_text(encoding="utf-8")


def test_every_method_has_a_figure_and_no_figure_lacks_a_method() -> None:
    captions = json.loads((DOCS / "_static" / "methods" / "captions.json").read_text(encoding="utf-8"))
    drawn = {path.stem for path in (DOCS / "_static" / "methods").glob("*.svg")}
    assert list(captions) == list(cc.solvers()) and drawn == set(captions)
    assert all(40 < len(caption) < 700 for caption in captions.values())


@pytest.mark.parametrize("name", ["dls-sigma", "task-scaling", "qp"])
def test_a_figure_is_what_its_command_draws(name: str, tmp_path: Path) -> None:
    """The caption's figures, and the picture's size: the file itself may differ in the last digits of a machine."""
    from pictures import FIGURES
    from pictures.style import drawn

    captions = json.loads((DOCS / "_static" / "methods" / "captions.json").read_text(encoding="utf-8"))
    committed = (DOCS / "_static" / "methods" / f"{name}.svg").read_text(encoding="utf-8")
    assert drawn(FIGURES[name], tmp_path / "a.svg") == captions[name]
    again = (tmp_path / "a.svg").read_text(encoding="utf-8")
    assert re.search(r"<svg [^>]*>", again)[0] == re.search(r"<svg [^>]*>", committed)[0]
    assert again.count("<path") == committed.count("<path")


def test_an_unknown_figure_is_refused_with_the_names_there_are() -> None:
    done = subprocess.run(
        [sys.executable, str(DOCS / "figures.py"), "pinvv"], capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 2 and "pinvv" in done.stderr and "sns-greedy" in done.stderr


def test_the_readmes_table_of_methods_is_the_codes() -> None:
    from methods import abilities

    table = re.search(r"<!-- table: methods -->\n(.*?)<!-- /table -->", (ROOT / "README.md").read_text(), re.DOTALL)
    assert table is not None
    lines = [line.strip("| ").split(" | ") for line in table[1].splitlines() if not line.startswith("|---")]
    heads, rows = lines[0], lines[1:]
    assert len(rows) == len(cc.solvers())
    for name, cells in zip(cc.solvers(), rows, strict=True):
        row = dict(zip(heads, cells, strict=True))
        assert row["method"] == f"[`{name}`](docs/methods/{name}.md)" and len(row["what it does"]) > 20
        expected = abilities(name)
        for head in ("velocity", "acceleration", "torque", "several tasks", "bounds", "rows", "null space"):
            assert row[head] == expected[head], f"{name}, {head}"


@pytest.mark.parametrize("level", ["velocity", "acceleration", "torque"])
@pytest.mark.parametrize("name", cc.solvers())
def test_a_method_works_where_the_table_says(name: str, level: str) -> None:
    from methods import levels

    robot = cc.load("planar4R")
    objective = cc.JointRange() if name == "extended-jacobian" else None
    tip = cc.FrameTask("tool", "xy", target=[0.5, 0.6, 0.0])
    settings = {"solver": name, "level": level, "limits": None, "objective": objective}
    if level not in levels(name):
        with pytest.raises(cc.CartctlError, match=level):
            cc.Controller(robot, tip, **settings)
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cc.CartctlWarning)  # gains and the step
        command = cc.Controller(robot, tip, **settings).step(robot.home, np.zeros(robot.nv))
    given = {"velocity": command.velocity, "acceleration": command.acceleration, "torque": command.torque}[level]
    assert given is not None and np.isfinite(given).all() and np.linalg.norm(given) > 1e-3


@pytest.mark.parametrize("name", cc.solvers())
def test_what_the_table_says_of_bounds_rows_and_the_null_space(name: str) -> None:
    from methods import abilities

    row, rng = abilities(name), np.random.default_rng(4)
    A, b = rng.normal(size=(2, 4)), rng.normal(size=2)
    square = [(A, b), (rng.normal(size=(2, 4)), rng.normal(size=2))] if name == "extended-jacobian" else [(A, b)]
    asked = {
        "bounds": cc.Problem(square, lower=-9 * np.ones(4), upper=9 * np.ones(4)),
        "rows": cc.Problem(square, constraints=(np.ones((1, 4)), [-9.0], [9.0])),
        "null space": cc.Problem(square, reference=rng.normal(size=4)),
        "metric": cc.Problem(square, metric=np.arange(1.0, 5.0)),
    }
    plain = cc.solve(cc.Problem(square), name).u
    for ability, problem in asked.items():
        if row[ability] == "✓":
            u = cc.solve(problem, name).u
            assert (np.linalg.norm(u - plain) > 1e-6) == (ability in ("null space", "metric")), ability
        else:
            with pytest.raises(cc.CartctlError, match=re.escape(repr(name))):
                cc.solve(problem, name)


def test_numbers_of_pages_are_cells_of_files() -> None:
    from results import cell, read

    rows = read("torque_norms.csv")
    row = next(r for r in rows if (r["motion"], r["null_space"], r["weight"]) == ("long", "damped", "M^-1"))
    where = "torque_norms.csv; motion=long; null_space=damped; weight=M^-1"
    assert cell(f"{where}; peak_torque_nm") == row["peak_torque_nm"]
    with pytest.raises(ValueError, match="3 rows"):
        cell("torque_norms.csv; motion=long; null_space=damped; peak_torque_nm")
    with pytest.raises(KeyError):
        cell(f"{where}; peak")


@needs_chromium
@pytest.mark.chromium
@pytest.mark.parametrize("page", ["index.html", "methods/sns.html"])
def test_a_page_opens_on_a_phone_and_asks_for_nothing(site: Path, page: str) -> None:
    shot = shoot(site / page, size=(400, 800))
    assert not shot.requests and not shot.console
    assert len(np.unique(shot.pixels.reshape(-1, 3), axis=0)) > 50
