"""Simulation with dynamics: integrators, books of energy, plants that differ, and rollouts under torques."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pyarrow.csv
import pytest
from scipy.integrate import solve_ivp

import cartctl as cc
from cartctl.errors import (
    CartctlWarning,
    FrameNotFound,
    NonFiniteError,
    ParameterError,
    ShapeError,
    TimeStepError,
    UnderactuatedRobot,
)
from cartctl.motion.integrate import by_acceleration
from tests.robots_for_tests import kinova, panda, pendulum, planar, talos
from tests.test_simulate import circling


def torque_circle(robot=None, solver="sns", **options):
    """The Panda's tool on its circle, by torques."""
    how = {"level": "torque", "metric": "inverse-inertia", "objective": None} | options
    return circling(robot or panda(), solver=solver, **how)


# ---------------------------------------------------------------- free motion


def test_energy_stays_in_free_motion():
    """Ten seconds at 1 ms by rk4: measured 2.3e-7 of the peak kinetic energy on the Panda, 5.5e-8 on the LWR."""
    for name in ("panda", "lwr"):
        books = cc.free_motion(cc.load(name), duration=10.0).energy
        assert books.kinetic.max() > 50.0
        assert np.abs(books.residual).max() < 5e-6 * books.kinetic.max()
        total = books.kinetic + books.potential
        assert np.abs(total - total[0]).max() < 5e-6 * books.kinetic.max()


def test_free_motion_is_the_solution_of_the_equations_of_motion():
    """Against scipy's DOP853 on M^-1 (tau - h - friction + J^T w) from other Pinocchio calls."""
    robot = planar()
    friction, push = cc.Friction(0.3, 0.2, 0.5), np.array([1.0, -2.0, 0.0, 0.0, 0.0, 0.5])
    plant = cc.Plant(friction=friction, wrenches=cc.Wrench("tool", lambda t: push * np.cos(3.0 * t)))
    tau = np.array([4.0, 2.0, 0.5])
    motion = cc.free_motion(robot, [0.3, 0.4, 0.5], [0.1, -0.2, 0.3], 1.0, torque=tau, plant=plant)

    def slope(t, x):
        state = robot.state(x[:3], x[3:])
        loss = 0.3 * x[3:] + 0.2 * np.tanh(x[3:] / 0.5)
        felt = state.jacobian("tool").T @ (push * np.cos(3.0 * t))
        return np.concatenate([x[3:], np.linalg.solve(state.mass_matrix, tau - state.nonlinear_effects - loss + felt)])

    exact = solve_ivp(slope, (0.0, 1.0), [0.3, 0.4, 0.5, 0.1, -0.2, 0.3], "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(np.concatenate([motion.q[-1], motion.v[-1]]), exact, atol=1e-8)
    assert np.abs(motion.energy.residual).max() < 1e-8
    assert motion.energy.friction[-1] > 0.1 and abs(motion.energy.wrenches[-1]) > 0.1


@pytest.mark.parametrize(("integrator", "order"), [("semi-implicit", 1), ("rk4", 4)])
def test_the_integrators_have_their_order(integrator, order):
    robot = planar()
    q0, v0 = [0.3, 0.4, 0.5], [1.0, -0.5, 0.8]
    ends = {
        dt: cc.free_motion(robot, q0, v0, 0.32, dt=dt, integrator=integrator).q[-1]
        for dt in ((4e-3, 2e-3) if order == 1 else (1.6e-2, 8e-3))
    }
    exact = cc.free_motion(robot, q0, v0, 0.32, dt=2e-4).q[-1]
    coarse, fine = (np.abs(q - exact).max() for q in ends.values())
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.25)


