"""Blend shapes sorted anew: the outfit moves as before, and amounts do not work against each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from gltf_samples import make_rig

from garmentc.passes.pose_set import plausible_poses
from garmentc.passes.principal_shapes import principal_shapes

POSES = plausible_poses(fit=300, check=16)


def test_the_outfit_moves_as_before() -> None:
    rig = make_rig(morphs=24)
    ordered, report = principal_shapes(rig, POSES)
    np.testing.assert_allclose(ordered.posed(POSES.check), rig.posed(POSES.check), atol=1e-6)
    assert ordered.morph_count == 24
    assert report.error is not None
    assert report.error.max_mm < 1e-3


def test_shapes_that_undo_each_other_are_parted() -> None:
    """One movement, as the small difference of two large shapes: amounts and shapes become as small as it is."""
    rig = make_rig(morphs=2)
    large = 50 * rig.blend_shapes[0]
    ordered, _ = principal_shapes(replace(rig, blend_shapes=np.stack([large, rig.blend_shapes[1] - large])), POSES)
    keys = ordered.pose_keys(POSES.fit)
    effort = np.abs(keys[:, :, None, None] * ordered.blend_shapes).sum(axis=1).mean()
    movement = np.abs(np.tensordot(keys, ordered.blend_shapes, 1)).mean()
    assert effort < 2 * movement


def test_no_blend_shapes_are_left_alone() -> None:
    rig = make_rig(morphs=0)
    assert principal_shapes(rig, POSES)[0] is rig
