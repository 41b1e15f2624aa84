"""Fewer blend shapes: those that keep most of the movement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.part_of_rig import spread_vertices
from garmentc.passes.pose_set import PoseSet, keys_to_fit
from garmentc.passes.posed_error import posed_error
from garmentc.passes.principal_shapes import PrincipalShapes
from garmentc.passes.report import PassReport
from garmentc.rig import Rig

_TOLERANCE_VERTICES = 4096


@dataclass(frozen=True)
class ReduceBlendShapes:
    """How many blend shapes to keep. With both None all of them are kept.

    count      keep this many
    tolerance  metres: keep the fewest whose 99th percentile of displacement error, over vertices and poses, is below
               it. Skinning never lengthens a displacement, so the posed error is below it too
    """

    count: int | None = None
    tolerance: float | None = None

    def __post_init__(self) -> None:
        if self.count is not None and self.tolerance is not None:
            raise GarmentcError("a number of blend shapes and a tolerance are both given; choose one")
        if self.count is not None and self.count < 0:
            raise GarmentcError(f"{self.count} blend shapes cannot be kept; choose 0 or more")
        if self.tolerance is not None and not self.tolerance > 0:
            raise GarmentcError(f"a tolerance of {self.tolerance} m cannot be kept; choose a length above zero")


def reduce_blend_shapes(rig: Rig, options: ReduceBlendShapes, poses: PoseSet) -> tuple[Rig, PassReport]:
    """Replace the blend shapes by the first of their `PrincipalShapes`: no others keep more of the movement.

    Where nothing is to be removed, shapes stay as they are.
    """
    if options.count is None and options.tolerance is None:
        return rig, PassReport("reduce blend shapes", f"all {rig.morph_count} kept")
    if rig.keys is None or rig.morph_count <= (options.count or 0):
        return rig, PassReport("reduce blend shapes", f"all {rig.morph_count} kept: there are no more")
    with single_threaded_blas():
        keys = keys_to_fit(rig.keys, poses)
        basis = PrincipalShapes.of(rig, keys)
        count = options.count
        if count is None:
            assert options.tolerance is not None
            count = _fewest(rig, basis, keys, options.tolerance)
        reduced = basis.first(count, rig, keys)
    kept = "no blend shape" if count == 0 else f"{count} of {rig.morph_count} blend shapes"
    detail = f"{kept} kept, {100 * basis.explained(count):.2f} % of the squared movement"
    return reduced, PassReport("reduce blend shapes", detail, posed_error(rig, reduced, poses.check))


def _fewest(rig: Rig, basis: PrincipalShapes, keys: NDArray[np.float64], tolerance: float) -> int:
    """The fewest shapes that keep the 99th percentile of the displacement error within `tolerance`, by bisection."""
    rows = spread_vertices(rig.vertex_count, _TOLERANCE_VERTICES)
    shapes = np.tensordot(basis.mix, rig.blend_shapes[:, rows].astype(np.float64), axes=1).reshape(rig.morph_count, -1)
    amounts = (keys @ basis.unmix.T)[:: max(1, len(keys) // 128)]

    def p99(count: int) -> float:
        lost = (amounts[:, count:] @ shapes[count:]).reshape(len(amounts), -1, 3)
        return float(np.percentile(np.linalg.norm(lost, axis=-1), 99))

    low, high = 0, rig.morph_count  # `high` shapes are always enough
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if p99(middle) <= tolerance else (middle + 1, high)
    return high
