"""Motions as animations, and the keyframes they can do without."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gltf_samples import corner_vertices, make_asset, make_motion, make_rig
from scipy.spatial.transform import Rotation, Slerp

from garmentc.gltf.asset import Clip
from garmentc.gltf.evaluate import world_positions
from garmentc.gltf.glb_asset import Channel
from garmentc.gltf.posing import state_at_time
from garmentc.gltf.read import read_glb
from garmentc.gltf.sampling import sample
from garmentc.gltf.tracks import Track, clip_tracks, continuous, kept_frames, lerp, slerp
from garmentc.gltf.write import write_glb
from garmentc.smpl.motion import Motion

ROOT = np.array([0.1, 0.2, 0.3])


def track(tracks: tuple[Track, ...], path: str, joint: int | None) -> Track:
    [found] = [track for track in tracks if (track.path, track.joint) == (path, joint)]
    return found


def test_what_stays_at_rest_has_no_track() -> None:
    poses = np.zeros((10, 24, 3))
    poses[:, 4, 0] = np.linspace(0, 1, 10)
    rig = replace(make_rig(morphs=0), keys=None)
    tracks = clip_tracks(Clip(Motion("m", poses, np.zeros((10, 3)), 30)), (rig,), ROOT, 0)
    assert [(track.path, track.joint) for track in tracks] == [("rotation", 4)]


def test_a_motion_that_rests_becomes_no_animation(tmp_path: Path) -> None:
    rest = Clip(Motion("still", np.zeros((5, 24, 3)), np.zeros((5, 3)), 30))
    write_glb(replace(make_asset(), clips=(rest,)), tmp_path / "a.glb")
    assert read_glb(tmp_path / "a.glb").animations == ()


def test_the_root_moves_from_its_rest_position() -> None:
    motion = make_motion()
    translation = track(clip_tracks(Clip(motion), (make_rig(),), ROOT, 0), "translation", 0)
    np.testing.assert_allclose(translation.values, ROOT + motion.trans, atol=1e-7)


def test_given_keys_are_written_instead_of_the_networks() -> None:
    keys = np.random.default_rng(0).random((30, 8))
    weights = track(clip_tracks(Clip(make_motion(), (keys,)), (make_rig(),), ROOT, 0), "weights", None)
    np.testing.assert_array_equal(weights.values, keys.astype(np.float32))


def test_steady_turning_needs_two_keyframes() -> None:
    poses = np.zeros((100, 24, 3))
    poses[:, 3, 1] = np.linspace(-1.2, 1.5, 100)
    rotation = track(
        clip_tracks(Clip(Motion("m", poses, np.zeros((100, 3)), 60)), (make_rig(),), ROOT, 1e-5), "rotation", 3
    )
    assert rotation.frames.tolist() == [0, 99]


def test_turning_beyond_half_a_turn_keeps_its_direction() -> None:
    """Two keyframes would go the short way back; the reduction must see that."""
    poses = np.zeros((100, 24, 3))
    turned = np.linspace(0, 5.5, 100)
    poses[:, 3, 1] = np.where(turned > np.pi, turned - 2 * np.pi, turned)
    clip = Clip(Motion("m", poses, np.zeros((100, 3)), 60))
    rotation = track(clip_tracks(clip, (make_rig(),), ROOT, 1e-5), "rotation", 3)
    assert 3 <= len(rotation.frames) <= 5
    assert ((rotation.values[1:] * rotation.values[:-1]).sum(axis=1) >= 0).all()
    between = Slerp(rotation.frames, Rotation.from_quat(rotation.values))(np.arange(100))
    assert (between * Rotation.from_rotvec(poses[:, 3]).inv()).magnitude().max() < 1e-4


@pytest.mark.parametrize("tolerance", [1e-4, 1e-3, 5e-3])
def test_leaving_out_keyframes_stays_within_the_tolerance(tmp_path: Path, tolerance: float) -> None:
    """Each track alone may move a vertex by the tolerance: the 26 of them together by no more than their sum."""
    asset = make_asset(morphs=4, key_tolerance=tolerance)
    motion = make_motion(frames=120, fps=60)
    asset = replace(asset, clips=(Clip(motion),))
    result = write_glb(asset, tmp_path / "a.glb")
    assert result.keyframes < 0.9 * result.all_keyframes
    glb = read_glb(tmp_path / "a.glb")
    worst = 0.0
    for frame in range(0, 120, 7):
        expected = asset.rig.posed(motion.poses[frame], motion.trans[frame])[corner_vertices(asset)]
        positions = np.concatenate(world_positions(glb, state_at_time(glb, frame / motion.fps)))
        worst = max(worst, float(np.linalg.norm(positions - expected, axis=1).max()))
    assert 0.05 * tolerance < worst < 5 * tolerance
    assert 0.5 * worst < result.keyframe_error < 2 * worst


def test_one_track_is_within_its_tolerance_at_every_frame() -> None:
    random = np.random.default_rng(1)
    values = np.cumsum(random.normal(0, 0.01, (400, 3)), axis=0)
    frames = kept_frames(values, lerp, lambda a, b: np.linalg.norm(a - b, axis=-1), 0.05)
    assert frames[0] == 0
    assert frames[-1] == 399
    assert len(frames) < 150
    between = np.stack([np.interp(np.arange(400), frames, values[frames, axis]) for axis in range(3)], axis=1)
    assert np.linalg.norm(between - values, axis=1).max() <= 0.05 + 1e-12


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_short_motions(tmp_path: Path, frames: int) -> None:
    motion = make_motion(frames=frames)
    write_glb(replace(make_asset(), clips=(Clip(motion),)), tmp_path / "a.glb")
    [animation] = read_glb(tmp_path / "a.glb").animations
    assert animation.duration == pytest.approx((frames - 1) / 30)


def test_several_motions_become_several_animations(tmp_path: Path) -> None:
    clips = (Clip(make_motion(name="walk")), Clip(make_motion(frames=10, name="jump")))
    write_glb(replace(make_asset(), clips=clips), tmp_path / "a.glb")
    animations = read_glb(tmp_path / "a.glb").animations
    assert [animation.name for animation in animations] == ["walk", "jump"]
    assert [animation.duration for animation in animations] == pytest.approx([29 / 30, 9 / 30])


def test_signs_are_continuous() -> None:
    random = np.random.default_rng(2)
    smooth = Rotation.from_rotvec(np.outer(np.linspace(0, 20, 200), [0.6, 0.0, 0.8])).as_quat()
    signs = random.choice([-1, 1], 200)[:, None]
    result = continuous(smooth * signs)
    assert ((result[1:] * result[:-1]).sum(axis=1) > 0).all()
    np.testing.assert_allclose(np.abs(result), np.abs(smooth))


def test_slerp_agrees_with_scipy() -> None:
    a, b = Rotation.random(50, rng=0), Rotation.random(50, rng=1)
    for first, second in zip(a, b, strict=True):
        amounts = np.linspace(0, 1, 7)
        expected = Slerp([0, 1], Rotation.concatenate([first, second]))(amounts)
        ours = slerp(first.as_quat(), second.as_quat(), amounts[:, None])
        assert (expected * Rotation.from_quat(ours).inv()).magnitude().max() < 1e-7
        channel = Channel(
            0, "rotation", "LINEAR", np.array([0, 1], np.float32), np.stack([first.as_quat(), second.as_quat()])
        )
        sampled = Rotation.from_quat([sample(channel, float(amount)) for amount in amounts])
        assert (expected * sampled.inv()).magnitude().max() < 1e-7


def test_step_and_cubic_channels() -> None:
    times = np.array([0, 1, 3], np.float32)
    step = Channel(0, "translation", "STEP", times, np.array([[0, 0, 0], [1, 2, 3], [4, 5, 6]], np.float32))
    assert sample(step, 0.99).tolist() == [0, 0, 0]
    assert sample(step, 1.0).tolist() == [1, 2, 3]
    assert sample(step, 9.0).tolist() == [4, 5, 6]
    cubic = lambda t: np.array([t**3 - t, 2 * t**2, t])  # noqa: E731
    slope = lambda t: np.array([3 * t**2 - 1, 4 * t, 1])  # noqa: E731
    values = np.concatenate([np.stack([slope(t), cubic(t), slope(t)]) for t in times.astype(float)])
    channel = Channel(0, "translation", "CUBICSPLINE", times, values.astype(np.float32))
    for t in (-1.0, 0.0, 0.4, 1.0, 2.7, 3.0):
        np.testing.assert_allclose(sample(channel, t), cubic(np.clip(t, 0, 3)), atol=1e-5)
