"""The same by the Robotics Toolbox's compiled ``ik_LM`` (Chan's damping, 30 steps a search, 100 searches), one by one.

requires: roboticstoolbox-python==1.5.0

The chain is the job's own, joint by joint, so that both solve for the same frame. Its tolerance is on half the squared
error: 5e-9 asks for 0.1 mm of position and orientation together, what the race checks for.
"""

from __future__ import annotations

import numpy as np
from roboticstoolbox import ET, ETS
from worker import job, serve

data = job()
parts = []
for i, place in enumerate(data["places"]):
    parts += [ET.SE3(place), ET.Rz(jindex=i, qlim=data["limits"][:, i])]
chain = ETS([*parts, ET.SE3(data["tool"])])
targets, tolerance = [np.ascontiguousarray(T) for T in data["targets"]], float(data["tolerance"])


def work() -> dict:
    """Target after target: its compiled function takes one."""
    np.random.seed(0)
    found = [chain.ik_LM(T, tol=tolerance) for T in targets]
    return {"q": np.array([s.q for s in found]), "claimed": np.array([bool(s.success) for s in found])}


serve(("roboticstoolbox-python", "numpy"), work)
