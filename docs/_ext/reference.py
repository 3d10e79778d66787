"""The reference: one page for each section of api.md, from the docstrings of the names it lists.

api.md stays a plain list, which a test compares with ``cc.__all__``; its names become links when the site is built.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

import cartctl as cc

_ITEM = re.compile(r"^- `(\w+)`", re.MULTILINE)
_SECTION = re.compile(r"^## (.*?)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
_MODULES = ("analysis", "bench", "calibration", "dynamics", "spatial", "statics")
# Literals, roles and single backticks stay as they are; everything else in a docstring is plain text.
_CODE = re.compile(r"(``.+?``|:[\w:]+:`[^`]+`|`[^`]+`)")
_MARKUP = re.compile(r"([*|]|_(?=\W|$))")


def sections(text: str) -> dict[str, list[str]]:
    """The title of each section of api.md with the names it lists."""
    return {title: names for title, body in _SECTION.findall(text) if (names := _ITEM.findall(body))}


def slug(title: str) -> str:
    """A file's name."""
    return re.sub(r"\W+", "-", title.lower()).strip("-")


def write_pages(app: Sphinx) -> None:
    """One page a section, one a module; a page that has not changed is left alone, so that it is not built again."""
    folder = Path(app.srcdir) / "reference"
    folder.mkdir(exist_ok=True)
    pages = {slug(title): page(title, names) for title, names in sections(_api(app)).items()}
    pages |= {f"cartctl-{name}": module_page(name) for name in _MODULES}
    for old in folder.glob("*.md"):
        if old.stem not in pages:
            old.unlink()
    for name, text in pages.items():
        file = folder / f"{name}.md"
        if not file.exists() or file.read_text(encoding="utf-8") != text:
            file.write_text(text, encoding="utf-8")


def _api(app: Sphinx) -> str:
    return (Path(app.srcdir) / "api.md").read_text(encoding="utf-8")


def page(title: str, names: list[str]) -> str:
    """A page of autodoc's directives."""
    lines = [f"# {title}", "", "```{eval-rst}"]
    for name in names:
        thing = getattr(cc, name)
        if inspect.ismodule(thing):  # the package of solvers, which is also the list of them
            lines += [f".. py:function:: cartctl.{name}()", "", *(f"   {line}" for line in _doc(thing))]
        elif inspect.isclass(thing):
            hidden = [m for m, value in vars(thing).items() if m == "sources" or isinstance(value, _slot(thing))]
            lines += [f".. autoclass:: cartctl.{name}", "   :members:"]
            lines += [f"   :exclude-members: {', '.join(hidden)}"] if hidden else []
        else:
            lines += [f".. autofunction:: cartctl.{name}"]
        lines += [""]
    return "\n".join([*lines, "```", ""])


def _slot(thing: type) -> type:
    return type(vars(cc.Equation)["weight"])  # the member descriptors of slots, which the class's docstring explains


def _doc(package: Any) -> list[str]:
    lines = (inspect.getdoc(package.solvers) or "").splitlines()
    return prose(lines)


def module_page(name: str) -> str:
    """A module's own names."""
    module = getattr(cc, name)
    names = getattr(module, "__all__", None) or [
        n for n, value in vars(module).items() if not n.startswith("_") and not inspect.ismodule(value)
    ]
    lines = [f"# cartctl.{name}", "", "```{eval-rst}", f".. automodule:: cartctl.{name}", "   :no-members:", ""]
    for item in sorted(set(names) - set(cc.__all__)):
        thing = getattr(module, item)
        if not (inspect.isclass(thing) or inspect.isroutine(thing)):
            continue
        kind = "autoclass" if inspect.isclass(thing) else "autofunction"
        lines += [f".. {kind}:: cartctl.{name}.{item}", *(["   :members:"] if kind == "autoclass" else []), ""]
    return "\n".join([*lines, "```", ""])


def link_names(app: Sphinx, docname: str, source: list[str]) -> None:
    """In api.md, every name of a list leads to its page, and the pages get their place in the tree."""
    if docname != "api":
        return
    pages = [*(slug(title) for title in sections(source[0])), *(f"cartctl-{name}" for name in _MODULES)]
    tree = ["", "```{toctree}", ":hidden:", "", *(f"reference/{name}" for name in pages), "```", ""]
    source[0] = _ITEM.sub(r"- {py:obj}`\1 <cartctl.\1>`", source[0]) + "\n".join(tree)


def prose(lines: list[str]) -> list[str]:
    """A docstring's lines as reStructuredText: what is markup by accident, ``||J||`` or ``r_``, is escaped.

    A block ``Fields:`` becomes a list with one item a field.
    """
    done, example, fields = [], False, False
    for line in lines:
        if line == "Fields:":
            fields = True
            done += ["Fields:", ""]
            continue
        fields = fields and (not line or line.startswith("    "))
        if fields and line.startswith("    "):
            name, colon, rest = line.strip().partition(":")
            line = f"  {line.strip()}" if line.startswith("        ") else f"- ``{name}``{colon}{rest}"
        example = line.lstrip().startswith(">>>") or (example and bool(line.strip()))
        if example:
            done.append(line)
        else:
            parts = _CODE.split(line)
            done.append("".join(p if i % 2 else _MARKUP.sub(r"\\\1", p) for i, p in enumerate(parts)))
    return done


def plain(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Autodoc's docstrings, escaped."""
    lines[:] = prose(lines)


def hide(app: Sphinx, what: str, name: str, obj: Any, skip: bool, options: Any) -> bool | None:
    """Classes that are attributes of others, such as the kind of bounds of a level, are nobody's business."""
    return True if what == "class" and inspect.isclass(obj) else None


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the handlers."""
    app.connect("builder-inited", write_pages)
    app.connect("source-read", link_names)
    app.connect("autodoc-process-docstring", plain)
    app.connect("autodoc-skip-member", hide)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
