"""What a user gets without garmentc: the rigs that the compiled asset is compared with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel
from garmentc.smpl.nearest import nearest_body_weights


def nearest_skinning(
    template: NDArray[Any], triangles: NDArray[np.int32], body: BodyModel, betas: NDArray[Any] | None = None
) -> Rig:
    """Skinning only: each vertex of `template` (N, 3) takes the blend weights of the nearest body vertex."""
    weights = nearest_body_weights(template, body.shaped(betas), body)
    shapes = np.zeros((0, len(template), 3), dtype=np.float32)
    return Rig(template, triangles, body.joints(betas), weights.astype(np.float32), shapes, keys=None)
