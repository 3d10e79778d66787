"""Other projects' inverse kinematics in the same loop and the same table.

A peer is one file that knows its own package, numpy and nothing of cartctl: ``roll(request) -> answer``, plain data
both. Where its package can be imported it runs in this process; else, where ``CARTCTL_PEER_<NAME>`` names a Python
that has it, in a process of that Python. Otherwise its runs are skipped, with the reason.

To add one, write such a file and name it in ``CARTCTL_PEERS`` as ``name=/path/to/file.py``, parted by commas.
"""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from cartctl.errors import ParameterError

if TYPE_CHECKING:
    from cartctl.bench.building import Stage
    from cartctl.motion.run import Run

_HERE = Path(__file__).parent
_RTB = "roboticstoolbox"


class PeerUnavailable(ParameterError):  # noqa: N818 - names what the peer is
    """A peer is not installed, or cannot do what a scenario asks."""


class Peer(NamedTuple):
    """A peer: its file, the module that it needs ("" for what its file alone knows), how to get it."""

    name: str
    file: Path
    module: str
    install: str

    @property
    def variable(self) -> str:
        """The environment variable that names a Python of its own."""
        return "CARTCTL_PEER_" + self.name.upper().replace("-", "_")

    @property
    def python(self) -> str | None:
        """A Python of its own, None for this one."""
        return os.environ.get(self.variable) or None

    def missing(self) -> str:
        """Why it cannot run here, "" if it can."""
        if self.python is not None:
            found = Path(self.python).is_file()
            return "" if found else f"{self.variable} is {self.python!r}, which is no file; expected a Python"
        if not self.module or importlib.util.find_spec(self.module) is not None:
            return ""
        return f"{self.module} is not installed; {self.install}, or set {self.variable} to a Python that has it"


def peers() -> dict[str, Peer]:
    """All peers by name, installed or not; raises ParameterError for a CARTCTL_PEERS that cannot be read."""
    known = [
        Peer("pink", _HERE / "pink_peer.py", "pink", "pip install pin-pink"),
        Peer(_RTB, _HERE / f"{_RTB}_peer.py", _RTB, "pip install roboticstoolbox-python"),
        Peer("placo", _HERE / "placo_peer.py", "placo", "pip install placo (in an environment of its own)"),
    ]  # fmt: skip
    for entry in filter(None, os.environ.get("CARTCTL_PEERS", "").split(",")):
        name, equals, file = entry.strip().partition("=")
        if not equals or not name or not Path(file).is_file():
            raise ParameterError(f"CARTCTL_PEERS holds {entry!r}; expected name=/path/to/file.py, parted by commas")
        known.append(Peer(name, Path(file), "", ""))
    return {peer.name: peer for peer in known}


def roll(name: str, stage: Stage, level: str) -> Run:
    """The Run of a peer: see :mod:`cartctl.bench.peers.rollout`."""
    from cartctl.bench.peers import rollout

    return rollout.roll(peers()[name], stage, level)
