"""Outfits cut from the default body, and files that have them in other units, axes and poses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.outfit import Outfit
from garmentc.outfit.topology import vertex_normals
from garmentc.smpl import BodyModel
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_NAMES
from garmentc.smpl.skinning import joint_transforms, skin

GAP = 0.008

SUIT = (
    "pelvis", "spine1", "spine2", "spine3", "left_hip", "right_hip", "left_knee", "right_knee",
    "left_collar", "right_collar", "left_shoulder", "right_shoulder", "left_elbow", "right_elbow",
)  # fmt: skip
SHIRT = ("spine1", "spine2", "spine3", "left_collar", "right_collar", "left_shoulder", "right_shoulder")
SHOES = ("left_ankle", "right_ankle", "left_foot", "right_foot")
CAP = ("head",)


def outfit_of(vertices: NDArray[Any], triangles: NDArray[Any], normals: NDArray[Any] | None = None) -> Outfit:
    """An outfit without materials; `normals` (V, 3) are one for each vertex."""
    tri_v = np.asarray(triangles, dtype=np.int32)
    zeros = np.zeros(len(tri_v), dtype=np.int32)
    index = np.arange(len(tri_v), dtype=np.int32)
    return Outfit(
        path=Path("outfit.obj"),
        vertices=np.array(vertices, dtype=np.float64),
        tri_v=tri_v,
        tri_vt=np.full_like(tri_v, -1),
        tri_vn=np.full_like(tri_v, -1) if normals is None else tri_v,
        tri_face=index,
        tri_material=zeros,
        tri_group=zeros,
        face_line=index + 1,
        texcoords=np.zeros((0, 2)),
        normals=np.zeros((0, 3)) if normals is None else normals,
        materials=(),
    )


def cut(
    body: BodyModel, parts: tuple[str, ...], gap: float = GAP, betas: NDArray[Any] | None = None
) -> tuple[Outfit, NDArray[Any]]:
    """The skin that follows the joints `parts`, moved outward by `gap` metres; and its blend weights."""
    vertices = body.shaped(betas)
    kept = np.isin(body.weights.argmax(axis=1), [JOINT_NAMES.index(part) for part in parts])
    faces = body.faces[kept[body.faces].all(axis=1)]
    used = np.unique(faces)
    number = np.zeros(len(vertices), dtype=np.int32)
    number[used] = np.arange(len(used))
    normals = vertex_normals(vertices, body.faces)[used]
    return outfit_of(vertices[used] + gap * normals, number[faces], normals), body.weights[used]


def worn_in(outfit: Outfit, weights: NDArray[Any], body: BodyModel, pose: NDArray[Any]) -> Outfit:
    """`outfit` as the body wears it in `pose`, by linear blend skinning."""
    transforms = joint_transforms(axis_angle_to_matrix(pose), body.joints())
    return replace(outfit, vertices=skin(outfit.vertices, weights, transforms))


def a_pose(shoulder: float, collar: float = 0.0, elbow: float = 0.0, hip: float = 0.0) -> NDArray[np.float64]:
    """Arms lowered and elbows bent forward, legs spread, by so many radians on each side."""
    pose = np.zeros((24, 3))
    for side, sign in (("left", 1), ("right", -1)):
        pose[JOINT_NAMES.index(f"{side}_collar"), 2] = -sign * collar
        pose[JOINT_NAMES.index(f"{side}_shoulder"), 2] = -sign * shoulder
        pose[JOINT_NAMES.index(f"{side}_elbow"), 1] = -sign * elbow
        pose[JOINT_NAMES.index(f"{side}_hip"), 2] = sign * hip
    return pose


def flared_skirt(body: BodyModel, hem: float) -> Outfit:
    """A skirt from the waist, snug, to the knees, where its radius is `hem` metres."""
    angles = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    trunk = body.v_template[np.abs(body.v_template[:, 0]) < 0.25]
    rings = []
    for t in np.linspace(0, 1, 25):
        near = trunk[np.abs(trunk[:, 1] - 0.06) < 0.02]
        half = np.abs(near[:, [0, 2]] - [0, near[:, 2].mean()]).max(axis=0) + 0.01
        x, z = half + t * (hem - half)
        rings.append(
            np.stack([x * np.sin(angles), np.full(48, 0.06 - 0.5 * t), near[:, 2].mean() + z * np.cos(angles)], 1)
        )
    index = np.arange(25 * 48).reshape(25, 48)
    a, b = index[:-1].ravel(), np.roll(index, -1, axis=1)[:-1].ravel()
    return outfit_of(
        np.concatenate(rings), np.concatenate([np.stack([a, a + 48, b], 1), np.stack([b, a + 48, b + 48], 1)])
    )
