"""Garments worn by the default body, for tests of what happens between the two."""

from __future__ import annotations

import numpy as np
from gltf_samples import make_keys

from garmentc.evaluation.metrics import signed_distance
from garmentc.outfit.topology import vertex_normals
from garmentc.rig import Rig
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.nearest import nearest_body_weights
from garmentc.smpl.skeleton import JOINT_NAMES

BODY = load_default_body("male")
JOINTS = BODY.joints()
PELVIS, SHOULDER = JOINTS[JOINT_NAMES.index("pelvis")], JOINTS[JOINT_NAMES.index("left_shoulder"), 1]


def skin_tight(joints: tuple[str, ...], gap: float = 0.004, keys: int = 48) -> Rig:
    """The skin of some body parts, `gap` metres farther out: nearest weights, blend shapes that do nothing yet."""
    skin = BODY.shaped()
    kept = BODY.weights[:, [JOINT_NAMES.index(name) for name in joints]].sum(axis=1) > 0.5
    faces = BODY.faces[kept[BODY.faces].all(axis=1)]
    used, triangles = np.unique(faces, return_inverse=True)
    template = (skin + gap * vertex_normals(skin, BODY.faces))[used]
    return Rig(
        template=template,
        triangles=triangles.reshape(-1, 3).astype(np.int32),
        joints=BODY.joints(),
        weights=nearest_body_weights(template, skin, BODY).astype(np.float32),
        blend_shapes=np.zeros((keys, len(template), 3), np.float32),
        keys=make_keys(keys, np.random.default_rng(5)),
    )


def trousers(gap: float = 0.004) -> Rig:
    return skin_tight(("pelvis", "left_hip", "right_hip", "left_knee", "right_knee"), gap)


def collided(rig: Rig, poses: np.ndarray) -> float:
    """Share of vertices inside the posed body, by exact distances."""
    skins, posed = BODY.posed(poses), rig.posed(poses)
    return float(np.mean([signed_distance(p, s, BODY.faces) < 0 for p, s in zip(posed, skins, strict=True)]))


def tube(
    middle: np.ndarray,
    top: float,
    length: float,
    radius: float,
    *,
    around: int = 48,
    span: float = 2 * np.pi,
    tilt: float = 0,
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a tube about a vertical; its rim rises by `tilt` per metre forwards."""
    rings = 12
    angle = span * np.arange(around) / around
    ring = np.column_stack([np.sin(angle), np.zeros(around), np.cos(angle)]) * radius
    rows = [ring + np.array([middle[0], top - length * k / (rings - 1), middle[2]]) for k in range(rings)]
    vertices = np.concatenate(rows)
    vertices[:, 1] += tilt * (vertices[:, 2] - middle[2])
    k, i = np.meshgrid(np.arange(rings - 1), np.arange(around if span == 2 * np.pi else around - 1), indexing="ij")
    a, b = k * around + i, k * around + (i + 1) % around
    quads = np.stack([a, b, b + around, a + around], axis=-1).reshape(-1, 4)
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def skirt(**shape: float) -> tuple[np.ndarray, np.ndarray]:
    return tube(PELVIS, PELVIS[1] + 0.1, 0.5, 0.2, **shape)
