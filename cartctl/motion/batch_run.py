"""What a batch of rollouts brings back."""

from __future__ import annotations

from typing import Any

import numpy as np

from cartctl.checks import FloatArray
from cartctl.compiled.plan import Outcome, widths
from cartctl.compiled.workspace import NAMES
from cartctl.errors import ParameterError
from cartctl.motion.controller import Controller
from cartctl.motion.recorder import run_of_states
from cartctl.motion.run import Run


class Batch:
    """B rollouts of N steps; made by :func:`cartctl.simulate_batch`.

    time: (N+1,) s. q_end (B, nq), v_end (B, nv): the states after the last step. error_end: a list of one (B, m) a
    task, target minus value there. least_scales: (B, p) the smallest share of each command that was delivered, 0 where
    a task was skipped. statuses: status name -> (B,) how many steps came to it. q (B, N+1, nq), v (B, N+1, nv), errors
    (a list of (B, N+1, m)), scales (B, N, p), status (B, N) names: every step, None unless ``history=True``. reason:
    why it was stepped in Python, None where it was compiled. step_time: s of one core a step.
    """

    def __init__(
        self,
        controller: Controller,
        found: Outcome,
        t0: float,
        steps: int,
        reason: str | None,
        step_time: float,
        runs: list[Run] | None,
    ) -> None:
        self._controller, self._runs = controller, runs
        self.reason, self.step_time = reason, step_time
        self.time = t0 + controller.dt * np.arange(steps + 1, dtype=np.float64)
        self.q_end, self.v_end, self.least_scales = found.q, found.v, found.least
        edges = widths(controller.tasks, controller.robot)
        parts = list(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True))
        self.error_end: list[FloatArray] = [found.error[:, a:b] for a, b in parts]
        self.statuses: dict[str, Any] = {
            status.name: found.counts[:, k].astype(np.int64)
            for k, status in enumerate(NAMES)
            if found.counts[:, k].any()
        }
        self.q: FloatArray | None = None
        self.v: FloatArray | None = None
        self.errors: list[FloatArray] | None = None
        self.scales: FloatArray | None = None
        self.status: Any = None
        self._own: FloatArray | None = None
        if len(found.q_all):
            shape, p = (len(found.q), steps + 1, -1), len(controller.tasks)
            self.q, self.v = found.q_all.reshape(shape), found.v_all.reshape(shape)
            every = found.error_all.reshape(shape)
            self.errors = [every[:, :, a:b] for a, b in parts]
            told = found.step_all.reshape(shape)
            self.scales, self._own = told[:, :-1, 1 : 1 + p], told[:, :, 1 + p :]
            names = np.array([status.name for status in NAMES])
            self.status = names[told[:, :-1, 0].astype(np.int64)]
        elif runs:
            self.q, self.v = np.array([run.q for run in runs]), np.array([run.v for run in runs])
            self.errors = [np.array([run.tasks[k].error for run in runs]) for k in range(len(controller.tasks))]
            self.scales = np.array([np.array([task.scale for task in run.tasks]).T for run in runs])
            self.status = np.array([run.status for run in runs])

    def run(self, index: int) -> Run:
        """One rollout as a Run, with everything a Run holds; raises ParameterError without a history, or beyond it."""
        if self.q is None or self.v is None:
            raise ParameterError("the batch holds no history; expected cc.simulate_batch(..., history=True)")
        if isinstance(index, bool) or not isinstance(index, (int, np.integer)) or not -len(self) <= index < len(self):
            raise ParameterError(f"index is {index!r}; expected a whole number from 0 to {len(self) - 1}")
        if self._runs is not None:
            return self._runs[index]
        assert self.scales is not None and self._own is not None
        return run_of_states(
            self._controller,
            self.time,
            self.q[index],
            self.v[index],
            self.scales[index],
            self.status[index].tolist(),
            self._own[index],
            self.step_time,
        )

    def __len__(self) -> int:
        return len(self.q_end)

    def __repr__(self) -> str:
        how = "compiled" if self.reason is None else "in Python"
        return f"Batch({len(self)} rollouts of {len(self.time) - 1} steps, {how})"
