"""The report: what it says of results, and that its page stands alone."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

import cartctl as cc
from cartctl import bench
from cartctl.bench import pictures
from cartctl.bench.contents import LIMITATIONS, contents, worst_cases
from cartctl.bench.statistics import scores
from cartctl.bench.table import Row, results
from cartctl.errors import BenchError, ParameterError
from tests import chromium
from tests.bench_scenarios import short

ODD = 'odd <b> & "name" | _x_'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three scenarios by four methods: one refuses, one leaves its limits, one is slow to follow."""
    place = tmp_path_factory.mktemp("bench")
    fast = {"axes": "xy", "target": {"kind": "circle", "radius": 0.3, "period": 0.4}}
    hurried = short("hurried", duration=0.6, tasks=[fast], limits={"velocity": 0.8}, summary="too fast")
    solvers = ["pinv", "sns", "transpose", "extended-jacobian"]
    bench.run([short("plain"), hurried, short(ODD, robot="planar4R")], solvers, out=place, repeat=2)
    return place


@pytest.fixture(scope="module")
def rows(folder: Path) -> list[Row]:
    return results(folder)


@pytest.fixture(scope="module")
def made(folder: Path, rows: list[Row]) -> object:
    return bench.report(rows, folder, replays=2)


class Page(HTMLParser):
    """Tags that are open, links, and text."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []
        self.ids: set[str] = set()
        self.tags: set[str] = set()
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        if tag not in ("meta", "br"):
            self.open.append(tag)
        self.links += [value or "" for name, value in attrs if name in ("href", "src")]
        self.ids |= {value or "" for name, value in attrs if name == "id"}

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def test_the_page_stands_alone(folder: Path, made: object) -> None:
    source = (folder / "report.html").read_text(encoding="utf-8")
    page = Page()
    page.feed(source)
    assert not page.open and "script" not in page.tags and "svg" in page.tags
    assert "default-src 'none'" in source
    for link in page.links:
        if link.startswith("#"):
            assert link[1:] in page.ids
        else:
            assert (folder / link).is_file(), link
    assert not re.search(r"(href|src)=.https?:", source)
    assert ODD in page.text and "<b>" not in source


@chromium.needs_chromium
@pytest.mark.parametrize("width", [1280, 400])
def test_a_browser_shows_the_page(folder: Path, made: object, width: int) -> None:
    """Not blank, nothing asked of a network, nothing complained of, on a phone too."""
    shot = chromium.shoot(folder / "report.html", size=(width, 1600))
    assert shot.requests == [] and shot.console == []
    background = shot.pixels[5, 5].astype(int)
    drawn = (abs(shot.pixels.astype(int) - background).max(axis=2) > 40).mean()
    assert drawn > 0.02
    coloured = (shot.pixels.max(axis=2).astype(int) - shot.pixels.min(axis=2) > 60).mean()
    assert coloured > 1e-4  # the profiles' lines


def test_the_report_has_every_part(folder: Path, rows: list[Row], made: object) -> None:
    text = (folder / "report.md").read_text(encoding="utf-8")
    early, late = ("Overview", "Performance profiles", "Worst cases", "Set own"), ("Not done", "Known limitations")
    for title in (*early, *late, "Machine, versions, seeds"):
        assert f"## {title}\n" in text
    assert rows[0]["machine"].split(",")[0][:10] in text and f"cartctl {cc.__version__}" in text
    assert "| seeds | 0 |" in text and "has no objective to keep extremal" in text
    assert text.count("\n- ") >= len(LIMITATIONS) and rows[0]["digest"] in text
    assert (folder / "profiles.png").read_bytes().startswith(b"\x89PNG")


def test_means_in_the_report_are_those_of_the_statistics(folder: Path, rows: list[Row], made: object) -> None:
    text = (folder / "report.md").read_text(encoding="utf-8")
    means = scores(rows, "rms_m").means()
    for name in ("pinv", "sns", "transpose"):
        line = next(line for line in text.splitlines() if line.startswith(f"| {name} | 6 |"))
        shown = float(re.sub(r"[*\\]", "", line.split("|")[6]))
        assert shown == pytest.approx(means[name], rel=0.05, abs=0.005)
    assert min(means.values()) == 1.0


def test_worst_cases_are_the_worst_and_lead_to_their_replay(folder: Path, rows: list[Row], made: object) -> None:
    cases = worst_cases(rows)
    assert cases and cases[0][0]["solver"] in ("pinv", "transpose") and all(", " in why for _, why in cases)
    assert any(row["scenario"] == "hurried" and "outside a limit" in why for row, why in cases)
    source = (folder / "report.html").read_text(encoding="utf-8")
    first = cases[0][0]["key"]
    assert f'href="replays/{first}.html"' in source
    replayed = (folder / "replays" / f"{first}.html").read_text(encoding="utf-8")
    assert "<canvas" in replayed or "meshcat" in replayed.lower()
    assert len(list((folder / "replays").iterdir())) == 2


def test_a_replay_is_the_run_itself(rows: list[Row]) -> None:
    for row in rows[:4]:
        if row["outcome"] == "done":
            run = bench.replay(row)
            assert run.metrics().tasks[0].rms_m == row["rms_m"] and len(run) == row["steps"]
    with pytest.raises(BenchError, match=r"the row has no 'solver'; expected a row of cc\.bench\.results"):
        bench.replay({"key": "a"})


def test_nobody_solved_is_said(rows: list[Row]) -> None:
    hopeless = [{**row, "solved": False} if row["scenario"] == "plain" else row for row in rows]
    (section,) = [s for s in contents(hopeless, {}) if s.title == "Known limitations"]
    assert any(text.startswith("Nobody solved plain (velocity)") for text in section.bullets)


def test_the_best_is_marked_among_the_valid(rows: list[Row]) -> None:
    (section,) = [s for s in contents(rows, {}) if s.title == "Set own"]
    (table,) = [t for t in section.tables if t.title.startswith("hurried")]
    marks = {row[0].text: {head: cell.mark for head, cell in zip(table.heads, row, strict=True)} for row in table.rows}
    assert marks["pinv"]["method"] == "wrong" and marks["pinv"]["outside"] == "wrong"
    assert "best" not in marks["pinv"].values() and marks["sns"]["outside"] == ""
    assert "medians of 2 runs" in table.note and "too fast" in table.note


def test_profiles_can_be_drawn_of_any_figure(rows: list[Row], tmp_path: Path) -> None:
    drawing = pictures.profiles(rows, ["rms_m", "flips", "manipulability"])
    assert [axes.get_title(loc="left") for axes in drawing.axes][0] == "RMS position error"
    lines = drawing.axes[0].get_lines()
    assert {line.get_label() for line in lines} == {"pinv", "sns", "transpose", "extended-jacobian"}
    assert pictures.save(drawing, tmp_path / "p.svg").read_text().startswith("<?xml")
    with pytest.raises(ParameterError, match=r"expected \.png, \.svg or \.pdf"):
        pictures.save(drawing, tmp_path / "p.doc")
    with pytest.raises(ParameterError, match="figure 'rms' is not one of"):
        pictures.profiles(rows, ["rms"])


def test_one_valid_run_is_enough_for_a_report(tmp_path: Path) -> None:
    bench.run(short(), "pinv", out=tmp_path)
    bench.report(results(tmp_path), tmp_path / "report", replays=0)
    assert "None: every run" in (tmp_path / "report" / "report.md").read_text()


def test_nothing_valid_is_no_trouble_for_a_report(tmp_path: Path) -> None:
    bench.run(short(), "extended-jacobian", out=tmp_path)
    bench.report(results(tmp_path), tmp_path)
    assert "extended-jacobian" in (tmp_path / "report.html").read_text()
