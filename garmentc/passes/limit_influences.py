"""Keep the few largest blend weights of each vertex, as engines can use."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.pose_set import PoseSet
from garmentc.passes.posed_error import posed_error
from garmentc.passes.report import PassReport
from garmentc.rig import Rig


@dataclass(frozen=True)
class LimitInfluences:
    """count  joints that may move a vertex; glTF stores four in a set, so 4 or 8"""

    count: int = 4


def limit_influences(rig: Rig, options: LimitInfluences, poses: PoseSet) -> tuple[Rig, PassReport]:
    """Weights outside the `count` largest of a vertex become 0, the others are scaled to sum to 1."""
    kept = largest_weights(rig.weights, options.count)
    limited = replace(rig, weights=kept)
    touched = int((np.count_nonzero(rig.weights, axis=1) > options.count).sum())
    detail = f"{options.count} influences a vertex, {touched} of {rig.vertex_count} vertices had more"
    error = posed_error(rig, limited, poses.check) if touched else None
    return limited, PassReport("limit influences", detail, error)


def largest_weights(weights: NDArray[Any], count: int) -> NDArray[np.float32]:
    """`weights` (N, K) with all but the `count` largest of each row 0, rows scaled to sum to 1.

    Of equal weights the lower joint wins. A row without any weight follows joint 0, the pelvis.
    """
    rows = np.arange(len(weights))
    left = np.array(weights, dtype=np.float32)
    kept = np.zeros_like(left)
    for _ in range(min(count, left.shape[1])):
        joint = left.argmax(axis=1)
        kept[rows, joint] = left[rows, joint]
        left[rows, joint] = -1
    total = kept.sum(axis=1, keepdims=True, dtype=np.float64)
    kept[total[:, 0] <= 0, 0] = 1
    return (kept / np.where(total > 0, total, 1)).astype(np.float32)
