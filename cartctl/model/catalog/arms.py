"""Single arms from example-robot-data."""

from __future__ import annotations

from math import pi, radians

from cartctl.model.catalog.entry import LibraryEntry, joints, shared, sources

_PANDA = LibraryEntry(
    name="panda",
    summary="Franka Emika Panda arm, 7 dof, its hand's fingers locked",
    urdf="example-robot-data:panda_description/urdf/panda.urdf",
    tool="panda_hand_tcp",
    home=joints("panda_joint{}", 0.0, -pi / 4, 0.0, -3 * pi / 4, 0.0, pi / 2, pi / 4),
    locked=("panda_finger_joint*",),
    acceleration=joints("panda_joint{}", 15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0),
    jerk=joints("panda_joint{}", 7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0),
    sources=sources(
        shared("panda_description", "Apache-2.0", "franka_ros"),
        "panda_hand_tcp of franka_description: between the fingertips",
        "Franka's ready pose, (0, -45, 0, -135, 0, 90, 45) deg",
        "Franka, FCI documentation, robot and interface specifications, limits for Panda",
        "Franka, FCI documentation, robot and interface specifications, limits for Panda",
    ),
)

_XARM7 = LibraryEntry(
    name="xarm7",
    summary="UFACTORY xArm 7 arm, 7 dof, without gripper",
    urdf="example-robot-data:xarm_description/urdf/xarm7.urdf",
    tool="link_eef",
    home=joints("joint{}", 0.0, -0.5, 0.0, 1.2, 0.0, 1.7, 0.0),
    acceleration={"joint?": radians(1145.0)},
    jerk={"joint?": radians(28647.0)},
    sources=sources(
        shared("xarm_description", "BSD-3-Clause", "xarm_ros2"),
        "link_eef of xarm_description: the flange",
        "ours: elbow bent, flange down",
        "UFACTORY, manual, range of motion parameters: 1145 deg/s^2",
        "UFACTORY, manual, range of motion parameters: 28647 deg/s^3",
    ),
)

_KINOVA = LibraryEntry(
    name="kinova",
    summary="Kinova Gen2 (j2s6s200) arm, 6 dof, three of them without end stops",
    urdf="example-robot-data:kinova_description/robots/kinova.urdf",
    tool="j2s6s200_end_effector",
    home=joints("j2s6s200_joint_{}", 4.8046852, 2.92482, 1.002, 4.2031852, 1.4458, 1.3233),
    sources=sources(
        shared("kinova_description", "BSD", "kinova-ros"),
        "j2s6s200_end_effector of kinova_description: between the fingers",
        "the Home posture of Kinova's six-joint MoveIt configurations (kinova-ros)",
    ),
)


def _ur(size: int) -> LibraryEntry:
    names = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
    angles = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
    nowhere = f"not published: 'not publicly available' (Universal Robots, ur_description, config/ur{size})"
    return LibraryEntry(
        name=f"ur{size}",
        summary=f"Universal Robots UR{size} (CB series) arm, 6 dof",
        urdf=f"example-robot-data:ur_description/urdf/ur{size}_robot.urdf",
        tool="tool0",
        home={f"{name}_joint": angle for name, angle in zip(names, angles, strict=True)},
        sources=sources(
            shared("ur_description", "BSD", "universal_robot (ROS-Industrial)"),
            "tool0 of ur_description: the flange, z out of it",
            "ours: upper arm up, forearm forward, flange down",
            nowhere,
        ),
    )


_Z1 = LibraryEntry(
    name="z1",
    summary="Unitree Z1 arm, 6 dof, its gripper locked",
    urdf="example-robot-data:z1_description/urdf/z1.urdf",
    tool="link06",
    home=joints("joint{}", 0.0, 1.5, -1.0, -0.54, 0.0, 0.0),
    locked=("jointGripper",),
    sources=sources(
        shared("z1_description", "MPL-2.0", "unitree_ros"),
        "link06 of z1_description: the last link, to which the gripper is bolted",
        "Unitree, z1_sdk: the posture it calls forward",
    ),
)

_SO101 = LibraryEntry(
    name="so101",
    summary="SO-101 arm (TheRobotStudio), 5 dof, its gripper locked",
    urdf="example-robot-data:so_arm_description/urdf/so101.urdf",
    tool="gripper_frame_link",
    home={"shoulder_lift": -0.4, "elbow_flex": 0.6, "wrist_flex": 0.6, "wrist_roll": 0.0},
    locked=("gripper",),
    sources=sources(
        shared("so_arm_description", "Apache-2.0", "SO-ARM100"),
        "gripper_frame_link of so101.urdf: between the jaws",
        "ours: elbow bent, gripper down and forward",
    ),
)

ENTRIES = (_PANDA, _XARM7, _KINOVA, _ur(3), _ur(5), _ur(10), _Z1, _SO101)
