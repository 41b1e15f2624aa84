"""What integer vertex attributes will cost."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.positions import position_codec
from garmentc.gltf.skin import to_unorm16
from garmentc.passes.limit_influences import largest_weights
from garmentc.passes.part_of_rig import spread_vertices, take_vertices
from garmentc.passes.pose_set import PoseSet
from garmentc.passes.posed_error import MAX_VERTICES, posed_error
from garmentc.passes.report import PassReport
from garmentc.rig import Rig


@dataclass(frozen=True)
class Quantize:
    """What the back end will do.

    influences  joints that may move a vertex in the file: 4 or 8
    beside      rigs that share the file's one box of positions
    compress    the file will be compressed
    """

    influences: int = 4
    beside: tuple[Rig, ...] = ()
    compress: bool = False


def quantize(rig: Rig, options: Quantize, poses: PoseSet) -> tuple[Rig, PassReport]:
    """Measure the rig as it comes back out of int16 positions and deltas and uint16 weights.

    The rig itself stays as it is: the back end does the rounding, once.
    """
    codec = position_codec(rig, *options.beside, quantize=True, compress=options.compress)
    part = take_vertices(rig, spread_vertices(rig.vertex_count, MAX_VERTICES))
    weights = largest_weights(part.weights, options.influences).astype(np.float64)
    joints = np.argsort(-weights, axis=1, kind="stable")
    stored = np.zeros_like(weights)
    np.put_along_axis(stored, joints, to_unorm16(np.take_along_axis(weights, joints, axis=1)) / 65535, axis=1)
    rounded = replace(
        part,
        template=_metres(codec.positions(part.template), codec.step) + codec.center,
        weights=stored,
        blend_shapes=_metres(codec.deltas(part.blend_shapes), codec.step),
    )
    detail = f"16-bit positions, a step of {1000 * codec.step:.3f} mm"
    return rig, PassReport("quantize", detail, posed_error(part, rounded, poses.check))


def _metres(integers: NDArray[Any], step: float) -> NDArray[np.float64]:
    return integers.astype(np.float64) * step