def test_substeps_are_smaller_steps():
    """Without a controller, dt in four parts is dt/4."""
    robot = kinova()
    for integrator in ("semi-implicit", "rk4"):
        one = cc.free_motion(robot, duration=0.1, dt=4e-3, substeps=4, integrator=integrator)
        other = cc.free_motion(robot, duration=0.1, dt=1e-3, integrator=integrator)
        np.testing.assert_allclose(one.q, other.q[::4], atol=1e-12)
        np.testing.assert_allclose(one.energy.kinetic, other.energy.kinetic[::4], rtol=1e-9, atol=1e-12)


def test_torques_of_ones_own_hold_a_pendulum():
    robot = pendulum()
    hold = lambda t, q, v: robot.state(q, v).gravity - 0.5 * v  # noqa: E731
    motion = cc.free_motion(robot, [0.4], [0.3], 5.0, torque=hold)
    assert np.abs(motion.v[-1]).max() < 1e-3 and motion.torque.shape == (5000, 1)
    with pytest.raises(ShapeError, match="torque at t = 0 s"):
        cc.free_motion(robot, torque=lambda t, q, v: np.zeros(2))
    with pytest.raises(ParameterError, match=r"torque\[0\] is 1e\+300"):
        cc.free_motion(cc.load("planar2R"), torque=[1e300, 0.0])
    with pytest.raises(NonFiniteError, match="ran away"):
        cc.free_motion(robot, torque=[1e9], duration=1.0)
    with pytest.raises(UnderactuatedRobot):
        cc.free_motion(talos())
    with pytest.raises(ParameterError, match="Robot"):
        cc.free_motion("panda")
    with pytest.raises(TimeStepError):
        cc.free_motion(robot, duration=-1.0)


# ---------------------------------------------------------------- tracking by torques


@pytest.mark.parametrize(("integrator", "bound"), [("semi-implicit", 0.05e-3), ("rk4", 0.01e-3)])
@pytest.mark.parametrize("metric", ["identity", "inverse-inertia", "inverse-inertia-squared"])
def test_the_panda_tracks_the_circle_by_torques(metric, integrator, bound):
    """Required: 0.1 mm RMS. Measured: 27 um with semi-implicit steps, 3.2 um with rk4."""
    controller = torque_circle(metric=metric)
    run = cc.simulate(controller, duration=4.5, integrator=integrator)
    figures = run.metrics(after=0.5)
    assert figures.tasks[0].rms_m < bound and figures.tasks[0].final_m < 1e-5
    assert figures.status == {"OPTIMAL": 4500}
    assert np.abs(run.v).max() < 1.5  # the null space is at rest


def test_the_books_balance_along_a_run():
    """Motors put in what friction takes and what the arm gains; the residual is the integrator's."""
    friction = cc.Friction(0.4, 0.5)
    residuals = {}
    for integrator in ("semi-implicit", "rk4"):
        run = cc.simulate(
            torque_circle(level=cc.TorqueLevel(friction=friction)), duration=2.0, integrator=integrator, substeps=2
        )
        books, v = run.energy, run.v
        assert books.friction[-1] > 0.5 and books.wrenches[-1] == 0.0
        work = np.sum(run.torque * [run.robot.difference(a, b) for a, b in zip(run.q, run.q[1:], strict=False)], axis=1)
        np.testing.assert_allclose(np.diff(books.motors), work, atol=2e-4)
        state = run.robot.state(run.q[777], v[777])
        assert books.kinetic[777] == pytest.approx(0.5 * v[777] @ state.mass_matrix @ v[777])
        assert run.metrics().energy_residual == pytest.approx(np.abs(books.residual).max())
        residuals[integrator] = np.abs(books.residual).max()
    assert residuals["rk4"] < 1e-7 < residuals["semi-implicit"] < 0.05


