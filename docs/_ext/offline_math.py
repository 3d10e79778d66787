"""Formulas as MathML, which every current browser draws by itself: no script, no font and no picture to fetch.

MathJax and KaTeX would come from another server, or as megabytes of scripts beside the pages; MathML is text in the
page, by the converter that docutils brings, and a formula it cannot read is a warning, so that the build fails.
"""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging

_LOG = logging.getLogger(__name__)


def _markup(node: nodes.Element, block: bool) -> str:
    formula = re.sub(r"(?<![{])°", r"\\text{°}", node.astext())  # the one character of ours that the converter lacks
    try:
        return tex2mathml(formula, as_block=block)
    except MathError as error:
        _LOG.warning("formula %r: %s", node.astext(), error, location=node)
        return f"<code>{node.astext()}</code>"


def _inline(self: Any, node: nodes.Element) -> None:
    self.body.append(_markup(node, False))
    raise nodes.SkipNode


def _block(self: Any, node: nodes.Element) -> None:
    self.body.append(f'<div class="formula">{_markup(node, True)}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer ``mathml``."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
