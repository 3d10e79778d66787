"""The directive ``notebooks``: those of the repository with their titles and first sentences, if there are any."""

from __future__ import annotations

import json
import re
from pathlib import Path

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

FOLDER = Path(__file__).parents[2] / "notebooks"


def about(notebook: Path) -> tuple[str, str]:
    """The first heading of a notebook, and the first sentence of prose below it, as Markdown."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    text = "\n\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    text = re.sub(r"\$\$.*?\$\$", "", text, flags=re.DOTALL)
    heads = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    paragraphs = [" ".join(part.split()) for part in re.split(r"\n\s*\n", text)]
    words = [part for part in paragraphs if part and part[0] not in "#|!-*<"]
    sentence = re.match(r"(.*?[.?!:])(?: |$)", words[0]) if words else None
    return (heads or [notebook.stem])[0], sentence[1].replace("*", "").rstrip(":") if sentence else ""


class Notebooks(SphinxDirective):
    """A list of them."""

    def run(self) -> list[nodes.Node]:
        """Title, file and first line of each; a sentence where there are none."""
        found = sorted(FOLDER.glob("*.ipynb"))
        if not found:
            return [nodes.paragraph(text="This copy of the repository has none.")]
        lines = []
        for notebook in found:
            self.env.note_dependency(str(notebook))
            title, words = about(notebook)
            lines += [f"- **{title}** `notebooks/{notebook.name}`  ", f"  {words}"]
        box = nodes.Element()
        self.state.nested_parse(StringList(lines, source=self.get_source_info()[0]), 0, box)
        return box.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("notebooks", Notebooks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
