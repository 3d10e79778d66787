"""A headless Chromium for the tests: take pictures of a page, with every name on the network unresolvable."""

from __future__ import annotations

import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-default-apps",
    "--disable-dev-shm-usage",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--host-resolver-rules=MAP * ~NOTFOUND",
    "--enable-logging=stderr",
)  # fmt: skip
REQUEST = re.compile(r'"url":"((?!file:|data:|blob:|about:|chrome)[^"]*)"')
OWN = re.compile(r"https?://[\w.-]*\.(google|googleapis|gvt1)\.com/")  # what the browser asks for by itself
CONSOLE = re.compile(r"CONSOLE[:(\d)]*\] ?\"(.*)\", source:")


def find() -> str | None:
    """Return the path of a Chromium, or None."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


needs_chromium = pytest.mark.skipif(find() is None, reason=f"no Chromium on PATH (looked for {', '.join(NAMES)})")


@dataclass(frozen=True)
class Shot:
    """What a page looked like, (height, width, 3) uint8, wrote to its console, and asked of the network."""

    pixels: np.ndarray
    console: list[str]
    requests: list[str]


def shoot(page: Path, fragment: str = "", milliseconds: int = 1000, size: tuple[int, int] = (1280, 800)) -> Shot:
    """Open ``page``, let ``milliseconds`` of its own clock pass, and take its picture."""
    program = find()
    assert program is not None, "mark the test with needs_chromium"
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        done = subprocess.run(
            [program, *FLAGS, f"--user-data-dir={folder / 'profile'}", f"--window-size={size[0]},{size[1]}",
             f"--virtual-time-budget={milliseconds}", f"--log-net-log={folder / 'net.json'}",
             f"--screenshot={folder / 'page.png'}", page.resolve().as_uri() + fragment],
            capture_output=True, text=True, errors="replace", timeout=120, check=False,
        )  # fmt: skip
        assert (folder / "page.png").exists(), f"Chromium took no picture: {done.stderr[-2000:]}"
        asked = set(REQUEST.findall((folder / "net.json").read_text(encoding="utf-8", errors="replace")))
        with Image.open(folder / "page.png") as image:
            pixels = np.asarray(image.convert("RGB"))
    console = [line for line in CONSOLE.findall(done.stderr) if "GL Driver Message" not in line]
    return Shot(pixels, console, sorted(url for url in asked if not OWN.match(url)))


def share(shot: Shot, rgb: tuple[int, int, int], tolerance: int = 30) -> float:
    """Return the share of pixels within ``tolerance`` of a colour, in each channel."""
    return float((np.abs(shot.pixels.astype(int) - rgb).max(axis=2) <= tolerance).mean())


def difference(a: Shot, b: Shot, rows: slice = slice(None), columns: slice = slice(None)) -> float:
    """Return the share of pixels that differ visibly between two pictures, within some rows and columns."""
    gap = np.abs(a.pixels[rows, columns].astype(int) - b.pixels[rows, columns].astype(int)).max(axis=2)
    return float((gap > 24).mean())
