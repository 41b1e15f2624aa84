"""Cloth of animations settles: out of the skin and back to its lengths, in those frames alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from worn import BODY, skirt, trousers

from garmentc.families.held_cloth import held_cloth
from garmentc.outfit.topology import edge_lengths, edges
from garmentc.passes.animated_cloth import AnimatedCloth, Falling
from garmentc.passes.posed_skinning import PosedVertices
from garmentc.passes.settle_animations import SettleAnimations, settle_animations
from garmentc.passes.stretches import Stretches
from garmentc.rig import Rig
from garmentc.smpl.motion import Motion
from garmentc.smpl.nearest import nearest_body_weights, signed_distance
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_NAMES

FRAMES = 24
ALL = SettleAnimations(shapes=64, tolerance=0)


def walk(seed: int, frames: int = FRAMES, fps: float = 30.0) -> Motion:
    """From one sampled pose to another, evenly."""
    start, end = sample_poses(2, seed)
    share = np.linspace(0, 1, frames)[:, None, None]
    return Motion(f"walk {seed}", (1 - share) * start + share * end, np.zeros((frames, 3)), fps)


@pytest.fixture(scope="module")
def lazy() -> Rig:
    """Trousers whose legs bend at the hips where they should at the knees: shins come through."""
    rig = trousers()
    weights = rig.weights.copy()
    for side in ("left", "right"):
        knee, hip = JOINT_NAMES.index(f"{side}_knee"), JOINT_NAMES.index(f"{side}_hip")
        weights[:, hip] += 0.3 * weights[:, knee]
        weights[:, knee] *= 0.7
    return replace(rig, weights=weights)


def loose(rig: Rig) -> np.ndarray:
    return np.zeros(rig.vertex_count, np.float32)


def played(rig: Rig, motion: Motion, first: int = 0) -> np.ndarray:
    """Vertices (T, N, 3) in the frames of a motion that begins at the frame `first` of all animations."""
    assert rig.animation_keys is not None
    return rig.posed(motion.poses, keys=rig.animation_keys[first : first + len(motion)])


def stretched(vertices: np.ndarray, rig: Rig) -> float:
    """Mean change of edge lengths, metres."""
    pairs = edges(rig.triangles)
    rest = edge_lengths(rig.template, pairs)
    return float(np.mean([np.abs(edge_lengths(frame, pairs) - rest).mean() for frame in vertices]))


def inside(vertices: np.ndarray, motion: Motion) -> float:
    """Share of vertices inside the posed body, by exact distances."""
    pairs = zip(vertices, BODY.posed(motion.poses), strict=True)
    return float(np.mean([signed_distance(cloth, skin, BODY.faces) < 0 for cloth, skin in pairs]))


def test_cloth_comes_out_of_the_skin_and_back_to_its_lengths(lazy: Rig) -> None:
    motion = walk(3)
    settled, report = settle_animations(lazy, lazy, ALL, [motion], loose(lazy), BODY)
    before, after = lazy.posed(motion.poses), played(settled, motion)
    assert inside(before, motion) > 0.03
    assert inside(after, motion) < 0.1 * inside(before, motion)
    assert stretched(after, lazy) < 0.8 * stretched(before, lazy)  # skin stretches too
    assert f"for {FRAMES} frames" in report.detail


def test_what_is_interrupted_goes_no_further(lazy: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """One stretch is, and another has long to go."""

    def along(cloth: AnimatedCloth, stretches: Stretches) -> Iterator[tuple[int, np.ndarray]]:
        if stretches.fps > 30:
            raise KeyboardInterrupt
        for _ in range(10_000):
            yield len(stretches.poses) - 1, np.zeros((3, lazy.vertex_count, 1), np.float32)
        pytest.fail("it went on")

    monkeypatch.setattr(AnimatedCloth, "along", along)
    with pytest.raises(KeyboardInterrupt):
        settle_animations(lazy, lazy, ALL, [walk(3, fps=60), walk(4, fps=30)], loose(lazy), BODY)


def test_other_poses_are_left_alone(lazy: Rig) -> None:
    settled, _ = settle_animations(lazy, lazy, ALL, [walk(3)], loose(lazy), BODY)
    poses = sample_poses(8, 99)
    assert settled.morph_count > lazy.morph_count
    assert settled.driven_count == lazy.morph_count
    assert not settled.pose_keys(poses)[:, lazy.morph_count :].any()
    np.testing.assert_array_equal(settled.pose_keys(poses)[:, : lazy.morph_count], lazy.pose_keys(poses))
    np.testing.assert_array_equal(settled.blend_shapes[: lazy.morph_count], lazy.blend_shapes)


def test_nothing_jumps(lazy: Rig) -> None:
    """Accelerations stay near those of the skinning alone: mean over vertices and frames."""
    motion = walk(5)
    settled, _ = settle_animations(lazy, lazy, ALL, [motion], loose(lazy), BODY)
    jerks = [np.abs(np.diff(v, 2, axis=0)).mean() for v in (lazy.posed(motion.poses), played(settled, motion))]
    moved = np.linalg.norm(played(settled, motion) - lazy.posed(motion.poses), axis=-1).mean()
    assert jerks[1] - jerks[0] < 0.1 * moved


def test_animations_do_not_depend_on_each_other(lazy: Rig) -> None:
    first, second = walk(3), walk(4, frames=10)
    alone, _ = settle_animations(lazy, lazy, ALL, [second], loose(lazy), BODY)
    # All skin that any of them touches is known to both.
    both, _ = settle_animations(lazy, lazy, ALL, [first, second], loose(lazy), BODY)
    apart = np.linalg.norm(played(both, second, len(first)) - played(alone, second), axis=-1)
    assert np.percentile(apart, 90) < 1e-3


def test_a_frame_rate_is_no_other_motion(lazy: Rig) -> None:
    slow, fast = walk(3, frames=FRAMES, fps=30), walk(3, frames=2 * FRAMES - 1, fps=60)
    ends = [played(settle_animations(lazy, lazy, ALL, [m], loose(lazy), BODY)[0], m)[-1] for m in (slow, fast)]
    moved = np.linalg.norm(ends[0] - lazy.posed(slow.poses[-1]), axis=-1).mean()
    assert np.linalg.norm(ends[0] - ends[1], axis=-1).mean() < 0.3 * moved


def test_rounding_decides_nothing(lazy: Rig) -> None:
    """Where cloth touches the skin a little earlier or later, it ends up in the same place."""
    motion = walk(3)
    noise = 1 + np.random.default_rng(0).normal(0, 1e-6, lazy.weights.shape).astype(np.float32)
    both = [
        played(settle_animations(lazy, start, ALL, [motion], loose(lazy), BODY)[0], motion)
        for start in (lazy, replace(lazy, weights=lazy.weights * noise))
    ]
    apart = np.linalg.norm(both[0] - both[1], axis=-1)
    assert (apart.mean(), np.percentile(apart, 99)) < (5e-5, 1e-3)


def test_few_shapes_keep_most(lazy: Rig) -> None:
    motion = walk(3)
    whole, _ = settle_animations(lazy, lazy, ALL, [motion], loose(lazy), BODY)
    few, _ = settle_animations(lazy, lazy, replace(ALL, shapes=6), [motion], loose(lazy), BODY)
    rough, _ = settle_animations(lazy, lazy, replace(ALL, tolerance=2e-3), [motion], loose(lazy), BODY)
    assert few.morph_count == lazy.morph_count + 6
    assert lazy.morph_count < rough.morph_count < whole.morph_count
    exact, moved = played(whole, motion), np.linalg.norm(played(whole, motion) - lazy.posed(motion.poses), axis=-1)
    assert np.linalg.norm(played(few, motion) - exact, axis=-1).mean() < 0.2 * moved.mean()
    left = np.linalg.norm(played(rough, motion) - exact, axis=-1)
    assert np.sqrt((left**2).mean()) < 2.2e-3


def test_it_settles_from_the_start_and_makes_up_for_the_passes(lazy: Rig) -> None:
    """What a pass has bent elsewhere, in frames it is bent back."""
    motion = walk(3)
    good = trousers()
    expected, _ = settle_animations(good, good, ALL, [motion], loose(good), BODY)
    found, _ = settle_animations(lazy, good, ALL, [motion], loose(good), BODY)
    apart = np.linalg.norm(played(found, motion) - played(expected, motion), axis=-1)
    assert np.linalg.norm(lazy.posed(motion.poses) - good.posed(motion.poses), axis=-1).mean() > 3e-3
    assert (apart.mean(), np.percentile(apart, 99)) < (1e-4, 1e-3)


def test_what_the_skin_holds_is_not_pulled_down() -> None:
    """A skirt's waistband goes with the skin, however its cloth is stretched."""
    template, triangles = skirt()
    rng = np.random.default_rng(0)
    rig = replace(
        trousers(),
        template=template,
        triangles=triangles.astype(np.int32),
        weights=nearest_body_weights(template, BODY.shaped(), BODY).astype(np.float32),
        blend_shapes=rng.normal(0, 1e-9, (48, len(template), 3)).astype(np.float32),
    )
    cloth = held_cloth(template, edges(triangles), BODY)
    rim = cloth.firmness > 0.99
    assert rim.any()
    motion = walk(3)
    ways = []
    for firmness in (cloth.firmness, loose(rig)):
        options = replace(ALL, falling=Falling(stays=np.inf))
        settled, _ = settle_animations(rig, rig, options, [motion], firmness, BODY)
        ways.append(np.linalg.norm(played(settled, motion) - rig.posed(motion.poses), axis=-1)[:, rim].mean())
    assert ways[0] < 0.25 * ways[1]


