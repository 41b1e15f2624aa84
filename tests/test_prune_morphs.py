"""Zeros instead of invisible movements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_samples import make_rig

from garmentc.passes.key_reach import key_reach
from garmentc.passes.pose_set import plausible_poses
from garmentc.passes.prune_morphs import PruneMorphs, prune_morphs
from garmentc.rig import Rig

POSES = plausible_poses(fit=100, check=12)
THRESHOLD = 2e-5


@pytest.fixture(scope="module")
def rig() -> Rig:
    """Bumps, and everywhere else a movement of a few micrometres."""
    sample = make_rig(morphs=10)
    noise = np.random.default_rng(0).normal(0, 5e-6, sample.blend_shapes.shape).astype(np.float32)
    return replace(sample, blend_shapes=sample.blend_shapes + noise)


def test_small_deltas_become_zero_and_the_others_stay(rig: Rig) -> None:
    pruned, _ = prune_morphs(rig, PruneMorphs(THRESHOLD), POSES)
    reach = key_reach(rig.pose_keys(POSES.fit))
    length = np.linalg.norm(rig.blend_shapes.astype(np.float64), axis=-1) * reach[:, None]
    zero = (pruned.blend_shapes == 0).all(axis=-1)
    clear = np.abs(length - THRESHOLD) > 1e-9
    np.testing.assert_array_equal(zero[clear], (length < THRESHOLD)[clear])
    np.testing.assert_array_equal(pruned.blend_shapes[~zero], rig.blend_shapes[~zero])
    assert 0.2 < zero.mean() < 0.98


def test_the_error_is_measured(rig: Rig) -> None:
    pruned, report = prune_morphs(rig, PruneMorphs(THRESHOLD), POSES)
    distance = 1000 * np.linalg.norm(rig.posed(POSES.check) - pruned.posed(POSES.check), axis=-1)
    assert report.error is not None
    assert report.error.max_mm == pytest.approx(distance.max())
    assert 0 < report.error.max_mm < 10 * 1000 * THRESHOLD


def test_a_seldom_used_shape_is_judged_by_what_it_does(rig: Rig) -> None:
    """A shape ten times as large with a key ten times as small is the same shape: it loses the same vertices."""
    assert rig.keys is not None
    last = rig.keys.layers[-1]
    small = replace(last, weight=last.weight / 10, bias=last.bias / 10)
    scaled = replace(
        rig,
        blend_shapes=rig.blend_shapes * 10,
        keys=replace(rig.keys, layers=(*rig.keys.layers[:-1], small)),
    )
    first, second = (prune_morphs(r, PruneMorphs(THRESHOLD), POSES)[0].blend_shapes for r in (rig, scaled))
    assert ((first == 0) == (second == 0)).mean() > 0.9999


def test_without_shapes_there_is_nothing_to_do() -> None:
    bare = make_rig(morphs=0, normals=False)
    assert prune_morphs(bare, PruneMorphs(), POSES)[0] is bare
