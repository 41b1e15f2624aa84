"""The poses that passes fit to and are measured on."""

from __future__ import annotations

import numpy as np
import pytest

from garmentc.passes.pose_set import farthest_apart, plausible_poses
from garmentc.smpl.skeleton import JOINT_NAMES


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


def test_shaken_poses_differ_at_the_trunk_alone_and_are_the_same_in_every_run() -> None:
    poses = plausible_poses(fit=60, check=8)
    shaken, plain = poses.some_shaken(30), poses.some(30)
    turned = np.degrees(np.linalg.norm(shaken - plain, axis=2))
    moved = {JOINT_NAMES[joint] for joint in np.flatnonzero(turned.any(axis=0))}
    assert {"spine1", "spine2", "spine3", "left_collar", "right_collar"} < moved
    assert not moved & {"pelvis", "left_knee", "right_elbow", "left_wrist"}
    assert 5 < turned[:, JOINT_NAMES.index("spine2")].mean() < 25
    np.testing.assert_array_equal(poses.some_shaken(30), shaken)
    np.testing.assert_array_equal(poses.some(30), plain)


def test_the_same_in_every_run() -> None:
    first, second = plausible_poses(fit=20, check=5), plausible_poses(fit=20, check=5)
    np.testing.assert_array_equal(first.fit, second.fit)
    np.testing.assert_array_equal(first.check, second.check)


def test_poses_farthest_apart_miss_none_of_several_kinds() -> None:
    rng = np.random.default_rng(1)
    kinds = rng.normal(size=(6, 24, 3))
    kind = rng.choice(6, size=200, p=[0.5, 0.3, 0.1, 0.05, 0.03, 0.02])
    poses = kinds[kind] + 0.01 * rng.normal(size=(200, 24, 3))
    chosen = farthest_apart(poses, 6)
    nearest = np.linalg.norm(chosen[:, None] - kinds, axis=(2, 3)).argmin(axis=1)
    assert sorted(nearest) == list(range(6))
    assert len(farthest_apart(poses[:4], 6)) == 4
