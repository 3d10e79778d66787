"""What shall move: frames, relative frames, the centre of mass, joints, or a function of your own."""

from cartctl.tasks.base import Reference, Task
from cartctl.tasks.clearance import ClearanceTask
from cartctl.tasks.com import ComTask
from cartctl.tasks.frame import FrameTask
from cartctl.tasks.function import FunctionTask
from cartctl.tasks.joint import JointTask, PostureTask
from cartctl.tasks.relative import RelativeFrameTask

__all__ = [
    "ClearanceTask",
    "ComTask",
    "FrameTask",
    "FunctionTask",
    "JointTask",
    "PostureTask",
    "Reference",
    "RelativeFrameTask",
    "Task",
]
