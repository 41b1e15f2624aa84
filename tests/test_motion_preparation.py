"""Motions made fit for cloth, and motions out of sampled poses."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from garmentc.simulation.motion_preparation import PreparationOptions, SelfOverlap, prepare_motion
from garmentc.simulation.pose_walk import WalkOptions, pose_walk
from garmentc.smpl import BodyModel, load_body
from garmentc.smpl.motion import Motion
from garmentc.smpl.skeleton import JOINT_NAMES

JOINT = {name: index for index, name in enumerate(JOINT_NAMES)}


@cache
def body() -> BodyModel:
    return load_body(None, "neutral")


def arms_down(degrees: float) -> np.ndarray:
    pose = np.zeros((24, 3))
    pose[JOINT["left_shoulder"], 2] = -np.radians(degrees)
    pose[JOINT["right_shoulder"], 2] = np.radians(degrees)
    return pose


def motion(poses: np.ndarray, fps: float = 30.0) -> Motion:
    return Motion("test", poses, np.zeros((len(poses), 3)), fps)


def test_overlap_knows_arms_in_the_trunk_from_arms_beside_it():
    overlap = SelfOverlap.of(body(), None, PreparationOptions())
    shares = overlap.shares(np.stack([np.zeros((24, 3)), arms_down(60), arms_down(95)]))
    assert shares[0] == 0
    assert shares[1] <= overlap.share < shares[2]


def test_overlap_is_a_depth():
    """A thigh lifted through the belly is deep everywhere; the same pose is not as deep for a greater depth."""
    pose = arms_down(90)[None]
    shares = [
        SelfOverlap.of(body(), None, PreparationOptions(overlap_depth=depth)).shares(pose)[0]
        for depth in (0.003, 0.01, 0.04)
    ]
    assert shares[0] > shares[1] > shares[2]


def test_arms_open_no_more_than_they_must():
    slightly = prepare_motion(motion(np.repeat(arms_down(60)[None], 4, axis=0)), body())
    deep = prepare_motion(motion(np.repeat(arms_down(115)[None], 4, axis=0)), body())
    assert slightly.arms == 15
    assert 15 < deep.arms <= 35
    assert deep.clear[deep.lead_in :].all()


def test_the_way_in_starts_at_rest_and_arrives_gently():
    options = PreparationOptions(arms=0, arms_most=0)
    pose = arms_down(50)
    pose[0] = [0, 2.0, 0]
    prepared = prepare_motion(replace(motion(np.stack([pose] * 3)), trans=np.full((3, 3), 0.5)), body(), None, options)
    ready = prepared.motion
    assert not ready.poses[0].any()
    assert not ready.trans[0].any()
    arrived = ready.poses[prepared.lead_in - 1]
    assert np.allclose(arrived, ready.poses[prepared.lead_in], atol=1e-9)
    assert np.allclose(arrived[1:], pose[1:], atol=1e-9)
    turned = np.degrees(np.linalg.norm(np.diff(ready.poses, axis=0), axis=2)).max()
    assert turned <= options.lead_in_speed
    assert not prepared.clear[: prepared.lead_in].any()
    assert prepared.clear[prepared.lead_in :].all()


def test_heading_and_place_are_taken_out_and_nothing_else():
    """The body moves as before, seen from where it stood and looked: every distance and height in the scene stays."""
    rng = np.random.default_rng(0)
    poses = 0.2 * rng.normal(size=(5, 24, 3))
    poses[:, 0] += [0.1, 1.9, 0.0]
    trans = rng.normal(size=(5, 3))
    options = PreparationOptions(arms=0, arms_most=0, overlap_share=1.0)
    prepared = prepare_motion(replace(motion(poses), trans=trans), body(), None, options)
    rest = prepared.lead_in
    before = body().posed(poses, None, trans)[:, ::500]
    after = body().posed(prepared.motion.poses[rest:], None, prepared.motion.trans[rest:])[:, ::500]
    rotation, _ = Rotation.align_vectors(
        (after - after.mean(axis=(0, 1))).reshape(-1, 3), (before - before.mean(axis=(0, 1))).reshape(-1, 3)
    )
    axis = rotation.as_rotvec()
    assert np.allclose(axis[[0, 2]], 0, atol=1e-6), "turned about the vertical only"
    assert np.allclose(rotation.apply((before - before[0, 0]).reshape(-1, 3)), (after - after[0, 0]).reshape(-1, 3))
    assert np.allclose(after[..., 1], before[..., 1])
    forward = Rotation.from_rotvec(prepared.motion.poses[rest, 0]).apply([0, 0, 1])
    assert forward[0] == pytest.approx(0, abs=1e-9)
    assert forward[2] > 0


def test_frames_without_room_are_bridged():
    down, up = arms_down(110), arms_down(10)
    poses = np.stack([up, up, down, down, arms_down(40), arms_down(40)])
    options = PreparationOptions(arms=0, arms_most=0)
    prepared = prepare_motion(motion(poses), body(), None, options)
    assert prepared.bridged == 2
    own = prepared.motion.poses[prepared.lead_in :]
    shoulder = JOINT["left_shoulder"]
    keys = Rotation.from_rotvec([up[shoulder], arms_down(40)[shoulder]])
    expected = Slerp([1, 4], keys)([2, 3]).as_rotvec()
    assert np.allclose(own[2:4, shoulder], expected, atol=1e-9)
    assert prepared.clear[prepared.lead_in :].all()


def test_motions_without_any_room_are_marked():
    prepared = prepare_motion(
        motion(np.repeat(arms_down(120)[None], 3, axis=0)), body(), None, PreparationOptions(arms=0, arms_most=0)
    )
    assert not prepared.clear.any()
    assert prepared.bridged == 3


def test_motions_come_at_the_simulation_s_rate():
    prepared = prepare_motion(motion(np.repeat(arms_down(30)[None], 9, axis=0), fps=120.0), body())
    assert prepared.motion.fps == 30
    assert len(prepared.motion) - prepared.lead_in == 3


def test_a_walk_is_smooth_and_depends_on_its_seed_alone():
    walk = pose_walk(150, 4)
    assert walk.poses.shape == (150, 24, 3)
    assert walk.poses.tobytes() == pose_walk(150, 4).poses.tobytes()
    assert not np.array_equal(walk.poses, pose_walk(150, 5).poses)
    rotations = Rotation.from_rotvec(walk.poses.reshape(-1, 3))
    matrices = rotations.as_matrix().reshape(150, 24, 3, 3)
    steps = np.swapaxes(matrices[:-1], -1, -2) @ matrices[1:]
    turned = Rotation.from_matrix(steps.reshape(-1, 3, 3)).magnitude().reshape(149, 24)
    assert np.degrees(turned.max()) < 12
    assert (turned.max(axis=1) < 1e-9).sum() > 5, "poses are held"
    assert np.degrees(np.linalg.norm(walk.poses[:, 0], axis=1)).max() > 5, "the root tilts"
    assert np.allclose(walk.poses[:, 0, 1], 0, atol=0.05), "but keeps its heading"


def test_a_walk_keeps_within_the_sampler_s_ranges():
    knees = pose_walk(300, 1).poses[:, [JOINT["left_knee"], JOINT["right_knee"]]]
    assert knees[..., 0].min() > -1e-9
    assert knees[..., 0].max() <= np.radians(135) + 1e-9
    assert np.allclose(knees[..., 1:], 0)


def test_a_walk_for_a_body_goes_to_clear_poses_only():
    overlap = SelfOverlap.of(body(), None, PreparationOptions())
    options = WalkOptions(hold=(0.2, 0.2))
    walk = pose_walk(120, 2, body(), None, options)
    held = np.linalg.norm(np.diff(walk.poses, axis=0), axis=(1, 2)) < 1e-9
    assert overlap.clear(walk.poses[:-1][held][::3]).all()