def test_without_animations_nothing_is_added(lazy: Rig) -> None:
    for options, motions in ((ALL, []), (replace(ALL, shapes=0), [walk(3)])):
        settled, report = settle_animations(lazy, lazy, options, motions, loose(lazy), BODY)
        assert settled is lazy
        assert "no " in report.detail


def test_what_lies_still_gets_no_shapes(lazy: Rig) -> None:
    """A garment that is where it should be at rest, and stays there."""
    apart = replace(lazy, template=lazy.template + np.array([0, 0, 5.0]))  # from any skin
    still = Motion("still", np.zeros((5, 24, 3)), np.zeros((5, 3)), 30.0)
    settled, report = settle_animations(apart, apart, ALL, [still], loose(lazy), BODY)
    assert settled is apart
    assert report.detail == "5 frames lack nothing"


def test_one_frame_is_an_animation(lazy: Rig) -> None:
    motion = walk(3, frames=1)
    settled, _ = settle_animations(lazy, lazy, ALL, [motion], loose(lazy), BODY)
    assert settled.morph_count == lazy.morph_count + 1
    assert inside(played(settled, motion), motion) < 0.2 * inside(lazy.posed(motion.poses), motion)


def test_at_rest_undoes_what_skinning_makes_of_a_movement() -> None:
    rng = np.random.default_rng(0)
    one, other = (axis_angle_to_matrix(scale * rng.normal(size=(50, 3))) for scale in (2.0, 0.5))
    turn = 0.7 * one + 0.3 * one @ other
    posed = PosedVertices(np.zeros((3, 50, 1)), turn.transpose(1, 2, 0)[..., None])
    moved = rng.normal(size=(3, 50, 1))
    np.testing.assert_allclose(posed.at_rest(posed.turned(moved)), moved, atol=0.02 * np.abs(moved).max())


def test_what_skinning_collapses_is_not_blown_up() -> None:
    """Half a turn mixed with none leaves one axis of three. What is lost along the others is not made up for."""
    half = axis_angle_to_matrix(np.array([0, np.pi, 0]))
    posed = PosedVertices(np.zeros((3, 1, 1)), ((half + np.eye(3)) / 2)[:, :, None, None])
    assert np.abs(posed.at_rest(np.ones((3, 1, 1)))).max() < 1.01
