"""Execute the notebooks: source/NN_name.py, which people edit, becomes NN_name.ipynb with its outputs.

    python notebooks/build.py                  # all of them, as `make notebooks` does
    python notebooks/build.py 03 07            # these

Sources are in jupytext's percent format: Jupyter opens them as notebooks, ruff and a diff read them as Python.
Cells are numbered and times left out, so that an .ipynb changes only where its source or its results do.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import jupytext
import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode
from traitlets.config import Config

HERE = Path(__file__).resolve().parent
SOURCES = sorted((HERE / "source").glob("[0-9][0-9]_*.py"))


def made_from(source: Path) -> Path:
    """Where the notebook of a source is kept."""
    return HERE / f"{source.stem}.ipynb"


def read(source: Path) -> NotebookNode:
    """The notebook that a source describes, without outputs."""
    book = jupytext.read(source, fmt="py:percent")
    for number, cell in enumerate(book.cells):
        cell.id, cell.metadata = f"cell-{number:02d}", NotebookNode()
    spec = {"display_name": "Python 3", "language": "python", "name": "python3"}
    book.metadata = NotebookNode(kernelspec=spec, language_info={"name": "python"})
    return book


# What is kept shall not depend on whether the compiled kernels were on disk already.
QUIET = "import logging; logging.getLogger('cartctl').addFilter(lambda record: 'compiling' not in record.msg)\n"


def execute(book: NotebookNode, startup: str = QUIET, timeout: float = 900.0) -> NotebookNode:
    """Run it with the cartctl of this repository, in a kernel that knows no settings of the user's.

    startup: Python that the kernel runs before. Raises CellExecutionError, CellTimeoutError.
    """
    paths = [str(HERE.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
    inline = "module://matplotlib_inline.backend_inline"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "MPLBACKEND": inline}
    with TemporaryDirectory() as folder:
        first = Path(folder) / "profile_default" / "startup" / "first.py"
        first.parent.mkdir(parents=True)
        first.write_text(startup)
        # the kernel's sockets are files, not ports
        config = Config(AsyncKernelManager={"transport": "ipc", "ip": str(Path(folder) / "kernel")})
        here = {"metadata": {"path": str(HERE)}}
        client = NotebookClient(
            book, timeout=timeout, record_timing=False, resources=here, config=config
        )
        client.execute(env={**env, "IPYTHONDIR": folder})
    book.metadata.language_info = NotebookNode(
        name="python"
    )  # no version: it differs from machine to machine
    return book


def main(wanted: list[str]) -> None:
    """Build the notebooks whose numbers are given, or all."""
    for source in SOURCES:
        if not wanted or source.name[:2] in wanted:
            print(source.stem, flush=True)
            nbformat.write(execute(read(source)), made_from(source))


if __name__ == "__main__":
    main(sys.argv[1:])
