"""A headless Chromium for the tests: take pictures of a page, with every name on the network unresolvable."""

from __future__ import annotations

import base64
import io
import json
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-default-apps",
    "--disable-dev-shm-usage",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
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


class Tab:
    """One page in a Chromium that stays: it is clicked, dragged and asked, and notes console and requests."""

    def __init__(self, socket: Any) -> None:
        self._socket, self._number = socket, 0
        self.console: list[str] = []
        self.requests: list[str] = []
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> Any:
        """One command of the DevTools protocol, and its answer."""
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(timeout=60))
            if message.get("id") == self._number:
                assert "error" not in message, f"{method}: {message['error']}"
                return message["result"]
            self._note(message)

    def _note(self, message: dict[str, Any]) -> None:
        what, given = message.get("method"), message.get("params", {})
        if what == "Runtime.consoleAPICalled" and given["type"] in ("error", "warning", "assert"):
            self.console.append(" ".join(str(a.get("value", a.get("description"))) for a in given["args"]))
        elif what == "Runtime.exceptionThrown":
            self.console.append(str(given["exceptionDetails"].get("exception", {}).get("description")))
        elif what == "Log.entryAdded" and given["entry"]["level"] == "error":
            self.console.append(str(given["entry"]["text"]))
        elif what in ("Network.requestWillBeSent", "Network.webSocketCreated"):
            url = given["url"] if "url" in given else given["request"]["url"]
            if not url.startswith(("data:", "blob:", "file:")):
                self.requests.append(url)

    def open(self, url: str) -> None:
        """Go to a page, loaded anew, forgetting what was noted of the last one."""
        for address, sign in (("about:blank", "==="), (url, "!==")):  # another moment of one page would load nothing
            self.call("Page.navigate", url=address)
            self.until(f"location.href {sign} 'about:blank' && document.readyState === 'complete'")
            if sign == "===":
                self.console, self.requests = [], []

    def resize(self, width: int, height: int, phone: bool = False) -> None:
        """Give the page another size, as on a phone or not."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=phone
        )  # fmt: skip

    def ask(self, expression: str) -> Any:
        """The value of an expression in the page."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, f"{expression}: {answer['exceptionDetails']}"
        return answer["result"].get("value")

    def until(self, expression: str, seconds: float = 60.0) -> None:
        """Wait for an expression to become true."""
        end = time.monotonic() + seconds
        while not self.ask(expression):
            assert time.monotonic() < end, f"{expression} did not become true in {seconds:g} s"
            time.sleep(0.1)

    def picture(self) -> Shot:
        """What the page looks like now."""
        data = self.call("Page.captureScreenshot", format="png")["data"]
        with Image.open(io.BytesIO(base64.b64decode(data))) as image:
            pixels = np.asarray(image.convert("RGB"))
        return Shot(pixels, list(self.console), sorted(set(self.requests)))

    def look(self, page: Path, fragment: str = "", size: tuple[int, int] = (1280, 800), phone: bool = False) -> Shot:
        """What a page looks like at a moment, in a window of this size."""
        self.resize(*size, phone=phone)
        self.open(page.resolve().as_uri() + fragment)
        return self.picture()

    def drag(self, start: tuple[float, float], end: tuple[float, float], moves: int = 8) -> None:
        """Press the mouse at one place and let it go at another, in px."""
        self._mouse("mouseMoved", *start)
        self._mouse("mousePressed", *start, button="left", clickCount=1)
        for k in range(1, moves + 1):
            x, y = (a + (b - a) * k / moves for a, b in zip(start, end, strict=True))
            self._mouse("mouseMoved", x, y, button="left", buttons=1)
            time.sleep(0.02)
        self._mouse("mouseReleased", *end, button="left", clickCount=1)

    def _mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)


@contextmanager
def browser(size: tuple[int, int] = (1280, 800)) -> Iterator[Tab]:
    """A tab of a Chromium that lives as long as the block, with every name on the network unresolvable."""
    program = find()
    assert program is not None, "mark the test with needs_chromium"
    connect = pytest.importorskip("websockets.sync.client").connect
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        flags = [f"--user-data-dir={profile}", f"--window-size={size[0]},{size[1]}", "--remote-debugging-port=0"]
        command = [program, *FLAGS, *flags, "about:blank"]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            try:
                with connect(_page_address(Path(profile)), max_size=None, open_timeout=30) as socket:
                    tab = Tab(socket)
                    tab.resize(*size)
                    yield tab
            finally:
                process.terminate()


def _page_address(profile: Path) -> str:
    """Where the first tab of a Chromium that has just started listens."""
    port_file, end = profile / "DevToolsActivePort", time.monotonic() + 60
    while not port_file.exists() or not port_file.read_text().count("\n"):
        assert time.monotonic() < end, "Chromium did not start"
        time.sleep(0.05)
    port, root = port_file.read_text().split()[:2]
    connect = pytest.importorskip("websockets.sync.client").connect
    with connect(f"ws://127.0.0.1:{port}{root}", max_size=None) as socket:
        socket.send(json.dumps({"id": 1, "method": "Target.getTargets"}))
        targets = json.loads(socket.recv(timeout=30))["result"]["targetInfos"]
    page = next(target["targetId"] for target in targets if target["type"] == "page")
    return f"ws://127.0.0.1:{port}/devtools/page/{page}"
