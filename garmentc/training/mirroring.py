"""Left-right mirrored outfits, bodies and poses: people are nearly symmetric, so what is learned of one side holds for
the other."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from garmentc.smpl.skeleton import MIRROR
from garmentc.training.outfit_sample import OutfitSample

_FLIP = np.array([-1.0, 1.0, 1.0], np.float32)
_ROTATION = np.array([1.0, -1.0, -1.0], np.float32)
_TRANSFORM = np.outer(_FLIP, [-1.0, 1.0, 1.0, 1.0]).astype(np.float32)


def mirrored_vertices(vertices: NDArray[Any]) -> NDArray[Any]:
    """x to -x, of vertices or vectors (..., 3)."""
    return vertices * _FLIP


def mirrored_poses(poses: NDArray[Any]) -> NDArray[Any]:
    """Axis-angle poses (..., 24, 3) of the mirrored person: sides swapped, axes mirrored as axes are."""
    return poses[..., MIRROR, :] * _ROTATION


def mirrored_transforms(transforms: NDArray[Any]) -> NDArray[Any]:
    """Joint transforms (..., 24, 3, 4) of the mirrored body in the mirrored pose: S·G·S, sides swapped."""
    return transforms[..., MIRROR, :, :] * _TRANSFORM


def mirrored_sample(sample: OutfitSample) -> OutfitSample:
    """The outfit mirrored; its triangles turn round, and still face outwards. `body` is left as it is."""
    flip = torch.from_numpy(_FLIP).to(sample.vertices.device)
    return replace(
        sample,
        vertices=sample.vertices * flip,
        normals=sample.normals * flip,
        triangles=sample.triangles.flip(1),
        skin=sample.skin[:, torch.from_numpy(MIRROR).to(sample.skin.device)],
    )
