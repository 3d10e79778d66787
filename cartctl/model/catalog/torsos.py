"""Arms on a torso, from example-robot-data. Where there are wheels they are locked: the base stands still."""

from __future__ import annotations

from cartctl.model.catalog.entry import LibraryEntry, joints, shared, sources

_TIAGO = LibraryEntry(
    name="tiago",
    summary="PAL TIAGo, torso lift and one arm, 8 dof; hand, head and wheels locked",
    urdf="example-robot-data:tiago_description/robots/tiago.urdf",
    tool="arm_tool_link",
    home={"torso_lift_joint": 0.15, **joints("arm_{}_joint", 0.5, -0.5, -1.5, 1.5, 0.0, 0.7, 0.0)},
    locked=("hand_*", "head_*", "wheel_*"),
    sources=sources(
        shared("tiago_description", "Apache-2.0", "tiago_robot"),
        "arm_tool_link of tiago_description: the flange before the wrist sensor",
        "ours: elbow bent, flange before the robot",
    ),
)

_TIAGO_DUAL = LibraryEntry(
    name="tiago_dual",
    summary="PAL TIAGo++, torso lift and two arms, 15 dof; hands, head, wheels and casters locked",
    urdf="example-robot-data:tiago_description/robots/tiago_dual.urdf",
    tool="arm_right_tool_link",
    home={
        "torso_lift_joint": 0.15,
        **joints("arm_left_{}_joint", 0.3, 0.3, 1.2, 1.8, 0.3, 0.6, 0.0),
        **joints("arm_right_{}_joint", 0.3, 0.3, 1.2, 1.8, 0.3, 0.6, 0.0),
    },
    locked=("hand_*", "head_*", "wheel_*", "caster_*", "suspension_*"),
    sources=sources(
        shared("tiago_description", "Apache-2.0", "tiago_robot"),
        "arm_right_tool_link of tiago_description: the right flange",
        "ours: both elbows bent, flanges before the robot",
    ),
)

_TIAGO_PRO = LibraryEntry(
    name="tiago_pro",
    summary="PAL TIAGo Pro, torso lift and two arms, 15 dof; grippers, head and wheels locked",
    urdf="example-robot-data:tiago_pro_description/robots/tiago_pro.urdf",
    tool="arm_right_tool_link",
    home={
        "torso_lift_joint": 0.15,
        **joints("arm_left_{}_joint", 0.5, 0.4, -0.4, -1.8, -0.1, -1.2, 1.2),
        **joints("arm_right_{}_joint", -0.5, 0.4, 0.4, -1.8, 0.1, -1.2, -1.2),
    },
    locked=("gripper_*", "head_*", "wheel_*"),
    sources=sources(
        shared("tiago_pro_description", "Apache-2.0", "PAL Robotics"),
        "arm_right_tool_link of tiago_pro_description: the right flange",
        "ours: both elbows bent, flanges before the robot",
    ),
)


def _baxter_arm(side: str, *values: float) -> dict[str, float]:
    names = ("s0", "s1", "e0", "e1", "w0", "w1", "w2")
    return {f"{side}_{name}": value for name, value in zip(names, values, strict=True)}


_BAXTER = LibraryEntry(
    name="baxter",
    summary="Rethink Baxter, two arms, 14 dof; grippers and head locked",
    urdf="example-robot-data:baxter_description/urdf/baxter.urdf",
    tool="right_gripper",
    home={
        **_baxter_arm("left", -0.08, -1.0, -1.19, 1.94, 0.67, 1.03, -0.50),
        **_baxter_arm("right", 0.08, -1.0, 1.19, 1.94, -0.67, 1.03, 0.50),
    },
    locked=("?_gripper_*", "head_pan"),
    sources=sources(
        shared("baxter_description", "BSD", "baxter_common"),
        "right_gripper of baxter_description: between the right fingertips",
        "Rethink, baxter_tools: the untucked posture",
    ),
)


def _pr2_arm(side: str, pan: float, roll: float) -> dict[str, float]:
    return {
        f"{side}_shoulder_pan_joint": pan,
        f"{side}_shoulder_lift_joint": 0.3,
        f"{side}_upper_arm_roll_joint": roll,
        f"{side}_elbow_flex_joint": -1.3,
        f"{side}_forearm_roll_joint": 0.0,
        f"{side}_wrist_flex_joint": -0.8,
        f"{side}_wrist_roll_joint": 0.0,
    }


_PR2 = LibraryEntry(
    name="pr2",
    summary="Willow Garage PR2, torso lift and two arms, 15 dof; grippers, head and laser locked",
    urdf="example-robot-data:pr2_description/urdf/pr2.urdf",
    tool="r_gripper_tool_frame",
    home={"torso_lift_joint": 0.15, **_pr2_arm("l", 0.5, 1.0), **_pr2_arm("r", -0.5, -1.0)},
    locked=("?_gripper_*", "head_*", "laser_tilt_mount_joint"),
    sources=sources(
        shared("pr2_description", "BSD", "pr2_common"),
        "r_gripper_tool_frame of pr2_description: between the right fingertips",
        "ours: both elbows bent, grippers before the robot",
    ),
)

ENTRIES = (_TIAGO, _TIAGO_DUAL, _TIAGO_PRO, _BAXTER, _PR2)
