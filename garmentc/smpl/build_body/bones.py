"""MakeHuman's 163 bones and SMPL's 24 joints."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.build_body.makehuman import BODY_VERTEX_COUNT, MakeHuman
from garmentc.smpl.skeleton import JOINT_COUNT, JOINT_NAMES

_TRUNK = {
    "root": "pelvis", "pelvis": "pelvis", "spine05": "pelvis", "spine04": "pelvis", "spine03": "spine1",
    "spine02": "spine2", "spine01": "spine3", "breast": "spine3",
}  # fmt: skip

_LIMBS = {  # by the beginning of the bone's name; the first that fits counts
    "clavicle": "collar", "shoulder": "collar", "upperarm": "shoulder", "lowerarm": "elbow", "wrist": "wrist",
    "metacarpal": "wrist", "finger1-1": "wrist", "finger": "hand", "upperleg": "hip", "lowerleg": "knee",
    "foot": "ankle", "toe": "foot",
}  # fmt: skip

SIDES = (("left", "l", ".L"), ("right", "r", ".R"))
"""SMPL's prefix, MakeHuman's letter in cube names, MakeHuman's bone suffix."""


def joint_of_bone(bone: str) -> str:
    """The SMPL joint that carries a bone. Facial bones belong to the head."""
    side = {".L": "left_", ".R": "right_"}.get(bone[-2:], "")
    name = bone[:-2] if side else bone
    if name in _TRUNK:
        return _TRUNK[name]
    if name.startswith("neck"):
        return "neck"
    for beginning, joint in _LIMBS.items():
        if name.startswith(beginning):
            return side + joint
    return "head"


def joint_weights(data: MakeHuman) -> NDArray[np.float64]:
    """Weights (13380, 24) of the visible body: those of the bones, summed by joint."""
    carried = np.zeros((len(data.rig.bones), JOINT_COUNT))
    carried[np.arange(len(data.rig.bones)), [JOINT_NAMES.index(joint_of_bone(bone)) for bone in data.rig.bones]] = 1
    return data.rig.weights[:BODY_VERTEX_COUNT] @ carried


def joint_landmarks(data: MakeHuman) -> dict[str, NDArray[np.int64]]:
    """Vertices of the base mesh whose mean is a joint's centre; also both ends of each row of knuckles."""
    cubes = data.joint_cubes
    landmarks = {
        "pelvis": data.mixamo_heads["Hips"],
        "spine1": cubes["joint-spine-3"],
        "spine2": cubes["joint-spine-2"],
        "spine3": cubes["joint-spine-1"],
        "neck": cubes["joint-neck"],
        "head": cubes["joint-head"],
    }
    for side, letter, _ in SIDES:
        cube = f"joint-{letter}-"
        landmarks |= {
            f"{side}_hip": cubes[cube + "upper-leg"],
            f"{side}_knee": cubes[cube + "knee"],
            f"{side}_ankle": cubes[cube + "ankle"],
            f"{side}_foot": cubes[cube + "foot-1"],
            f"{side}_collar": data.mixamo_heads[f"{side.capitalize()}Shoulder"],
            f"{side}_shoulder": cubes[cube + "shoulder"],
            f"{side}_elbow": cubes[cube + "elbow"],
            f"{side}_wrist": cubes[cube + "hand"],
            f"{side}_hand": np.concatenate([cubes[f"{cube}finger-{finger}-1"] for finger in (2, 3, 4, 5)]),
            f"{side}_index": cubes[cube + "finger-2-1"],
            f"{side}_pinky": cubes[cube + "finger-5-1"],
        }
    return landmarks
