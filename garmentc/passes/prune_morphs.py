"""Zeros instead of movements too small to see, so that sparse accessors have something to leave out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from garmentc.passes.key_reach import shape_reach
from garmentc.passes.pose_set import PoseSet
from garmentc.passes.posed_error import posed_error
from garmentc.passes.report import PassReport
from garmentc.rig import Rig


@dataclass(frozen=True)
class PruneMorphs:
    """threshold  metres: a delta shorter than this at its shape's typical amount becomes 0"""

    threshold: float = 2e-5


def prune_morphs(rig: Rig, options: PruneMorphs, poses: PoseSet) -> tuple[Rig, PassReport]:
    """Set deltas to 0 that move their vertex by less than `threshold` where their key is at its `key_reach`.

    Deltas of several shapes add up, so the posed error may exceed the threshold; the report has it.
    """
    if rig.keys is None or not rig.morph_count:
        return rig, PassReport("prune morphs", "no blend shapes, so none")
    amounts = shape_reach(rig, poses)
    shapes = np.empty_like(rig.blend_shapes)
    zeros = 0
    for shape, pruned, amount in zip(rig.blend_shapes, shapes, amounts, strict=True):
        small = np.einsum("ni,ni->n", shape, shape) * amount**2 < options.threshold**2
        pruned[:] = np.where(small[:, None], 0, shape)
        zeros += int(small.sum())
    pruned_rig = replace(rig, blend_shapes=shapes, blend_normals=None)
    detail = f"{100 * zeros / shapes[..., 0].size:.1f} % of the deltas are 0"
    return pruned_rig, PassReport("prune morphs", detail, posed_error(rig, pruned_rig, poses.check))
