"""Keeping the largest blend weights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_samples import make_rig
from hypothesis import given
from hypothesis import strategies as st

from garmentc.passes.limit_influences import LimitInfluences, largest_weights, limit_influences
from garmentc.passes.pose_set import plausible_poses

POSES = plausible_poses(fit=16, check=6)


@given(st.integers(0, 2**32 - 1), st.sampled_from([1, 4, 8]))
def test_rows_hold_the_largest_weights_and_sum_to_one(seed: int, count: int) -> None:
    weights = np.random.default_rng(seed).dirichlet(np.full(24, 0.3), size=30).astype(np.float32)
    kept = largest_weights(weights, count)
    for before, after in zip(weights.astype(np.float64), kept, strict=True):
        expected = np.zeros(24)
        chosen = sorted(range(24), key=lambda joint: (-before[joint], joint))[:count]
        expected[chosen] = before[chosen] / before[chosen].sum()
        np.testing.assert_allclose(after, expected, atol=2e-7)
        assert (after > 0).sum() <= count


def test_of_equal_weights_the_lower_joints_win() -> None:
    weights = np.zeros((1, 24), np.float32)
    weights[0, [3, 7, 11, 15, 19, 23]] = 1 / 6
    assert np.flatnonzero(largest_weights(weights, 4)).tolist() == [3, 7, 11, 15]


def test_a_row_without_weight_follows_the_pelvis() -> None:
    kept = largest_weights(np.zeros((2, 24), np.float32), 4)
    assert (kept[:, 0] == 1).all()
    assert (kept.sum(axis=1) == 1).all()


def test_the_error_is_how_far_posed_vertices_move() -> None:
    rig = make_rig(influences=12)
    limited, report = limit_influences(rig, LimitInfluences(4), POSES)
    distance = 1000 * np.linalg.norm(rig.posed(POSES.check) - limited.posed(POSES.check), axis=-1)
    assert report.error is not None
    assert report.error.mean_mm == pytest.approx(distance.mean())
    assert report.error.p99_mm == pytest.approx(np.percentile(distance, 99))
    assert report.error.max_mm == pytest.approx(distance.max())
    assert 0 < report.error.mean_mm < report.error.p99_mm < report.error.max_mm


def test_eight_influences_cost_less_than_four() -> None:
    rig = make_rig(influences=16)
    four, eight = (limit_influences(rig, LimitInfluences(count), POSES)[1].error for count in (4, 8))
    assert four is not None
    assert eight is not None
    assert eight.mean_mm < four.mean_mm


def test_a_rig_within_the_limit_stays_as_it_is() -> None:
    rig = make_rig(influences=4)
    limited, report = limit_influences(rig, LimitInfluences(8), POSES)
    np.testing.assert_allclose(limited.weights, rig.weights, atol=1e-7)
    assert report.error is None


def test_large_outfits_are_measured_on_some_vertices() -> None:
    from garmentc.passes.posed_error import posed_error

    rig = make_rig(influences=12)
    moved = replace(rig, template=rig.template + np.array([0, 0.001, 0]))
    error = posed_error(rig, moved, POSES.check, max_vertices=50)
    assert error.vertices == 50
    assert error.max_mm <= 1 + 1e-9
