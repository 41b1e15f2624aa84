"""What a pass costs: how far it moves posed vertices, in millimetres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.part_of_rig import spread_vertices, take_vertices
from garmentc.passes.pose_blocks import over_blocks
from garmentc.passes.posed_skinning import posed_outfit
from garmentc.rig import Rig

MAX_VERTICES = 1_500
_VALUES_AT_ONCE = 800_000


@dataclass(frozen=True)
class PosedError:
    """Distances between posed vertices before and after a pass, over all poses and measured vertices, millimetres.

    vertices, poses  how many were measured; fewer vertices than the outfit has where it is large
    """

    mean_mm: float
    p99_mm: float
    max_mm: float
    vertices: int
    poses: int

    def __str__(self) -> str:
        return f"{self.mean_mm:.3f} mm mean, {self.p99_mm:.3f} mm p99, {self.max_mm:.3f} mm max"


def posed_error(before: Rig, after: Rig, poses: NDArray[Any], max_vertices: int = MAX_VERTICES) -> PosedError:
    """Distances between `before` and `after` in `poses` (P, 24, 3), in float64.

    Above `max_vertices` every k-th vertex is measured, so memory stays within about 100 MB for any outfit.
    """
    rows = spread_vertices(before.vertex_count, max_vertices)
    before, after = take_vertices(before, rows), take_vertices(after, rows)
    count = max(1, _VALUES_AT_ONCE // (32 * max(1, len(rows))))

    def distances(block: NDArray[Any]) -> NDArray[np.float64]:
        moved = posed_outfit(before, block, np.float64).vertices - posed_outfit(after, block, np.float64).vertices
        apart: NDArray[np.float64] = np.sqrt(np.einsum("inp,inp->np", moved, moved))
        return apart.ravel()

    with single_threaded_blas():
        mm = 1000 * np.concatenate(over_blocks(distances, poses, count))
    return PosedError(float(mm.mean()), float(np.percentile(mm, 99)), float(mm.max()), len(rows), len(poses))