def test_joint_work_is_cartesian_work_for_a_wrench():
    """int (J^T w) . v dt = int w . xi dt along a run."""
    robot = panda()
    w = np.array([5.0, -8.0, 3.0, 0.4, 0.2, -0.3])
    known = cc.TorqueLevel(wrenches=cc.Wrench(robot.tool, w))
    run = cc.simulate(torque_circle(level=known), duration=1.5, integrator="rk4")
    twists = np.array([robot.state(q, v).twist(robot.tool) for q, v in zip(run.q, run.v, strict=True)])
    power = twists @ w
    cartesian = np.sum(0.5 * (power[1:] + power[:-1])) * run.meta["dt"]
    assert run.energy.wrenches[-1] == pytest.approx(cartesian, abs=1e-5) and abs(cartesian) > 0.05


# ---------------------------------------------------------------- plants that differ


def settled(robot, plant, level=None, solver="pinv", gain=20.0, seconds=2.0):
    """Where the hand of a robot ends that is told to stay; its error at the end."""
    task = cc.FrameTask(robot.tool, gain=gain, **({} if robot.nv > 3 else {"axes": "xy"}))
    controller = cc.Controller(robot, task, solver, level or "torque", limits=None, metric="inverse-inertia", dt=1e-3)
    q0 = robot.home if robot.nv > 3 else np.array([0.4, 1.1])
    run = cc.simulate(controller, q0, duration=seconds, plant=plant)
    return run, run.tasks[0].error[-1]


def test_an_unknown_payload_sags_by_the_predicted_amount():
    """At rest K_p e = J M^-1 (g_plant - g_model): measured sag within 1e-4 of it, none where the payload is known."""
    robot = cc.planar([0.5, 0.4], gravity=(0.0, -9.81, 0.0))
    payload = cc.Payload(0.3)
    for gain in (10.0, 20.0):
        run, error = settled(robot, cc.Plant(payload=payload), gain=gain, seconds=6.0)
        at = robot.state(run.q[-1])
        more = robot.carrying(payload).state(run.q[-1]).gravity - at.gravity
        J = at.jacobian("tool")[:2]
        predicted = J @ np.linalg.solve(at.mass_matrix, more) / gain**2
        np.testing.assert_allclose(error, predicted, rtol=1e-4, atol=1e-9)
        assert error[1] > 1e-3 and np.abs(run.v[-1]).max() < 1e-6
    _, known = settled(robot.carrying(payload), None)
    assert np.abs(known).max() < 1e-8


def test_an_unknown_wrench_shifts_the_hand_and_a_known_one_does_not():
    robot = cc.planar([0.5, 0.4], gravity=(0.0, -9.81, 0.0))
    push = cc.Wrench("tool", [2.0, -3.0, 0.0, 0.0, 0.0, 0.0])
    run, error = settled(robot, cc.Plant(wrenches=push))
    at = robot.state(run.q[-1])
    J = at.jacobian("tool")[:2]
    predicted = -J @ np.linalg.solve(at.mass_matrix, J.T @ [2.0, -3.0]) / 400.0
    np.testing.assert_allclose(error, predicted, rtol=1e-4)
    _, known = settled(robot, None, cc.TorqueLevel(wrenches=push))
    assert np.abs(known).max() < 1e-8
    before = settled(
        robot, cc.Plant(wrenches=cc.Wrench("tool", lambda t: [9.0 * (t > 0.2), 0, 0, 0, 0, 0])), seconds=0.3
    )
    assert np.abs(before[0].tasks[0].error[:200]).max() < 1e-8 < 1e-3 < np.abs(before[1]).max()


