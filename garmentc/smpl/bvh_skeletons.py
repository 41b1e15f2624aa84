"""Which joint of a BVH skeleton plays which joint of SMPL, for the naming conventions in common use."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from garmentc.errors import GarmentcError
from garmentc.smpl.skeleton import JOINT_NAMES

OPTIONAL = ("spine1", "spine2", "spine3", "neck", "collar", "foot", "hand")
"""Joints a skeleton may lack; they are filled in from their neighbours."""


@dataclass(frozen=True)
class Convention:
    """One naming of joints: SMPL joint to name. `twist` names joints that carry the forearm's twist alone."""

    name: str
    joints: dict[str, str]
    twist: dict[str, str]


_TRUNK = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")


def _both_sides(name: str, trunk: str, limbs: dict[str, str], twist: str = "") -> Convention:
    """`trunk` names _TRUNK's joints; in `limbs` and `twist`, {side} stands for Left and Right, {s} for L and R."""
    joints = dict(zip(_TRUNK, trunk.split(), strict=True))
    twists = {}
    for side, spelled in (("left", "Left"), ("right", "Right")):
        joints |= {f"{side}_{joint}": pattern.format(side=spelled, s=spelled[0]) for joint, pattern in limbs.items()}
        if twist:
            twists[f"{side}_elbow"] = twist.format(side=spelled)
    return Convention(name, joints, twists)


_ARMS_AND_LEGS = {
    "hip": "{side}UpLeg", "knee": "{side}Leg", "ankle": "{side}Foot", "foot": "{side}ToeBase",
    "collar": "{side}Shoulder", "shoulder": "{side}Arm", "elbow": "{side}ForeArm", "wrist": "{side}Hand",
}  # fmt: skip

CONVENTIONS = (
    # The hands of the CMU recordings are unreliable (stored modulo half a turn), so LeftFingerBase stays unread and
    # LeftHand, which holds the twist of the forearm, ends the chain.
    _both_sides(
        "CMU",
        "Hips LowerBack Spine Spine1 Neck1 Head",
        _ARMS_AND_LEGS,
        twist="{side}Hand",
    ),
    _both_sides("Mixamo", "Hips Spine Spine1 Spine2 Neck Head", _ARMS_AND_LEGS),
    Convention("SMPL", {name: name for name in JOINT_NAMES}, {}),
    _both_sides(
        "SMPL, short names",
        "Pelvis Spine1 Spine2 Spine3 Neck Head",
        {joint: "{s}_" + joint.capitalize() for joint in (*_ARMS_AND_LEGS, "hand")},
    ),
)  # fmt: skip


@dataclass(frozen=True)
class SkeletonMap:
    """SMPL joints found in a skeleton: joint name to index. `twist` likewise, by the joint that takes half of it."""

    convention: str
    joints: dict[str, int]
    twist: dict[str, int]


def match_skeleton(names: Sequence[str], path: Path) -> SkeletonMap:
    """The convention that finds the most joints among `names`, prefixes such as "mixamorig:" aside.

    Raises GarmentcError listing the missing joints where even the best lacks a joint that is needed.
    """
    index: dict[str, int] = {}
    for k, name in enumerate(names):
        index.setdefault(_plain(name), k)
    best, found = CONVENTIONS[0], -1
    for convention in CONVENTIONS:
        hits = sum(_plain(name) in index for name in convention.joints.values())
        if hits > found:
            best, found = convention, hits
    needed = {joint: name for joint, name in best.joints.items() if joint.split("_")[-1] not in OPTIONAL}
    missing = [f"{name} ({joint})" for joint, name in needed.items() if _plain(name) not in index]
    if missing:
        raise GarmentcError(
            f"the skeleton is not known; the closest naming is {best.name}, where these joints are missing: "
            f"{', '.join(missing)}. Rename the joints",
            path,
        )
    joints = {joint: index[_plain(name)] for joint, name in best.joints.items() if _plain(name) in index}
    twist = {joint: index[_plain(name)] for joint, name in best.twist.items() if _plain(name) in index}
    return SkeletonMap(best.name, joints, twist)


def _plain(name: str) -> str:
    """Lower case, without a namespace ("mixamorig:", "mixamorig1:", "Character1_")."""
    return re.sub(r"^(.*:|mixamorig\d*_?|character\d*_)", "", name.strip().lower())
