"""Robot hands from example-robot-data."""

from __future__ import annotations

from cartctl.model.catalog.entry import LibraryEntry, shared, sources

# Fingers are joints 0-3, 4-7 and 8-11, the thumb 12-15; the first joint of each spreads, the others bend.
_BEND = {f"joint_{i}.0": 0.6 for i in (1, 2, 3, 5, 6, 7, 9, 10, 11)}
_THUMB = {"joint_12.0": 0.8, "joint_13.0": 0.4, "joint_14.0": 0.5, "joint_15.0": 0.5}

_ALLEGRO = LibraryEntry(
    name="allegro_hand",
    summary="Wonik Allegro right hand, four fingers of 4 joints, 16 dof",
    urdf="example-robot-data:allegro_hand_description/urdf/allegro_right_hand.urdf",
    tool="link_3.0_tip",
    home={"joint_0.0": 0.0, "joint_4.0": 0.0, "joint_8.0": 0.0, **_BEND, **_THUMB},
    sources=sources(
        shared("allegro_hand_description", "BSD", "allegro_hand_linux_v4"),
        "link_3.0_tip of allegro_right_hand.urdf: the tip of the index finger",
        "ours: all fingers half bent",
    ),
)

ENTRIES = (_ALLEGRO,)
