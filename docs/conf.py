"""The documentation site: `make docs` builds it into build/site, warnings are errors, nothing is downloaded."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent)]

from cartctl import __version__  # noqa: E402

project = "cartctl"
author = "The cartctl developers"
copyright = "The cartctl developers, BSD-3-Clause"  # noqa: A001
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "results",
    "methods",
    "notebooks",
    "reference",
    "offline_math",
]
source_suffix = {".md": "markdown"}
root_doc = "index"
nitpicky = True
# What is not public has no page: types in signatures, and modules and methods that docstrings send a developer to.
nitpick_ignore_regex = [
    ("py:class", r"(?!cartctl\.[A-Z]\w*$).*"),
    ("py:data", r".*"),
    ("py:mod", r"cartctl\..*"),
    ("py:meth", r"_\w+"),
    ("py:func", r"cartctl\.(model|calibration)\..*"),
    ("py:attr", r"Batch\.reason"),
    ("py:meth", r"RobotChain\.urdf"),
]

myst_enable_extensions = ["colon_fence", "dollarmath", "deflist"]
myst_heading_anchors = 3
myst_dmath_double_inline = False

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_type_aliases = {"FloatArray": "FloatArray", "Array": "Array"}
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 90
default_role = "code"

html_theme = "furo"
html_title = "cartctl"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
html_math_renderer = "mathml"
pygments_style = "friendly"
pygments_dark_style = "native"
