"""The README and the guide say what is true: their Python runs, their files exist, their figures come from a file."""

from __future__ import annotations

import csv
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGES = ["README.md", "docs/guide.md"]
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


@pytest.mark.parametrize(
    "page", [str(p.relative_to(ROOT)) for p in sorted(ROOT.glob("*.md")) + sorted(ROOT.glob("docs/*.md"))]
)
def test_links_lead_somewhere(page: str) -> None:
    for link in re.findall(r"\]\(([^)#]+)\)", (ROOT / page).read_text()):
        if not link.startswith("http"):
            assert ((ROOT / page).parent / link).exists(), f"{page}: {link}"


def test_the_readmes_times_are_the_files() -> None:
    text = (ROOT / "README.md").read_text()
    table = re.search(r"<!-- table: step_time -->\n(.*?)<!-- /table -->", text, re.DOTALL)
    assert table is not None
    with (ROOT / "benchmarks/results/step_time.csv").open() as file:
        rows = list(csv.DictReader(file))
    expected = [f"| {r['what']} | {r['median_us']} | {r['ratio']} |" for r in rows]
    assert [line for line in table[1].splitlines() if line.startswith("| ")][1:] == expected
    assert rows[0]["pin"] in table[1] and rows[0]["date"] in table[1]


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


def test_ten_thousand_runs_fit_a_gibibyte_as_the_guide_says() -> None:
    with (ROOT / "benchmarks/results/bench_memory.csv").open() as file:
        rows = {row["workers"]: row for row in csv.DictReader(file)}
    assert set(rows) == {"1", "2"} and all(row["runs"] == "10000" for row in rows.values())
    assert all(int(row["all_MiB"]) < 1024 for row in rows.values())
    grown = [int(row["all_MiB"]) - int(row["all_MiB_at_a_tenth"]) for row in rows.values()]
    assert max(grown) < 100  # for nine times as many runs: what writing the table takes
    said = f"{rows['1']['all_MiB']} MiB alone, {rows['2']['all_MiB']} MiB with two workers"
    assert said in " ".join((ROOT / "docs/guide.md").read_text().split())


def test_every_target_of_the_makefile_in_the_readme_exists() -> None:
    makefile = (ROOT / "Makefile").read_text()
    for target in set(re.findall(r"`?make (\w+)", (ROOT / "README.md").read_text() + (ROOT / ".ci/run").read_text())):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


def test_the_number_of_robots_is_right() -> None:
    import cartctl as cc

    assert f"lists {len(cc.robots())} by name" in (ROOT / "README.md").read_text()