def test_friction_and_masses_that_the_model_lacks():
    """Known friction costs nothing, unknown friction lags; links 10 % heavier sag by a tenth of gravity."""
    friction = cc.Friction(0.3, 0.3, 0.5)
    errors = {}
    for name, level, plant in (
        ("none", cc.TorqueLevel(), None),
        ("known", cc.TorqueLevel(friction=friction), None),
        ("unknown", cc.TorqueLevel(), cc.Plant(friction=friction)),
    ):
        run = cc.simulate(torque_circle(level=level, dt=2e-3), duration=2.0, plant=plant)
        errors[name] = run.metrics().tasks[0].rms_m
        assert (run.energy.friction[-1] > 0.1) == (name != "none")
    assert errors["known"] < 2.0 * errors["none"] < 1e-4 < 1e-3 < errors["unknown"]
    robot = cc.planar([0.5, 0.4], gravity=(0.0, -9.81, 0.0))
    run, error = settled(robot, cc.Plant(masses=1.1))
    at = robot.state(run.q[-1])
    predicted = at.jacobian("tool")[:2] @ np.linalg.solve(at.mass_matrix, 0.1 * at.gravity) / 400.0
    np.testing.assert_allclose(error, predicted, rtol=1e-4)
    other, _ = settled(robot, cc.Plant(robot.carrying(cc.Payload(0.3))))
    same, _ = settled(robot, cc.Plant(payload=cc.Payload(0.3)))
    np.testing.assert_array_equal(other.q, same.q)


def test_a_factor_on_the_masses_is_not_one_on_the_payload():
    robot, load = panda(), cc.Payload(2.0, com=[0.1, 0.0, 0.05], inertia=0.01 * np.eye(3))
    real = cc.Plant(masses=1.5, payload=load).body(robot).robot
    bare, held = robot.state(robot.home), robot.carrying(load).state(robot.home)
    for name in ("mass_matrix", "gravity"):
        a, b = getattr(bare, name), getattr(held, name)
        np.testing.assert_allclose(getattr(real.state(robot.home), name), 1.5 * a + (b - a), atol=1e-12)


def test_noise_is_of_its_size_and_comes_again():
    controller = torque_circle(dt=2e-3)
    runs = [cc.simulate(controller, duration=1.0, plant=cc.Plant(noise=0.5, seed=seed)) for seed in (3, 3, 4)]
    np.testing.assert_array_equal(runs[0].q, runs[1].q)
    assert np.abs(runs[0].q[-1] - runs[2].q[-1]).max() > 1e-6
    noise = runs[0].torque - runs[0].command
    assert noise.std() == pytest.approx(0.5, rel=0.05) and abs(noise.mean()) < 0.05
    spread = cc.simulate(controller, duration=0.4, plant=cc.Plant(noise=[0, 0, 0, 0, 0, 0, 0.1]))
    noise = spread.torque - spread.command
    assert not noise[:, :6].any() and noise[:, 6].std() == pytest.approx(0.1, rel=0.2)


@pytest.mark.parametrize("solver", ["pinv", "sns"])
def test_computed_torque_drives_a_plant_from_the_acceleration_level(solver):
    """M a + h of the model on the plant: as exact as the torque level where the model is, off where it is not."""
    limits = panda().limits if solver == "sns" else None
    controller = torque_circle(level="acceleration", metric=None, solver=solver)
    controller = cc.Controller(panda(), controller.tasks, solver, "acceleration", limits=limits)
    exact = cc.simulate(controller, duration=4.5, plant=cc.Plant())
    assert exact.metrics(after=0.5).tasks[0].rms_m < 0.1e-3 and exact.energy is not None
    np.testing.assert_allclose(exact.torque[100], controller.step(exact.q[100], exact.v[100], 0.1).torque, atol=1e-9)
    heavy = cc.simulate(controller, duration=1.0, plant=cc.Plant(payload=cc.Payload(2.0)))
    assert heavy.metrics().tasks[0].final_m > 1e-3


# ---------------------------------------------------------------- kinematic simulation


