"""MakeHuman's bent A-pose to a T-pose in which every SMPL joint has an identity frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.build_body.bones import SIDES, joint_landmarks
from garmentc.smpl.build_body.makehuman import BODY_VERTEX_COUNT, MakeHuman
from garmentc.smpl.skeleton import JOINT_NAMES, MIRROR

_Floats = NDArray[np.float64]

_CARRIERS = {
    "hip": "root", "knee": "upperleg02", "ankle": "lowerleg02", "foot": "foot", "collar": "spine01",
    "shoulder": "shoulder01", "elbow": "upperarm02", "wrist": "lowerarm02", "hand": "wrist",
}  # fmt: skip
"""The bone that a joint's centre moves with while the body is brought to the T-pose."""


@dataclass(frozen=True)
class TPosed:
    """vertices (13380, 3) of the visible body and joints (24, 3), metres, the pelvis at the origin."""

    vertices: _Floats
    joints: _Floats


def to_t_pose(data: MakeHuman, mesh: _Floats) -> TPosed:
    """Bring an A-posed base mesh (19158, 3) to the T-pose by skinning with the 163-bone rig.

    Arms lie along X with palms down, legs almost vertical, feet flat, all bones straight. The joints are made
    symmetric; the vertices are left as they are.
    """
    centres = {joint: mesh[vertices].mean(axis=0) for joint, vertices in joint_landmarks(data).items()}
    heads = np.array([mesh[vertices].mean(axis=0) for vertices in data.rig.heads])
    wanted = _bone_rotations(centres)
    bones = data.rig.bones
    rotations: list[_Floats] = []
    positions: list[_Floats] = []
    transforms = np.zeros((len(bones), 3, 4))  # bone space of the A-pose to the T-pose
    for k, (bone, parent, head) in enumerate(zip(bones, data.rig.parents, heads, strict=True)):
        above = np.eye(3) if parent < 0 else rotations[parent]
        rotations.append(wanted.get(bone, above))
        positions.append(head if parent < 0 else above @ (head - heads[parent]) + positions[parent])
        transforms[k, :, :3] = rotations[k]
        transforms[k, :, 3] = positions[k] - rotations[k] @ head

    blended = np.tensordot(data.rig.weights[:BODY_VERTEX_COUNT], transforms, 1)
    vertices = np.einsum("vij,vj->vi", blended[:, :, :3], mesh[:BODY_VERTEX_COUNT]) + blended[:, :, 3]

    joints = np.array([centres[joint] for joint in JOINT_NAMES])
    for k, joint in enumerate(JOINT_NAMES):
        carrier = _CARRIERS.get(joint.split("_")[-1])
        if carrier is not None:
            transform = transforms[bones.index(carrier if carrier in bones else f"{carrier}.{joint[0].upper()}")]
            joints[k] = transform[:, :3] @ joints[k] + transform[:, 3]
    origin = joints[0] * [0, 1, 1]  # x = 0 is the plane of symmetry
    joints = joints - origin
    return TPosed(vertices - origin, 0.5 * (joints + joints[MIRROR] * [-1, 1, 1]))


def _bone_rotations(centres: dict[str, _Floats]) -> dict[str, _Floats]:
    """World rotations of the bones that turn; every other bone follows its parent."""
    wanted: dict[str, _Floats] = {}
    for side, _, suffix in SIDES:
        sign = 1.0 if side == "left" else -1.0

        def bone(start: str, end: str, side: str = side) -> _Floats:
            return centres[f"{side}_{end}"] - centres[f"{side}_{start}"]

        along = np.array([sign, 0.0, 0.0])
        clavicle = _about(2, sign * np.deg2rad(10))
        shoulder = _about(2, sign * np.deg2rad(18))
        upper = _between(shoulder @ bone("shoulder", "elbow"), along) @ shoulder
        lower = _between(upper @ bone("elbow", "wrist"), along) @ upper
        hand = _between(lower @ bone("wrist", "hand"), along) @ lower
        knuckles = hand @ bone("pinky", "index")
        twist = np.arctan2(knuckles[1], knuckles[2])  # about X, until the palm looks down
        thigh = _between(bone("hip", "knee"), np.array([sign * 0.06, -1, 0.01]))
        shin = _between(thigh @ bone("knee", "ankle"), np.array([sign * 0.02, -1, -0.06])) @ thigh
        turns = {
            "clavicle": clavicle,
            "shoulder01": shoulder,
            "upperarm01": upper,
            "upperarm02": _about(0, twist * 0.15) @ upper,
            "lowerarm01": _about(0, twist * 0.3) @ lower,
            "lowerarm02": _about(0, twist * 0.7) @ lower,
            "wrist": _about(0, twist) @ hand,
            "upperleg01": thigh,
            "upperleg02": thigh,
            "lowerleg01": shin,
            "lowerleg02": shin,
            "foot": np.eye(3),
        }
        wanted |= {name + suffix: turn for name, turn in turns.items()}
    return wanted


def _about(axis: int, angle: float) -> _Floats:
    cross = _cross_matrix(np.eye(3)[axis])
    rotation: _Floats = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return rotation


def _between(a: _Floats, b: _Floats) -> _Floats:
    """The smallest rotation that takes direction a to direction b; they never oppose each other here."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    cross = _cross_matrix(np.cross(a, b))
    rotation: _Floats = np.eye(3) + cross + cross @ cross / (1 + a @ b)
    return rotation


def _cross_matrix(v: _Floats) -> _Floats:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
