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