def test_kinematic_substeps():
    """Velocities and accelerations held over the parts of a step; on vectors that changes nothing."""
    for level in ("velocity", "acceleration"):
        ends = [
            cc.simulate(
                circling(panda(), dt=4e-3, solver="pinv", objective=None, level=level), duration=0.4, substeps=n
            )
            for n in (1, 5)
        ]
        np.testing.assert_allclose(ends[0].q[-1], ends[1].q[-1], atol=1e-10)
        assert ends[0].energy is None and ends[0].torque is None and ends[0].metrics().peak_torque is None
    robot, rng = talos(), np.random.default_rng(1)
    q, v, a = robot.random_configuration(rng), rng.normal(size=36), rng.normal(size=36)
    whole, parts = by_acceleration(robot, q, v, a, 0.1), (q, v)
    for _ in range(1000):
        parts = by_acceleration(robot, *parts, a, 1e-4)
    assert 1e-6 < np.abs(robot.difference(whole.q, parts[0])).max() < 1e-2  # a turning base is no vector


def test_any_step():
    """From 0.2 ms to 20 ms, in steps that do not divide the duration."""
    for dt in (2e-4, 7e-4, 3e-3, 2e-2):
        controller = torque_circle(dt=dt)
        run = cc.simulate(controller, duration=0.1, substeps=max(1, round(dt / 1e-3)))
        assert len(run) == int(np.ceil(0.1 / dt - 1e-9)) and run.metrics().tasks[0].max_m < 5e-3


# ---------------------------------------------------------------- what a Run keeps


def test_a_run_with_dynamics_remembers_saves_and_measures(tmp_path):
    run = cc.simulate(torque_circle(dt=2e-3), duration=0.6, plant=cc.Plant(friction=cc.Friction(0.2)))
    figures = run.metrics()
    assert figures.peak_torque == pytest.approx(np.abs(run.torque).max())
    assert figures.torque_effort == pytest.approx(np.sum(run.torque**2) * 2e-3)
    assert figures.energy == pytest.approx(np.sum(np.abs(run.torque * (run.v[:-1] + run.v[1:]))) * 1e-3)
    for i, joint in enumerate(figures.joints):
        assert joint.peak_torque == pytest.approx(np.abs(run.torque[:, i]).max())
        assert joint.torque_ratio == pytest.approx(joint.peak_torque / run.robot.limits.torque_upper[i])
    again = cc.Run.load(run.save(tmp_path / "run"))
    np.testing.assert_array_equal(again.torque, run.torque)
    np.testing.assert_array_equal(again.energy.residual, run.energy.residual)
    assert again.metrics() == figures
    table = pyarrow.csv.read_csv(run.to_csv(tmp_path / "run.csv"))
    np.testing.assert_allclose(table["torque command panda_joint2"].to_numpy()[:-1], run.command[:, 1])
    np.testing.assert_allclose(table["kinetic energy [J]"].to_numpy(), run.energy.kinetic)


def test_a_run_of_a_loaded_robot_loads_again(tmp_path):
    payload = cc.Payload(1.5, [0.0, 0.0, 0.1], 0.01 * np.eye(3))
    run = cc.simulate(torque_circle(panda().carrying(payload), dt=4e-3), duration=0.1)
    robot = cc.Run.load(run.save(tmp_path / "run")).robot
    np.testing.assert_allclose(robot.state(run.q[0]).mass_matrix, run.robot.state(run.q[0]).mass_matrix, atol=1e-12)


def test_torques_beyond_a_bound_are_counted():
    robot = panda()
    light = robot.limits.replace(torque_lower=-20.0, torque_upper=20.0)
    run = cc.simulate(torque_circle(dt=4e-3, solver="pinv", level="torque"), duration=0.4)
    assert run.metrics().violations == 0
    run.robot.limits, kept = light, robot.limits
    try:
        expected = int((np.abs(run.torque) > 20.0 * (1 + 1e-9)).sum())
        assert 0 < expected == run.metrics().violations
    finally:
        run.robot.limits = kept


