"""A planar arm with a joint to spare, of coloured boxes: quick to draw, and heavy enough for torques."""

from __future__ import annotations

# Stands up and moves in x-z; the names are as bad as a URDF's may be.
LINK = """<link name="{name}"><inertial><origin xyz="{middle} 0 0"/><mass value="{mass}"/>
    <inertia ixx="0.01" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><origin xyz="{middle} 0 0"/><geometry><box size="{length} 0.06 0.06"/></geometry>
    <material name="{name}"><color rgba="{color} 1"/></material></visual></link>"""
JOINT = """<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
    <origin xyz="{x} 0 0"/><axis xyz="0 -1 0"/>
    <limit lower="-{reach}" upper="{reach}" velocity="2" effort="60"/></joint>"""
ARM = "".join([
    '<robot name="three"><link name="base"/><link name="tip"/>',
    LINK.format(name="l1", middle=0.25, length=0.5, mass=3.0, color="0.2 0.4 0.7"),
    LINK.format(name="l2", middle=0.2, length=0.4, mass=2.0, color="0.8 0.3 0.2"),
    LINK.format(name="l3", middle=0.15, length=0.3, mass=1.0, color="0.2 0.4 0.7"),
    JOINT.format(name="&lt;b&gt;one", parent="base", child="l1", x=0.0, reach=2.8),
    JOINT.format(name="two", parent="l1", child="l2", x=0.5, reach=2.5),
    JOINT.format(name="three", parent="l2", child="l3", x=0.4, reach=2.5),
    '<joint name="flange" type="fixed"><parent link="l3"/><child link="tip"/><origin xyz="0.3 0 0"/></joint></robot>',
])  # fmt: skip
HOME = {"<b>one": 1.2, "two": -0.9, "three": -0.6}
