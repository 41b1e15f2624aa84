"""Motions in stretches: every frame is shown, by one of them or by two that go over into each other."""

from __future__ import annotations

import numpy as np
import pytest

from garmentc.passes.stretches import Stretches, with_way_in
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.motion import Motion
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_NAMES

JOINTS = load_default_body("neutral").joints()


def motion(frames: int, fps: float, cuts: tuple[int, ...] = ()) -> Motion:
    """From one pose to another, while the body walks; at `cuts` it is somewhere else at once."""
    start, end = sample_poses(2, 3)
    share = np.linspace(0, 1, frames)[:, None, None]
    trans = np.outer(np.arange(frames) / fps, [0, 0, 1.5])
    for cut in cuts:
        trans[cut:] += [30.0, 0, 0]
    return Motion("walk", (1 - share) * start + share * end, trans, fps)


@pytest.mark.parametrize(
    ("frames", "fps", "cuts"),
    [
        (1, 30.0, ()),
        (20, 30.0, ()),
        (241, 30.0, ()),
        (1500, 30.0, ()),
        (600, 120.0, ()),
        (40, 10.0, ()),
        (9, 1.0, ()),
        (200, 30.0, (7, 8, 130)),
        (40, 10.0, (39,)),
    ],
)
def test_every_frame_is_shown_once(frames: int, fps: float, cuts: tuple[int, ...]) -> None:
    walked = motion(frames, fps, cuts)
    shown = np.zeros(frames)
    for some in Stretches.of([walked], JOINTS):
        counts = some.shares > 0
        assert (some.frames[~counts] == -1).all()
        np.testing.assert_allclose(some.poses[counts], walked.poses[some.frames[counts]], atol=1e-6)
        np.testing.assert_allclose(some.trans[counts], walked.trans[some.frames[counts]], atol=1e-6)
        np.add.at(shown, some.frames[counts], some.shares[counts])
    np.testing.assert_allclose(shown, 1, atol=1e-6)


def test_motions_of_one_rate_are_side_by_side_and_frames_are_counted_through_all() -> None:
    walks = [motion(250, 30.0), motion(50, 60.0), motion(9, 1.0), motion(490, 30.0)]
    groups = Stretches.of(walks, JOINTS)
    assert sorted((some.fps, some.poses.shape[1]) for some in groups) == [(0.0, 9), (30.0, 5), (60.0, 1)]
    poses, shown = np.concatenate([walk.poses for walk in walks]), np.zeros(799)
    for some in groups:
        counts = some.shares > 0
        np.testing.assert_allclose(some.poses[counts], poses[some.frames[counts]], atol=1e-6)
        np.add.at(shown, some.frames[counts], some.shares[counts])
    np.testing.assert_allclose(shown, 1, atol=1e-6)


def test_long_motions_are_many_stretches_side_by_side() -> None:
    groups = Stretches.of([motion(7200, 30.0)], JOINTS)
    assert [some.poses.shape[1] for some in groups] == [15, 15]
    assert max(len(some.poses) for some in groups) < 0.1 * 7200


def test_few_stretches_are_done_one_by_one() -> None:
    groups = Stretches.of([motion(300, 30.0)], JOINTS)
    assert [some.poses.shape[1] for some in groups] == [1, 1]


def test_frames_follow_each_other_at_the_motions_own_speed() -> None:
    """Also on the way in, and where stretches begin in the middle; but not over a cut."""
    for some in Stretches.of([motion(600, 30.0, (100,))], JOINTS):
        for number in range(len(some.poses) - 1):
            ahead = some.ahead(number)
            still = np.abs(ahead).max(axis=0) == 0  # at the end
            np.testing.assert_allclose(ahead[2, ~still], 1.5 / 30, atol=1e-9)
            np.testing.assert_allclose(ahead[0], 0, atol=1e-9)
        assert not some.ahead(len(some.poses) - 1).any()


def test_slow_motions_are_filled_in_and_poses_stand_alone() -> None:
    (slow,), (alone,) = (Stretches.of([motion(10, fps)], JOINTS) for fps in (10.0, 1.0))
    assert slow.fps == 30.0
    assert alone.poses.shape[:2] == (1, 10)
    assert not alone.fps
    assert not alone.ahead(0).any()


def test_the_way_in_keeps_the_heading() -> None:
    root = np.array([0.0, 2.0, 0.0])
    pose = np.zeros((24, 3))
    pose[0], pose[JOINT_NAMES.index("left_knee"), 0] = root, 0.5
    whole = with_way_in(Motion("turned", np.repeat(pose[None], 5, axis=0), np.ones((5, 3)), 30.0))
    lead = whole.poses[:-5]
    assert len(lead) == 38
    turned = axis_angle_to_matrix(lead[:, 0])
    np.testing.assert_allclose(turned, np.repeat(axis_angle_to_matrix(root)[None], len(lead), axis=0), atol=1e-9)
    np.testing.assert_allclose(lead[0, 1:], 0, atol=1e-9)
    np.testing.assert_allclose(lead[-1], pose, atol=1e-9)
    np.testing.assert_array_equal(whole.trans, 1)
