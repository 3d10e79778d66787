"""One self-contained HTML file with the moving robot: opens anywhere, asks the network for nothing.

The viewer is meshcat's own script, inlined; the scene is the list of commands a meshcat server would have received.
A content security policy forbids every request and every script but the two written here, so that nothing in a
robot's description can do more than be shown.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
from collections.abc import Iterator
from html import escape
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

from cartctl.errors import ParameterError
from cartctl.files import whole_file
from cartctl.report.recorder import Recorder
from cartctl.report.scene import Scene

if TYPE_CHECKING:
    from cartctl.motion.run import Run


def write_html(run: Run, path: str | os.PathLike[str]) -> Path:
    """Write ``run`` to ``path`` as one HTML file and return its path; missing folders are made.

    The file appears only when it is complete. Raises ParameterError if ``path`` is a folder.
    """
    text = page(run)
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8", newline="\n")
    return Path(path)


def page(run: Run) -> str:
    """Return the page of ``run`` as text; raises ParameterError for a run without a sample."""
    if not len(run.time):
        raise ParameterError("the run holds no sample; expected one that was simulated for at least a step")
    recorder = Recorder()
    scene = Scene(run, recorder.visualizer())
    scene.draw()
    commands = [base64.b64encode(command).decode("ascii") for command in recorder.commands]
    data = json.dumps({"aspect": scene.view.aspect, "commands": commands})
    viewer, player = _viewer("main.min.js"), _own("player.js")
    for script in (data, viewer, player):
        assert "</script" not in script.lower()  # numbers, base64, and two known files
    return Template(_own("page.html")).substitute(
        policy=_policy(viewer, player), version=escape(_version()), style=_own("page.css"),
        title=escape(f"{run.robot.name}: {_subtitle(run)}"), heading=_name(run.robot.name),
        subtitle=escape(_subtitle(run)), errors=_errors(run), legend=_legend(scene),
        scene=data, viewer=viewer, player=player, licences=escape(_licences()),
    )  # fmt: skip


def _policy(*scripts: str) -> str:
    """Return the content security policy: these very scripts, inline styles, embedded images, nothing else."""
    hashes = (base64.b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in scripts)
    sources = " ".join(f"'sha256-{digest}'" for digest in hashes)
    return f"default-src 'none'; script-src {sources}; style-src 'unsafe-inline'; img-src data: blob:"


def _subtitle(run: Run) -> str:
    """Return what was run, in one line."""
    steps = len(run.time) - 1
    parts = [str(run.meta.get("solver", "")), f"{run.meta['level']} level" if run.meta.get("level") else ""]
    parts.append(f"{float(run.time[-1] - run.time[0]):.2f} s in {steps} step{'' if steps == 1 else 's'}")
    parts.append("interrupted" if run.interrupted else "")
    return " · ".join(p for p in parts if p)


def _errors(run: Run) -> str:
    """Return a table of the tracking errors of the tasks that have a place in the world."""
    if not len(run):
        return ""
    rows = "".join(
        f'<tr><th scope="row">{_name(task.name)}</th>{"".join(f"<td>{cell}</td>" for cell in _cells(task))}</tr>'
        for task in run.metrics().tasks
        if task.rms_m is not None or task.rms_rad is not None
    )
    head = "<tr><th>error</th><th>RMS</th><th>largest</th></tr>"
    return f"<table><thead>{head}</thead><tbody>{rows}</tbody></table>" if rows else ""


def _name(name: str) -> str:
    """Return a name from a URDF as HTML that may break after its underscores."""
    return escape(name).replace("_", "_<wbr>")


def _cells(task: Any) -> Iterator[str]:
    for metre, radian in ((task.rms_m, task.rms_rad), (task.max_m, task.max_rad)):
        pairs = ((metre, ("m", "mm", "µm", "nm")), (radian, ("rad", "mrad", "µrad", "nrad")))
        yield "<br>".join(quantity(value, units) for value, units in pairs if value is not None)


def quantity(value: float, units: tuple[str, ...]) -> str:
    """Return ``value`` with three digits, in the first unit that gives 1 or more.

    Each of ``units`` is a thousandth of the one before; ``value`` is in the first.
    """
    for k, unit in enumerate(units):
        if abs(value) * 1000**k >= 1 or k == len(units) - 1:
            number = value * 1000**k
            return f"{number:.3g} {unit}" if abs(number) >= 0.01 else f"0 {unit}"
    return ""


def _legend(scene: Scene) -> str:
    """Return the key to the colours, if there is anything to tell apart."""
    if not scene.records:
        return ""
    entries = (("dot desired", "target"), ("desired", "desired path"), ("traced", "actual path"))
    return "<ul>" + "".join(f'<li class="{kind}">{text}</li>' for kind, text in entries) + "</ul>"


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
