"""The notebooks run, say what the committed ones say, begin with an equation and a question, and end in a figure."""

from __future__ import annotations

import base64
import importlib.util
import io
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cartctl.report.palette import COLORS

WHY = "the notebooks' tools: pip install -e '.[dev]'"
nbformat = pytest.importorskip("nbformat", reason=WHY)
for tool in ("nbclient", "jupytext", "ipykernel"):
    pytest.importorskip(tool, reason=WHY)

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "notebooks"
_spec = importlib.util.spec_from_file_location("notebooks_build", FOLDER / "build.py")
build = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(build)

every_source = pytest.mark.parametrize("source", build.SOURCES, ids=[s.stem for s in build.SOURCES])
NUMBER = re.compile(r"-?\d+(?:\.\d*)?(?:e[-+]?\d+)?")
NO_NETWORK = """
import socket
def refuse(self, address):
    raise AssertionError(f"a notebook wants to talk to {address}")
socket.socket.connect = socket.socket.connect_ex = refuse
"""


def outputs(book):
    return [output for cell in book.cells for output in cell.get("outputs", ())]


def printed(book):
    return " ".join("".join(o.text for o in outputs(book) if o.output_type == "stream").split())


def figures(book):
    pictures = [o.data["image/png"] for o in outputs(book) if o.output_type == "display_data"]
    return [Image.open(io.BytesIO(base64.b64decode(picture))) for picture in pictures]


def seen(picture):
    """What is left of a figure from afar: fonts and versions of matplotlib do not show."""
    return np.asarray(picture.convert("L").resize((128, 60), Image.Resampling.BOX), dtype=float)


def test_there_are_nine_and_no_other():
    assert [s.stem[:2] for s in build.SOURCES] == [f"{k:02d}" for k in range(1, 10)]
    assert sorted(FOLDER.glob("*.ipynb")) == [build.made_from(s) for s in build.SOURCES]


@every_source
def test_the_notebook_is_its_sources(source):
    """`make notebooks` was run after the last edit."""
    book, made = build.read(source), nbformat.read(build.made_from(source), as_version=4)
    nbformat.validate(made)
    assert [(c.cell_type, c.source) for c in made.cells] == [(c.cell_type, c.source) for c in book.cells]
    counts = [c.execution_count for c in made.cells if c.cell_type == "code"]
    assert counts == list(range(1, len(counts) + 1))  # from top to bottom, in one go


@every_source
def test_it_begins_with_an_equation_and_a_question_and_ends_in_a_figure(source):
    made = nbformat.read(build.made_from(source), as_version=4)
    first, last = made.cells[0], made.cells[-1]
    assert 8 <= len(made.cells) <= 17
    assert first.source.startswith(f"# {int(source.stem[:2])} · ") and first.source.count("$$") == 2
    assert re.search(r"\*\*[^*]*\?\*\*", first.source)
    assert last.source.endswith("plt.show()") and [o.output_type for o in last.outputs] == ["display_data"]
    assert len(figures(made)) == 1
    picture = figures(made)[0]
    assert picture.width >= 900 and seen(picture).std() > 10.0
    reds_greens_blues = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    shown = {tuple(int(c[i : i + 2], 16) for i in (1, 3, 5)) for c in COLORS}
    assert len(shown & set(map(tuple, reds_greens_blues.tolist()))) >= 2  # the palette's colours are in it


@every_source
def test_nothing_in_it_belongs_to_one_machine(source):
    text = source.read_text() + printed(nbformat.read(build.made_from(source), as_version=4))
    assert not re.search(r"/(tmp|home|root|work|Users)\b|\\Users|https?://|localhost", text)
    assert not re.search(r"^\s*(import|from) (urllib|requests|socket|subprocess|os)\b", text, re.MULTILINE)


@pytest.mark.slow
@every_source
def test_it_runs_and_says_what_the_committed_one_says(source):
    book, made = build.read(source), nbformat.read(build.made_from(source), as_version=4)
    done = build.execute(book, startup=build.QUIET + NO_NETWORK)
    assert {o.output_type for o in outputs(done)} == {"stream", "display_data"}
    assert {o.name for o in outputs(done) if o.output_type == "stream"} == {"stdout"}  # no warning, nothing on stderr
    now, then = printed(done), printed(made)
    assert re.findall(r"[^\W\d]+", NUMBER.sub(" ", now)) == re.findall(r"[^\W\d]+", NUMBER.sub(" ", then))
    np.testing.assert_allclose(
        [float(x) for x in NUMBER.findall(now)], [float(x) for x in NUMBER.findall(then)], rtol=0.02, atol=2e-3
    )
    (figure,), (kept,) = figures(done), figures(made)
    assert np.abs(seen(figure) - seen(kept)).mean() < 3.0  # of 255


def test_the_readme_has_a_line_for_each():
    lines = (FOLDER / "README.md").read_text().splitlines()
    for source in build.SOURCES:
        assert sum(f"]({source.stem}.ipynb)" in line for line in lines) == 1
    links = re.findall(r"\]\(([^)#]+)\)", "\n".join(lines))
    assert links and all((FOLDER / link).exists() for link in links if not link.startswith("http"))


def test_the_lecture_style_has_the_palettes_colours():
    import matplotlib.pyplot as plt

    with plt.style.context("cartctl.report.lecture"):
        cycle = plt.rcParams["axes.prop_cycle"].by_key()["color"]
        sizes = [plt.rcParams[key] for key in ("font.size", "axes.labelsize", "axes.titlesize", "legend.fontsize")]
    assert tuple(c.lower() for c in cycle) == COLORS
    assert min(sizes) >= 13
