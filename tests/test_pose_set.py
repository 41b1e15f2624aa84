"""The poses that passes fit to and are measured on."""

from __future__ import annotations

import numpy as np
import pytest

from garmentc.passes.pose_set import plausible_poses


def rows(poses: np.ndarray) -> set[bytes]:
    return {np.ascontiguousarray(pose).tobytes() for pose in poses}


def test_no_pose_is_both_fitted_and_checked() -> None:
    motion = np.random.default_rng(0).normal(size=(5000, 24, 3))
    poses = plausible_poses(motion, fit=400, check=80)
    assert not rows(poses.fit) & rows(poses.check)
    assert len(rows(poses.fit)) == len(poses.fit) == 500
    assert len(rows(poses.check)) == len(poses.check) == 100


def test_a_motion_joins_with_frames_from_all_of_it() -> None:
    motion = np.random.default_rng(0).normal(size=(1000, 24, 3))
    poses = plausible_poses(motion, fit=400, check=40)
    frame_of = {pose.tobytes(): frame for frame, pose in enumerate(motion)}
    frames = [frame_of[pose.tobytes()] for pose in poses.fit if pose.tobytes() in frame_of]
    assert len(frames) == 100
    assert np.diff(frames).max() <= 10
    assert frames[0] < 10
    assert frames[-1] >= 990


@pytest.mark.parametrize("length", [0, 1, 3])
def test_a_very_short_motion(length: int) -> None:
    poses = plausible_poses(np.ones((length, 24, 3)), fit=40, check=8)
    assert len(poses.fit) == 40 + length
    assert len(poses.check) == 8 + min(length, 2)


def test_some_poses_are_spread_over_all() -> None:
    poses = plausible_poses(np.ones((100, 24, 3)), fit=60, check=8)  # 15 frames of the motion come last
    some = poses.some(15)
    assert len(some) == 15
    assert (some == 1).all(axis=(1, 2)).sum() == 3
    assert len(poses.some(1000)) == len(poses.fit)


def test_the_same_in_every_run() -> None:
    first, second = plausible_poses(fit=20, check=5), plausible_poses(fit=20, check=5)
    np.testing.assert_array_equal(first.fit, second.fit)
    np.testing.assert_array_equal(first.check, second.check)
