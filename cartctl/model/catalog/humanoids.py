"""Humanoids from example-robot-data, hung up by the pelvis unless loaded with ``root_joint="free_flyer"``.

Legs stand as published half-sitting or default postures say. Those leave arms nearly stretched or joints at
their limits, so the arms are ours; they mirror each other.
"""

from __future__ import annotations

from cartctl.model.catalog.entry import LibraryEntry, joints, shared, sources

_TALOS_LEG = (0.0, 0.0, -0.411354, 0.859395, -0.448041, -0.001708)

_TALOS = LibraryEntry(
    name="talos",
    summary="PAL TALOS humanoid, 30 dof; grippers locked",
    urdf="example-robot-data:talos_data/robots/talos_reduced.urdf",
    tool="wrist_right_ft_tool_link",
    home={
        **joints("leg_left_{}_joint", *_TALOS_LEG),
        **joints("leg_right_{}_joint", *_TALOS_LEG),
        "torso_2_joint": 0.006761,
        **joints("arm_left_{}_joint", 0.3, 0.35, -0.1, -1.4, -0.4, -0.1, 0.1),
        **joints("arm_right_{}_joint", -0.3, -0.35, 0.1, -1.4, 0.4, 0.1, 0.1),
    },
    locked=("gripper_*",),
    sources=sources(
        shared("talos_data", "Apache-2.0", "talos_robot"),
        "wrist_right_ft_tool_link of talos_reduced.urdf: the right wrist flange",
        "legs and torso: half_sitting of talos.srdf; arms ours, elbows bent by 80 deg",
    ),
)


def _g1_side(side: str, mirror: float) -> dict[str, float]:
    return {
        f"{side}_hip_pitch_joint": -0.1,
        f"{side}_knee_joint": 0.3,
        f"{side}_ankle_pitch_joint": -0.2,
        f"{side}_shoulder_pitch_joint": 0.2,
        f"{side}_shoulder_roll_joint": 0.2 * mirror,
        f"{side}_elbow_joint": 0.6,
    }


_G1 = LibraryEntry(
    name="g1",
    summary="Unitree G1 humanoid (29 dof version), 29 dof, rubber hands",
    urdf="example-robot-data:g1_description/urdf/g1_29dof_rev_1_0.urdf",
    tool="right_rubber_hand",
    home={**_g1_side("left", 1.0), **_g1_side("right", -1.0)},
    sources=sources(
        shared("g1_description", "BSD-3-Clause", "unitree_ros"),
        "right_rubber_hand of g1_29dof_rev_1_0.urdf: the root of the right hand",
        "legs: default angles of unitree_rl_gym; arms ours, elbows bent",
    ),
)


def _icub_side(side: str) -> dict[str, float]:
    legs = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
    shoulder = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw")
    arm = (*shoulder, "elbow", "wrist_prosup", "wrist_pitch", "wrist_yaw")
    standing = (0.20944, 0.08727, 0.0, -0.1745, -0.0279, -0.08726)
    bent = (-0.5, 0.8, 0.5, 1.2, 0.0, -0.4, 0.0)
    pairs = zip(legs + arm, standing + bent, strict=True)
    return {f"{side}_{name}": value for name, value in pairs}


_ICUB = LibraryEntry(
    name="icub",
    summary="IIT iCub humanoid, 32 dof, without fingers",
    urdf="example-robot-data:icub_description/robots/icub.urdf",
    tool="r_gripper",
    home={**_icub_side("l"), **_icub_side("r")},
    sources=sources(
        shared("icub_description", "CC-BY-SA-4.0", "icub-models"),
        "r_gripper of icub.urdf: in the right palm",
        "legs: half_sitting of icub.srdf; arms ours, elbows bent by 70 deg",
    ),
    collada_y_up=True,
)


def _romeo_side(side: str, mirror: float) -> dict[str, float]:
    return {
        f"{side}HipPitch": -0.3490658,
        f"{side}KneePitch": 0.6981317,
        f"{side}AnklePitch": -0.3490658,
        f"{side}ShoulderPitch": 1.0,
        f"{side}ShoulderYaw": 0.5 * mirror,
        f"{side}ElbowRoll": -1.0 * mirror,
        f"{side}ElbowYaw": -1.2 * mirror,
        f"{side}WristRoll": -0.6 * mirror,
        f"{side}WristPitch": 0.3,
    }


_ROMEO = LibraryEntry(
    name="romeo",
    summary="Aldebaran Romeo humanoid, 31 dof; fingers locked",
    urdf="example-robot-data:romeo_description/urdf/romeo.urdf",
    tool="r_gripper",
    home={**_romeo_side("L", 1.0), **_romeo_side("R", -1.0)},
    locked=("?Hand", "?Finger*", "?Thumb*"),
    sources=sources(
        shared("romeo_description", "BSD", "romeo (LAAS)"),
        "r_gripper of romeo.urdf: in the right palm",
        "legs: half_sitting of romeo.srdf; arms ours, elbows bent by 70 deg",
    ),
)

ENTRIES = (_TALOS, _G1, _ICUB, _ROMEO)
