"""Frames in which a garment can be right at all: the body does not run into itself.

Recorded people were slimmer than the body that re-enacts them, so arms sink into the trunk, and between two parts of a
body that touch there is no room for cloth. Those frames say nothing about a garment and are reported apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.evaluation.metrics import inside
from garmentc.outfit.topology import vertex_normals
from garmentc.smpl.body import BodyModel


@dataclass(frozen=True)
class CleanFrames:
    """When a frame counts as clean.

    margin   metres: room for cloth. A body vertex touches the body where, moved out by `margin`, it lies inside
    allowed  share of the body's vertices that may touch; skin at a bent ankle or hip always folds a little
    """

    margin: float = 0.005
    allowed: float = 0.001


def touching(vertices: NDArray[Any], faces: NDArray[Any], margin: float) -> NDArray[np.bool_]:
    """Vertices (V,) of a closed mesh that lie inside it after they moved outwards along their normal by `margin`."""
    return inside(vertices + margin * vertex_normals(vertices, faces), vertices, faces)


def touching_share(
    body: BodyModel, betas: NDArray[Any] | None, posed: NDArray[Any], margin: float = CleanFrames.margin
) -> NDArray[np.float64]:
    """Share (T,) of body vertices that touch the body in the frames `posed` (T, V, 3).

    Vertices that touch in the rest pose too are not counted: toes, fingers, lips and ears lie in folds that the body
    has in every pose.
    """
    fold = touching(body.shaped(betas), body.faces, margin)
    return np.array([(touching(vertices, body.faces, margin) & ~fold).mean() for vertices in posed])


def clean_frames(
    body: BodyModel, betas: NDArray[Any] | None, posed: NDArray[Any], options: CleanFrames | None = None
) -> NDArray[np.bool_]:
    """Which of the frames `posed` (T, V, 3) of the body are clean; returns (T,)."""
    options = options or CleanFrames()
    return touching_share(body, betas, posed, options.margin) <= options.allowed
