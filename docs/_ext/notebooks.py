"""The directive ``notebooks``: those of the repository with their titles and first sentences, if there are any."""

from __future__ import annotations

import json
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

FOLDER = Path(__file__).parents[2] / "notebooks"


def about(notebook: Path) -> tuple[str, str]:
    """The first heading of a notebook, and the first line of prose below it."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    lines = [line.strip() for c in cells if c["cell_type"] == "markdown" for line in "".join(c["source"]).splitlines()]
    heads = [line.lstrip("# ") for line in lines if line.startswith("#")]
    words = [line for line in lines if line and not line.startswith(("#", "$", "|", "!"))]
    return (heads or [notebook.stem])[0], (words or [""])[0]


class Notebooks(SphinxDirective):
    """A list of them."""

    def run(self) -> list[nodes.Node]:
        """Title, file and first line of each; a sentence where there are none."""
        found = sorted(FOLDER.glob("*.ipynb"))
        if not found:
            return [nodes.paragraph(text="This copy of the repository has none.")]
        items = nodes.bullet_list()
        for notebook in found:
            self.env.note_dependency(str(notebook))
            title, words = about(notebook)
            text = nodes.paragraph(
                "", "", nodes.strong(text=title), nodes.Text(" "), nodes.literal(text=f"notebooks/{notebook.name}")
            )
            items += nodes.list_item("", text, *([nodes.paragraph(text=words)] if words else []))
        return [items]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("notebooks", Notebooks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
