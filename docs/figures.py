"""One figure a method, showing what is characteristic of it.

    python docs/figures.py sns            # draws docs/_static/methods/sns.svg and prints its caption
    python docs/figures.py                # all of them; their captions go to docs/_static/methods/captions.json

The numbers in a caption are those of the figure; nothing is random without a seed.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from pictures import FIGURES
from pictures.style import drawn

HERE = Path(__file__).parent / "_static" / "methods"


def main(names: list[str]) -> int:
    """Draw the figures of the methods named, or of all."""
    unknown = [name for name in names if name not in FIGURES]
    if unknown:
        print(f"no figure of {', '.join(unknown)}; there are {', '.join(FIGURES)}", file=sys.stderr)
        return 2
    HERE.mkdir(parents=True, exist_ok=True)
    file = HERE / "captions.json"
    captions = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    for name in names or FIGURES:
        captions[name] = drawn(FIGURES[name], HERE / f"{name}.svg")
        print(f"{name}: {captions[name]}")
    file.write_text(json.dumps({name: captions[name] for name in FIGURES if name in captions}, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
