"""Poses drawn from recorded motion's statistics: they have these statistics, and come closer to motion left out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from garmentc.simulation.plan import make_plan
from garmentc.simulation.pose_walk import WalkOptions, pose_walk
from garmentc.simulation.presets import SMALL
from garmentc.smpl.body import BodyModel
from garmentc.smpl.build_pose_statistics import mirrored, pose_statistics, without_heading
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.smpl.pose_statistics import POSED, draw_poses, load_pose_statistics
from garmentc.smpl.rotations import axis_angle_to_quaternion
from garmentc.smpl.skeleton import JOINT_NAMES


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return load_default_body("neutral")


def test_the_same_seed_gives_the_same_poses() -> None:
    poses = draw_poses(20, 3)
    assert poses.shape == (20, 24, 3)
    assert poses.tobytes() == draw_poses(20, 3).tobytes()
    assert poses[:5].tobytes() == draw_poses(5, 3).tobytes()
    assert not np.array_equal(poses, draw_poses(20, 4))
    assert not poses[:, POSED:].any(), "hands stay as they are"


def test_draws_have_the_mean_covariance_and_limits_of_the_file() -> None:
    statistics = load_pose_statistics()
    angles = draw_poses(4000, 0)[:, :POSED].reshape(4000, -1)
    assert (angles >= statistics.low).all()
    assert (angles <= statistics.high).all()
    spread = np.sqrt((statistics.factor.astype(float) ** 2).sum(axis=1))
    assert np.abs(angles.mean(axis=0) - statistics.mean).max() < 0.2 * spread.max()
    assert np.corrcoef(angles.std(axis=0), spread)[0, 1] > 0.95
    knee = JOINT_NAMES.index("left_knee") * 3
    assert statistics.low[knee] > -0.1, "knees bend one way"


def test_statistics_of_normal_poses_are_found_again() -> None:
    rng = np.random.default_rng(1)
    turns = np.zeros((6_000, 24, 3))
    turns[:, 1:, 0] = rng.normal(0.3, 0.2, (len(turns), 23))
    found = pose_statistics([turns])
    assert found.mean[3:].reshape(-1, 3)[:, 0] == pytest.approx(0.3, abs=0.01)
    covariance = found.factor @ found.factor.T
    assert np.sqrt(np.diag(covariance)[3::3]) == pytest.approx(0.2, abs=0.01)
    assert np.abs(covariance[3::3, 3::3] - np.diag(np.diag(covariance)[3::3])).max() < 0.002, "left and right apart"


def test_every_clip_counts_the_same() -> None:
    low, high = np.zeros((1000, 24, 3)), np.zeros((10, 24, 3))
    high[:, 3, 0] = 1.0
    assert pose_statistics([low, high]).mean[9] == pytest.approx(0.5)


def test_a_mirrored_pose_is_the_mirrored_body(body: BodyModel) -> None:
    """Joints of the posed body, to a millimetre or so: the default body is not quite symmetric."""
    pose = 0.6 * sample_poses(1, 5)
    places, image = (body_joints(body, poses[0]) for poses in (pose, mirrored(pose)))
    swap = [
        JOINT_NAMES.index(n.replace("left", "R").replace("right", "left").replace("R", "right")) for n in JOINT_NAMES
    ]
    assert np.abs(image - places[swap] * [-1, 1, 1]).max() < 0.005


def body_joints(body: BodyModel, pose: NDArray[np.float64]) -> NDArray[np.float64]:
    from garmentc.smpl.rotations import axis_angle_to_matrix
    from garmentc.smpl.skinning import joint_transforms

    rest = body.joints(None)
    transforms = joint_transforms(axis_angle_to_matrix(pose[None]), rest, np.zeros((1, 3)))[0]
    return np.einsum("jik,jk->ji", transforms[:, :3, :3], rest) + transforms[:, :3, 3]


def test_headings_are_taken_off() -> None:
    pose = sample_poses(3, 2)
    turned = pose.copy()
    turned[:, 0] = [0.0, 2.0, 0.0]
    assert np.abs(without_heading(turned)[:, 0]).max() < 1e-9
    assert np.array_equal(without_heading(turned)[:, 1:], pose[:, 1:])


def test_walks_through_them_are_an_option_and_the_default_is_as_ever() -> None:
    default, drawn = (pose_walk(60, 4, options=WalkOptions(poses=name)) for name in ("ranges", "statistics"))
    assert default.poses.tobytes() == pose_walk(60, 4).poses.tobytes()
    assert not np.array_equal(default.poses, drawn.poses)
    plan = make_plan(SMALL)
    other = make_plan(replace(SMALL, poses="statistics"))
    assert all("poses" not in motion for motion in plan.document()["motions"]), "older datasets can be gone on with"
    assert plan.document() != other.document()
    assert {motion.poses for motion in other.motions} == {"statistics"}


def test_they_come_closer_to_motion_that_was_left_out(shared: Path) -> None:
    """Mean angle over the joints between frames of a clip and the nearest of 500 poses, statistics from other clips."""
    clips = {}
    for path in sorted((shared / "data" / "motion").glob("cmu_*.npz")):
        with np.load(path, allow_pickle=False) as file:
            clips[path.stem] = np.asarray(file["poses"], np.float64).reshape(-1, 24, 3)[::8]
    ranges = sample_poses(500, 1)
    for name in ("cmu_02_05_punch_strike", "cmu_02_09_swordplay", "cmu_55_01_dance_whirl"):
        drawn = draw_poses(500, 1, pose_statistics([clip for other, clip in clips.items() if other != name]))
        assert nearest(clips[name], drawn) < nearest(clips[name], ranges) - 1.0


def nearest(frames: NDArray[np.float64], poses: NDArray[np.float64]) -> float:
    """Degrees."""
    joints = [k for k in range(1, POSED) if "foot" not in JOINT_NAMES[k]]
    a, b = (axis_angle_to_quaternion(group[:, joints]) for group in (frames, poses))
    turn = 2 * np.arccos(np.clip(np.abs(np.einsum("fjk,pjk->fpj", a, b)), 0, 1))
    return float(np.degrees(turn.mean(axis=2).min(axis=1).mean()))
