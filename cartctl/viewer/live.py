"""``cc.play``: the loop that moves the robot in real time and shows it."""

from __future__ import annotations

import time
import webbrowser
from collections import deque
from collections.abc import Callable

from cartctl.errors import ParameterError
from cartctl.model.limits import Limits
from cartctl.motion.controller import Controller
from cartctl.tasks import FrameTask
from cartctl.viewer.aim import towards
from cartctl.viewer.extra import viser
from cartctl.viewer.pace import FPS, Pace
from cartctl.viewer.panel import Panel
from cartctl.viewer.reading import Reading
from cartctl.viewer.scene import Scene
from cartctl.viewer.session import Session
from cartctl.viewer.status import status_html, trouble_html
from cartctl.viewer.window import Window
from cartctl.viewer.workshop import Workshop

_TELL = 5  # pictures between two updates of the status
_MEMORY = 12.0  # s of the error that the curve shows


def play(
    controller: Controller,
    *,
    port: int | None = None,
    open_page: bool = True,
    stay: bool = False,
    ready: Callable[[str], None] | None = None,
) -> None:
    """Run ``controller`` in real time, shown in the browser at ``http://127.0.0.1:8080``; comes back when that closes.

    Every FrameTask has a handle that moves its target; a path it had is left aside until the viewer ends. Solver,
    level, the objective, gains and limits are changed on the page: the robot goes on from where it is. The robot moves
    as in :func:`cartctl.simulate`: as it is told, at the torque level by its dynamics.

    port: another one; None takes the next free one, 0 any. open_page: whether to open the user's browser. stay: keep on
    after the last browser has closed. ready: called with the page's address. Ctrl-C ends it by KeyboardInterrupt. The
    page is served to this machine only.

    Raises MissingDependencyError without the extra ``play``, ParameterError for a port that is taken or a controller
    without a FrameTask.
    """
    viser()
    if not isinstance(controller, Controller):
        raise ParameterError(f"controller is a {type(controller).__name__}; expected a cc.Controller")
    hands = [task for task in controller.tasks if isinstance(task, FrameTask)]
    if not hands:
        kinds = ", ".join(type(task).__name__ for task in controller.tasks)
        raise ParameterError(f"the controller's tasks are {kinds}; expected a FrameTask, whose target can be dragged")
    before = [(task, task.target, task.gain) for task in hands]
    window = Window(port, controller.robot.name)
    try:
        show = Show(controller, hands, window)
        if ready is not None:
            ready(window.url)
        if open_page:
            webbrowser.open(window.url)
        while stay or not window.deserted:
            show.picture()
    finally:
        window.close()
        for task, target, gain in before:
            task.target, task.gain = target, gain


class Show:
    """All that is shown in one window, picture by picture."""

    def __init__(self, controller: Controller, hands: list[FrameTask], window: Window) -> None:
        self._hands = hands
        self.session = Session(controller)
        self.scene = Scene(window.server, controller.robot, hands, self.session.q)
        self.panel = Panel(window.server.gui, controller, hands)
        self._limits = controller.limits or controller.robot.limits
        self._workshop = Workshop(controller)
        self._method = self._asked = self.panel.method
        self._shares = (1.0, 1.0)
        self._pace = Pace(controller.dt)
        self._errors = deque[float](maxlen=int(_MEMORY * FPS / _TELL))
        self._refused = ""
        self._paused, self._count = False, 0
        self._aims = [self.scene.target(index) for index in range(len(hands))]
        self._aim()

    def picture(self) -> None:
        """What is due of one thirtieth of a second: wishes, steps, the picture, and the rest of the time asleep."""
        begun = self._pace.now()
        self._press()
        self._change()
        self._aim()
        if not self._paused:
            self._steps(begun)
        self.scene.trace, self.scene.ellipsoids = self.panel.trace.value, self.panel.ellipsoid.value
        self.scene.show(self.session.q)
        if self._count % _TELL == 0:
            self._tell()
        self._count += 1
        time.sleep(self._pace.spare(begun))

    def _steps(self, begun: float) -> None:
        """The steps that are due, as far as the time of a picture goes."""
        made, due = 0, self._pace.due()
        while made < due and self._pace.now() - begun < 1.0 / FPS:
            self.session.step()
            made += 1
        self._pace.made(made)

    def _aim(self) -> None:
        """Targets to where the handles are, gains to where the slider is."""
        bounded, gain = self.session.controller.limits is not None, self.panel.gain
        for index, task in enumerate(self._hands):
            wanted = self.scene.target(index)
            self._aims[index] = wanted if bounded else towards(self._aims[index], wanted, 1.0 / FPS, self.scene.size)
            task.target = self._aims[index]
            if gain is not None:
                task.gain = gain

    def _press(self) -> None:
        pressed = self.panel.pressed()
        robot = self.session.controller.robot
        if "home" in pressed:
            self.session.home(robot.home)
            self.scene.show(self.session.q)
        if "target to hand" in pressed or "home" in pressed:
            for index, task in enumerate(self._hands):
                self._aims[index] = self.scene.pose(task)
                self.scene.put(index, self._aims[index])
        if "pause" in pressed:
            self._paused = not self._paused
            self._pace.restart()

    def _change(self) -> None:
        """Ask for another controller where something else is chosen; go on with it once it is made."""
        method, shares = self.panel.method, self.panel.shares
        if method != self._asked or shares != self._shares:
            remade = method != self._asked
            self._asked, self._shares = method, shares
            if remade:
                self._workshop.ask(method, self.limits, self.session.q)
            elif self.session.controller.limits is not None:
                self.session.controller.limits = self.limits
        done = self._workshop.collect()
        if done is None:
            return
        chosen, made = done
        if isinstance(made, Controller):
            if made.limits is not None:
                made.limits = self.limits
            self.session.switch(made)
            self._method, self._refused = chosen, ""
        else:
            self._refused = made
            self._asked = self._method
            self.panel.choose(self._method)

    @property
    def limits(self) -> Limits:
        """The limits, slowed down as the sliders say."""
        speed, force = self._shares
        limits = self._limits
        return limits.replace(
            velocity_lower=speed * limits.velocity_lower, velocity_upper=speed * limits.velocity_upper,
            acceleration_lower=force * limits.acceleration_lower, acceleration_upper=force * limits.acceleration_upper,
        )  # fmt: skip

    def _tell(self) -> None:
        session = self.session
        words = session.trouble or self._refused or self._method.remark()
        if self._workshop.busy:
            words = f"preparing {self._asked.solver} at the {self._asked.level} level ..."
        self.panel.trouble.content = trouble_html("paused" if self._paused else words)
        if session.command is None:
            return
        reading = Reading.of(session.controller, session.q, session.v, session.command)
        if not self._paused:
            self._errors.append(max((m if m is not None else r or 0.0 for _, m, r in reading.errors), default=0.0))
        self.panel.status.content = status_html(reading, 1e6 * session.spent, self._pace.speed, list(self._errors))
