"""The notebooks of the repository as pages: nothing is executed, their kept outputs are shown as they are.

Where there are any, ``docs/lectures/`` is written before the pages are read; the directive ``notebooks`` lists them.
"""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

FOLDER = Path(__file__).parents[2] / "notebooks"


def text_of(value: Any) -> str:
    """A notebook's text is a string or a list of lines."""
    return value if isinstance(value, str) else "".join(value)


def fenced(text: str, language: str) -> str:
    """A block of code or of output."""
    fence = "`" * max(3, 1 + max((len(run) for run in re.findall(r"`+", text)), default=0))
    return f"{fence}{language}\n{text.rstrip()}\n{fence}"


def page(notebook: Path, folder: Path) -> str:
    """One notebook as Markdown; its pictures are written beside it."""
    parts = []
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        source = text_of(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else fenced(source, "python"))
        for output in cell.get("outputs", []):
            data = output.get("data", {})
            if "image/png" in data:
                picture = folder / f"{notebook.stem}-{len(parts)}.png"
                picture.write_bytes(base64.b64decode(text_of(data["image/png"])))
                parts.append(f"![what the cell above draws]({picture.name})")
            elif said := text_of(output.get("text", data.get("text/plain", ""))).strip():
                parts.append(fenced(said, "text"))
    where = f"*This is `notebooks/{notebook.name}` with the outputs it is kept with.*"
    return "\n\n".join([parts[0], where, *parts[1:]]) + "\n"


def write_pages(app: Sphinx) -> None:
    """All of them, and nothing that is none of them."""
    folder = Path(app.srcdir) / "lectures"
    found = {notebook.stem: notebook for notebook in sorted(FOLDER.glob("*.ipynb"))}
    folder.mkdir(exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    for stem, notebook in found.items():
        (folder / f"{stem}.md").write_text(page(notebook, folder), encoding="utf-8")


def about(notebook: Path) -> tuple[str, str]:
    """The first heading of a notebook, and the first sentence of prose below it, as Markdown."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    text = "\n\n".join(text_of(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    text = re.sub(r"\$\$.*?\$\$", "", text, flags=re.DOTALL)
    heads = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    paragraphs = [" ".join(part.split()) for part in re.split(r"\n\s*\n", text)]
    words = [part for part in paragraphs if part and part[0] not in "#|!-*<"]
    sentence = re.match(r"(.*?[.?!:])(?: |$)", words[0]) if words else None
    return (heads or [notebook.stem])[0], sentence[1].replace("*", "").rstrip(":") if sentence else ""


class Notebooks(SphinxDirective):
    """A list of them, which also gives the pages their place in the tree."""

    def run(self) -> list[nodes.Node]:
        """Title and first sentence of each; a sentence where there are none."""
        found = sorted(FOLDER.glob("*.ipynb"))
        if not found:
            return [nodes.paragraph(text="This copy of the repository has none.")]
        lines = []
        for notebook in found:
            self.env.note_dependency(str(notebook))
            title, words = about(notebook)
            lines += [f"- [{title}](lectures/{notebook.stem}.md)  ", f"  {words}"]
        lines += ["", "```{toctree}", ":hidden:", "", *(f"lectures/{notebook.stem}" for notebook in found), "```"]
        box = nodes.Element()
        self.state.nested_parse(StringList(lines, source=self.get_source_info()[0]), 0, box)
        return box.children


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive, and what writes the pages."""
    app.connect("builder-inited", write_pages)
    app.add_directive("notebooks", Notebooks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
