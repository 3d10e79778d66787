"""The web server behind the page: on this machine only, silent, and aware of whether anybody looks."""

from __future__ import annotations

import io
import logging
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

from cartctl import checks
from cartctl.errors import ParameterError
from cartctl.viewer.extra import viser

HOST = "127.0.0.1"
PORT = 8080  # or the next one that is free
_GRACE = 3.0  # s without a browser until nobody is expected back: a page that is reloaded comes back sooner


class Window:
    """A viser server on the loopback interface; ``server`` is viser's own object, ``url`` where its page is.

    port: None for the first free one from ``PORT`` on, 0 for any. Raises MissingDependencyError; ParameterError for a
    port that is taken or none.
    """

    def __init__(self, port: int | None = None, title: str = "cartctl") -> None:
        kind = _local(viser())
        if port:
            _require_free(port)
        self._logger = logging.getLogger("websockets.server")  # reports every stray connection with a traceback
        self._loud = self._logger.level
        self._logger.setLevel(logging.CRITICAL)
        with _silence():
            self.server: Any = kind(host=HOST, port=PORT if port is None else port, verbose=False)
        self.url = f"http://{HOST}:{self.server.get_port()}"
        self._lock = threading.Lock()
        self._watching: set[int] = set()
        self._left: float | None = None
        self.server.on_client_connect(self._comes)
        self.server.on_client_disconnect(self._goes)
        self.server.gui.set_panel_label(title)

    @property
    def watched(self) -> bool:
        """Whether a browser shows the page."""
        with self._lock:
            return bool(self._watching)

    @property
    def deserted(self) -> bool:
        """Whether all who looked have gone, and none has come back for a while."""
        with self._lock:
            return self._left is not None and time.monotonic() - self._left > _GRACE

    def close(self) -> None:
        """End the server."""
        with _silence():
            self.server.stop()
        self._logger.setLevel(self._loud)

    def _comes(self, client: Any) -> None:
        with self._lock:
            self._watching.add(client.client_id)
            self._left = None

    def _goes(self, client: Any) -> None:
        with self._lock:
            self._watching.discard(client.client_id)
            if not self._watching:
                self._left = time.monotonic()


def _local(module: Any) -> Any:
    """Viser's server without the tunnel by which any page it serves could ask it to be shown to the world."""

    class Local(module.ViserServer):  # type: ignore[misc]
        def request_share_url(self, verbose: bool = True) -> str | None:
            return None

    return Local


def _require_free(port: int) -> None:
    checks.number("port", port, low=0.0)
    if port > 65535:
        raise ParameterError(f"port is {port}; expected a number up to 65535")
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            reason = error.strerror or error
            raise ParameterError(f"port is {port}: {reason}; leave it out to take the next free one") from None


@contextmanager
def _silence() -> Iterator[None]:
    """Viser prints what the caller says better."""
    with redirect_stdout(io.StringIO()):
        yield
