"""Rolling a controller out from many starts at once: in compiled loops on all cores, or step by step in Python."""

from __future__ import annotations

import warnings
from concurrent.futures import ThreadPoolExecutor
from time import perf_counter
from typing import Any

import numpy as np

from cartctl import checks
from cartctl.checks import FloatArray
from cartctl.compiled.plan import Loop, Outcome, prepared, widths
from cartctl.compiled.threads import thread_count
from cartctl.compiled.workspace import NAMES
from cartctl.errors import CartctlWarning, ParameterError, ShapeError, UnsupportedJoint, UnsupportedProblem
from cartctl.motion.batch_run import Batch
from cartctl.motion.controller import Controller
from cartctl.motion.run import Run
from cartctl.motion.simulate import simulate
from cartctl.motion.steps import whole_steps

_CHUNKS = 4  # a thread: the last one to end is then not far behind


def simulate_batch(
    controller: Controller,
    q0s: Any,
    duration: float = 1.0,
    *,
    v0s: Any = None,
    t0: float = 0.0,
    history: bool = False,
    threads: int | None = None,
) -> Batch:
    """Run ``controller`` from each of q0s (B, nq) for ``duration`` s, as :func:`cartctl.simulate` does: a Batch.

    Each start is a rollout of its own: nothing is carried from one to the next, and its numbers are the same to the
    last bit whatever the batch's size, order and threads. v0s: (nv,) or (B, nv), zeros if None. history: keep every
    step, (B, N+1, ...), which :meth:`Batch.run` needs. threads: all cores if None.

    At the velocity level, with the solvers ``sns``, ``dls`` and ``task-priority``, FrameTasks and JointTasks, the whole
    loop is compiled and runs without Python; a path is sampled ahead, also between the steps where its clock may wait.
    What the loop cannot hold is stepped in Python, one start after the other, with a CartctlWarning that names the
    reason (:attr:`Batch.reason`).

    Raises ShapeError, NonFiniteError, ConfigurationError, TimeStepError, ParameterError; in Python also what
    :meth:`Controller.step` raises.
    """
    if not isinstance(controller, Controller):
        raise ParameterError(f"controller is a {type(controller).__name__}; expected a cc.Controller")
    if not isinstance(history, bool):
        raise ParameterError(f"history is {history!r}; expected True or False")
    steps = whole_steps(checks.duration("duration", duration), controller.dt)
    starts, rates = _starts(controller, q0s, v0s)
    t0, count = checks.number("t0", t0), thread_count(threads)
    begun = perf_counter()
    reason: str | None = None
    runs: list[Run] | None = None
    try:
        loop = _loop(controller, t0, steps)
    except (UnsupportedProblem, UnsupportedJoint) as refusal:
        reason = str(refusal)
        warnings.warn(f"the batch is stepped in Python, for {reason}", CartctlWarning, stacklevel=2)
        found, runs = _stepped(controller, starts, rates, duration, t0, history)
    else:
        found = _compiled(loop, starts, rates, history, count)
    spent = (perf_counter() - begun) * (count if reason is None else 1) / max(1, len(starts) * steps)
    return Batch(controller, found, t0, steps, reason, spent, runs)


def _starts(controller: Controller, q0s: Any, v0s: Any) -> tuple[FloatArray, FloatArray]:
    robot = controller.robot
    given = checks.floats("q0s", q0s)
    if given.ndim != 2 or given.shape[1] != robot.nq:
        raise ShapeError(f"q0s has shape {given.shape}; expected (B, {robot.nq}), one start a row")
    starts = np.array([robot.check_configuration(q, f"q0s[{i}]") for i, q in enumerate(given)]).reshape(-1, robot.nq)
    rates = np.zeros((len(starts), robot.nv)) if v0s is None else checks.floats("v0s", v0s)
    if rates.shape == (robot.nv,):
        rates = np.tile(rates, (len(starts), 1))
    if rates.shape != (len(starts), robot.nv):
        raise ShapeError(f"v0s has shape {rates.shape}; expected ({robot.nv},) or ({len(starts)}, {robot.nv})")
    checks.vector("v0s", rates.ravel(), largest=checks.LARGEST)
    return starts, np.ascontiguousarray(rates)


def _loop(controller: Controller, t0: float, steps: int) -> Loop:
    """The controller's loop as arrays; raises UnsupportedProblem, UnsupportedJoint with what is not compiled."""
    if controller.level.name != "velocity":
        raise UnsupportedProblem(f"level {controller.level.name!r} is not compiled ('velocity' is)")
    store = controller.workspace()
    for what, given in (
        ("an objective", controller.objective),
        (
            "a metric",
            None if isinstance(controller.metric, str) and controller.metric == "identity" else controller.metric,
        ),
        ("a singularity policy", controller.singularity),
    ):
        if given is not None:
            raise UnsupportedProblem(f"{what} is not compiled: {type(given).__name__}")
    return Loop(store, t0, steps)


def _compiled(loop: Loop, starts: FloatArray, rates: FloatArray, history: bool, threads: int) -> Outcome:
    found = Outcome.empty(len(starts), loop.steps, loop.sizes, history)
    prepared()
    chunks = 1 if threads == 1 else min(len(starts), threads * _CHUNKS)
    edges = np.linspace(0, len(starts), chunks + 1).astype(int).tolist()

    def part(k: int) -> None:
        begin, end = edges[k], edges[k + 1]
        loop.run(starts[begin:end], rates[begin:end], found.part(begin, end, loop.steps))

    if threads == 1:
        part(0)
    else:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(part, range(chunks)))
    return found


def _stepped(
    controller: Controller, starts: FloatArray, rates: FloatArray, duration: float, t0: float, history: bool
) -> tuple[Outcome, list[Run] | None]:
    """The same by :func:`simulate`, one start after the other."""
    robot = controller.robot
    edges = widths(controller.tasks, robot)
    steps = whole_steps(duration, controller.dt)
    sizes = (robot.nq, robot.nv, int(edges[-1]), len(controller.tasks))
    found, runs = Outcome.empty(len(starts), steps, sizes, False), []
    names = [status.name for status in NAMES]
    for i, (q, v) in enumerate(zip(starts, rates, strict=True)):
        run = simulate(controller, q, duration, v0=v, t0=t0)
        found.q[i], found.v[i] = run.q[-1], run.v[-1]
        found.error[i] = np.concatenate([task.error[-1] for task in run.tasks])
        found.least[i] = [np.nan_to_num(task.scale, nan=0.0).min(initial=1.0) for task in run.tasks]
        for status in run.status:
            found.counts[i, names.index(status) if status in names else names.index("FAILED")] += 1.0
        if history:
            runs.append(run)
    return found, runs if history else None