def test_a_motion_that_runs_away_ends_with_a_warning():
    """Positive feedback through a believed friction that is not there."""
    robot = cc.planar([0.5, 0.4], gravity=(0.0, -9.81, 0.0))
    wrong = cc.TorqueLevel(friction=cc.Friction(viscous=400.0))
    controller = cc.Controller(robot, cc.FrameTask("tool", "xy"), "pinv", wrong, limits=None)
    with pytest.warns(CartctlWarning, match="ran away at t = "):
        run = cc.simulate(controller, [0.4, 1.1], 5.0, v0=[0.1, 0.0], plant=cc.Plant(friction=cc.Friction()))
    assert run.interrupted and 0 < len(run) < 5000 and np.isfinite(run.q).all()
    assert len(run.energy.kinetic) == len(run) + 1


@pytest.mark.parametrize(
    ("options", "error", "says"),
    [
        ({"level": "velocity", "plant": cc.Plant()}, ParameterError, "no torques"),
        ({"level": "velocity", "integrator": "rk4"}, ParameterError, "moves as it is told"),
        ({"level": "acceleration", "integrator": "rk4"}, ParameterError, "plant=cc.Plant"),
        ({"integrator": "euler"}, ParameterError, "'semi-implicit', 'rk4'"),
        ({"substeps": 0}, ParameterError, "substeps"),
        ({"substeps": 1.5}, ParameterError, "substeps"),
        ({"plant": "heavy"}, ParameterError, "plant"),
        ({"plant": cc.Plant(robot=cc.planar([1.0, 1.0]))}, ShapeError, "joints"),
        ({"plant": cc.Plant(noise=[1.0, 2.0])}, ShapeError, "noise"),
        ({"plant": cc.Plant(friction=cc.Friction([1.0, 2.0]))}, ShapeError, "viscous"),
        ({"plant": cc.Plant(wrenches=cc.Wrench("tol", np.zeros(6)))}, FrameNotFound, "tol"),
    ],
)
def test_options_that_do_not_fit_are_refused(options, error, says):
    keywords = {k: v for k, v in options.items() if k != "level"}
    level = options.get("level", "torque")
    controller = circling(panda(), solver="pinv", objective=None, level=level)
    with pytest.raises(error, match=says):
        cc.simulate(controller, duration=0.01, **keywords)


def test_bad_plants_are_refused():
    for make, says in (
        (lambda: cc.Plant("panda"), "robot"),
        (lambda: cc.Plant(masses=0.0), "masses"),
        (lambda: cc.Plant(noise=-1.0), "noise"),
        (lambda: cc.Plant(seed=-1), "seed"),
        (lambda: cc.Plant(friction=1.0), "friction"),
        (lambda: cc.Plant(payload=5), "payload is 5"),
        (lambda: cc.Plant(payload=[cc.Payload(1.0), "brick"]), "payload"),
        (lambda: cc.Plant(payload=None), "payload is None"),
    ):
        with pytest.raises(ParameterError, match=says):
            make()
    floating = cc.Controller(talos(), cc.FrameTask(talos().tool, "position"), "pinv", "acceleration", limits=None)
    with pytest.raises(UnderactuatedRobot):
        cc.simulate(floating, duration=0.01, plant=cc.Plant())


@pytest.mark.parametrize("level", ["velocity", "acceleration"])
def test_floating_bases_are_simulated_kinematically(level):
    """Hand and feet of a humanoid with a free base; the feet stay where they are."""
    robot = talos()
    start = robot.state(robot.home).position(robot.tool)
    feet = [cc.FrameTask(name, name=name) for name in ("left_sole_link", "right_sole_link")]
    hand = cc.FrameTask(robot.tool, "position", gain=5.0, target=start + [0.05, 0.0, 0.05])
    controller = cc.Controller(
        robot, [*feet, hand, cc.PostureTask(gain=1.0)], "task-priority", level, limits=None, dt=5e-3
    )
    run = cc.simulate(controller, duration=1.5)
    figures = {task.name: task for task in run.metrics().tasks}
    assert max(figures[foot.name].max_m for foot in feet) < 1e-3
    assert figures[robot.tool].final_m < 1e-3
    assert pin.isNormalized(robot.model, run.q[-1])
