"""Putting a page together: meshcat's own viewer, inlined, and the commands a meshcat server would have sent it.

A content security policy forbids every request and every script but the two written here, so that nothing in a
robot's description can do more than be shown.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from string import Template
from typing import TYPE_CHECKING

from cartctl.report.curves import Panel, rounded
from cartctl.report.palette import COLORS
from cartctl.report.recorder import Recorder
from cartctl.report.scene import Scene, Switch

if TYPE_CHECKING:
    from cartctl.motion.run import Run


@dataclass(frozen=True)
class Words:
    """What stands around the picture: text, but for ``heading``, ``caption`` and ``below``, which are HTML.

    traced: what the legend says of the paths that were made, "" to say nothing.
    """

    title: str
    heading: str
    subtitle: str
    caption: str = ""
    below: str = ""
    traced: str = "actual path"


def assemble(
    runs: Sequence[Run], words: Words, colors: Sequence[str] = COLORS[:1], panels: Sequence[Panel] = ()
) -> str:
    """Return the page that shows ``runs``, the paths and ghosts of each in its colour, and ``panels`` beside them."""
    recorder = Recorder()
    scene = Scene(runs, recorder.visualizer(), colors)
    scene.draw()
    commands = [base64.b64encode(command).decode("ascii") for command in recorder.commands]
    data = json.dumps({"aspect": scene.stage.view.aspect, "commands": commands, "panels": rounded(panels)})
    data = data.replace("<", "\\u003c")  # names from a URDF close no element
    viewer, player = _viewer("main.min.js"), _own("plots.js") + _own("player.js")
    for script in (data, viewer, player):
        assert "</script" not in script.lower()
    caption = words.caption + _legend(words.traced if scene.records else None, len(scene.obstacles))
    header = f'<header id="caption"><h1>{words.heading}</h1><p>{escape(words.subtitle)}</p>{caption}</header>'
    return Template(_own("page.html")).substitute(
        policy=_policy(viewer, player), version=escape(_version()), style=_own("page.css"),
        title=escape(words.title), over="" if panels else header, beside=header if panels else "",
        switches="".join(_switch(switch) for switch in scene.switches),
        below=words.below,
        kind="several" if len(runs) > 1 else "single", side="" if panels else "hidden",
        scene=data, viewer=viewer, player=player, licences=escape(_licences()),
    )  # fmt: skip


def breakable(name: str) -> str:
    """Return a name from a URDF as HTML that may break after its underscores."""
    return escape(name).replace("_", "_<wbr>")


def _legend(traced: str | None, obstacles: int) -> str:
    """Return the key to what is drawn beside the robot; traced: None where no task has a place in the world."""
    entries = []
    if traced is not None:
        entries = [("dot desired", "target"), ("desired", "desired path")] + [("traced", traced)] * bool(traced)
    if obstacles:
        entries.append(("dot obstacle", "obstacle" if obstacles == 1 else "obstacles"))
    if not entries:
        return ""
    return "<ul>" + "".join(f'<li class="{kind}">{escape(text)}</li>' for kind, text in entries) + "</ul>"


def _switch(switch: Switch) -> str:
    """Return a switch with the words that explain it, which are shown while it is on."""
    box = f'<input type="checkbox" data-paths="{escape(switch.paths)}" autocomplete="off"{" checked" * switch.on}>'
    label = f'<label>{box}<i style="background:{switch.color}"></i>{escape(switch.label)}</label>'
    return f"{label}<small>{escape(switch.words)}.</small>" if switch.words else label


def _policy(*scripts: str) -> str:
    """Return the content security policy: these very scripts, inline styles, embedded images, nothing else."""
    hashes = (base64.b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in scripts)
    sources = " ".join(f"'sha256-{digest}'" for digest in hashes)
    return f"default-src 'none'; script-src {sources}; style-src 'unsafe-inline'; img-src data: blob:"


def _viewer(name: str) -> str:
    """Return a file of meshcat's bundled viewer."""
    return (files("meshcat") / "viewer" / "dist" / name).read_text(encoding="utf-8")


def _licences() -> str:
    """Return the terms under which the viewer, and what it was built from, may be passed on."""
    listed = json.loads(_viewer("main.min.js.THIRD_PARTY_LICENSES.json"))
    texts = [f"{entry['name']} {entry['version']}\n\n{entry['licenseText']}" for entry in listed]
    own = (files("meshcat") / "viewer" / "LICENSE").read_text(encoding="utf-8")
    return "\n\n".join([f"meshcat\n\n{own}", _viewer("main.min.js.LICENSE.txt"), *texts])


def _own(name: str) -> str:
    return (files("cartctl.report") / "page" / name).read_text(encoding="utf-8")


def _version() -> str:
    try:
        return version("cartctl")
    except PackageNotFoundError:  # run from a source tree that was never installed
        return ""
