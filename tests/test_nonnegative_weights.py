"""Morph weights within 0 and 1, with the outfit as it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from compiled import EXAMPLES, FLOAT, FRAMES, MOTION, TIMES, Compiled, case, compile_case
from gltf_samples import make_rig
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from garmentc import optimisation
from garmentc.errors import GarmentcError
from garmentc.gltf.asset import Clip
from garmentc.gltf.bind import morph_sizes, moved_at_most
from garmentc.gltf.evaluate import world_positions
from garmentc.gltf.posing import pose_key_network, state_at_pose, state_at_time
from garmentc.gltf.read import read_glb
from garmentc.gltf.tracks import clip_tracks
from garmentc.options import CompileOptions
from garmentc.outfit.topology import vertex_normals
from garmentc.passes.nonnegative_weights import NonnegativeWeights, nonnegative_weights
from garmentc.passes.pose_set import PoseSet, plausible_poses
from garmentc.passes.prune_morphs import PruneMorphs
from garmentc.rig import DenseLayer, Rig
from garmentc.smpl.motion import Motion
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.smpl.read_motion import read_motion

POSES = plausible_poses(fit=200, check=16)
UNSEEN = sample_poses(100, seed=9)
SKIRT = EXAMPLES / "tee_and_skirt.obj"


@pytest.fixture(scope="module")
def rig() -> Rig:
    return make_rig(morphs=9)


@pytest.fixture(scope="module")
def balanced(rig: Rig) -> Rig:
    return nonnegative_weights(rig, NonnegativeWeights(), POSES)[0]


@given(arrays(np.float64, (3, 5), elements=st.floats(-1e3, 1e3)))
def test_the_activation_takes_the_least_output_off_all(outputs: np.ndarray) -> None:
    layer = DenseLayer(np.eye(5, dtype=np.float32), np.zeros(5, dtype=np.float32), "nonnegative")
    for row, found in zip(outputs, layer(outputs), strict=True):
        np.testing.assert_array_equal(found, [value - min(row) for value in row])


def test_one_shape_more_and_all_sum_to_nothing(rig: Rig, balanced: Rig) -> None:
    assert balanced.morph_count == rig.morph_count + 1
    assert balanced.balanced
    assert not rig.balanced
    assert balanced.blend_normals is not None
    for deltas in (balanced.blend_shapes, balanced.blend_normals):
        assert np.abs(deltas.astype(np.float64).sum(axis=0)).max() < 1e-6 * np.abs(deltas).sum(axis=0).max()


def test_the_outfit_moves_and_shines_as_before(rig: Rig, balanced: Rig) -> None:
    assert np.abs(balanced.posed(UNSEEN) - rig.posed(UNSEEN)).max() < 1e-7
    assert np.abs(rig.posed(UNSEEN) - rig.posed(UNSEEN, keys=np.zeros((100, 9)))).max() > 0.01
    assert rig.blend_normals is not None
    assert balanced.blend_normals is not None
    before, after = (np.tensordot(each.pose_keys(UNSEEN), each.blend_normals, 1) for each in (rig, balanced))
    np.testing.assert_allclose(after, before, atol=1e-6)


def test_weights_are_never_negative_and_small_enough(rig: Rig, balanced: Rig) -> None:
    assert rig.pose_keys(UNSEEN).min() < -0.1
    wild = np.random.default_rng(0).normal(0, 2, (200, 24, 3))
    assert min(balanced.pose_keys(poses).min() for poses in (POSES.fit, UNSEEN, wild)) >= 0
    assert balanced.pose_keys(POSES.fit).max() == pytest.approx(0.8, rel=1e-4)
    assert balanced.pose_keys(np.zeros((24, 3))).max() < 1e-6


def test_weights_of_animations_stay_below_one(rig: Rig) -> None:
    """However far these go beyond the poses to fit."""
    still = replace(POSES, fit=0.2 * POSES.fit)
    free, _ = nonnegative_weights(rig, NonnegativeWeights(), still)
    held, _ = nonnegative_weights(rig, NonnegativeWeights(), replace(still, baked=UNSEEN))
    assert free.pose_keys(UNSEEN).max() > 1
    assert 0.99 < held.pose_keys(UNSEEN).max() <= 1
    assert np.abs(held.posed(UNSEEN) - rig.posed(UNSEEN)).max() < 1e-7


def test_no_shape_is_much_larger_than_what_the_outfit_does(rig: Rig, balanced: Rig) -> None:
    """The last shape is the sum of all others: it must not need a range of numbers of its own."""
    before = np.abs(rig.pose_keys(POSES.fit)).max(axis=0) * np.abs(rig.blend_shapes).max(axis=(1, 2))
    after = np.abs(balanced.blend_shapes).max(axis=(1, 2))
    assert after.max() < 4 * before.max()
    assert after[-1] < 2 * np.median(after)


def test_keys_that_never_move_and_shapes_that_are_nothing_do_no_harm(rig: Rig) -> None:
    """What rounding makes of them would otherwise rule the others."""
    assert rig.keys is not None
    last = rig.keys.layers[-1]
    weight, shapes = last.weight.copy(), rig.blend_shapes.copy()
    weight[2], shapes[4] = 1e-9 * weight[2], 0
    bias = np.where(np.arange(9) == 2, 0, last.bias)
    network = replace(rig.keys, layers=(*rig.keys.layers[:-1], replace(last, weight=weight, bias=bias)))
    odd = replace(rig, keys=network, blend_shapes=shapes)
    balanced, _ = nonnegative_weights(odd, NonnegativeWeights(), POSES)
    assert np.isfinite(balanced.blend_shapes).all()
    assert np.abs(balanced.blend_shapes).max() < 1
    assert balanced.pose_keys(np.zeros((24, 3))).max() < 1e-6
    assert np.abs(balanced.posed(UNSEEN) - odd.posed(UNSEEN)).max() < 1e-7


def test_shapes_that_only_animations_use_stay_as_they_are(rig: Rig) -> None:
    rng = np.random.default_rng(1)
    keys = np.concatenate([rig.pose_keys(UNSEEN), rng.random((100, 2))], axis=1)
    shapes, normals = (rng.normal(0, 0.01, (2, rig.vertex_count, 3)).astype(np.float32) for _ in range(2))
    assert rig.blend_normals is not None
    animated = replace(
        rig,
        blend_shapes=np.concatenate([rig.blend_shapes, shapes]),
        blend_normals=np.concatenate([rig.blend_normals, normals]),
        animation_keys=keys,
    )
    balanced, _ = nonnegative_weights(animated, NonnegativeWeights(), replace(POSES, baked=UNSEEN))
    assert (animated.driven_count, balanced.driven_count, balanced.morph_count) == (9, 10, 12)
    assert balanced.animation_keys is not None
    assert balanced.blend_normals is not None
    np.testing.assert_array_equal(balanced.animation_keys[:, 10:], keys[:, 9:])
    np.testing.assert_array_equal(balanced.blend_shapes[10:], shapes)
    np.testing.assert_array_equal(balanced.blend_normals[10:], normals)
    assert 0 <= balanced.animation_keys.min() < balanced.animation_keys.max() <= 1
    before, after = (each.posed(UNSEEN, keys=each.animation_keys) for each in (animated, balanced))
    assert np.abs(after - before).max() < 1e-7
    assert not balanced.pose_keys(UNSEEN)[:, 10:].any()


def test_without_shapes_there_is_nothing_to_do() -> None:
    bare = make_rig(morphs=0, normals=False)
    assert nonnegative_weights(bare, NonnegativeWeights(), POSES)[0] is bare


def test_a_single_shape_and_shapes_that_never_move() -> None:
    one = make_rig(morphs=1, normals=False)
    balanced, _ = nonnegative_weights(one, NonnegativeWeights(), POSES)
    assert balanced.pose_keys(UNSEEN).min() >= 0
    assert np.abs(balanced.posed(UNSEEN) - one.posed(UNSEEN)).max() < 1e-7
    still = PoseSet(np.zeros((4, 24, 3)), POSES.check)
    assert np.isfinite(nonnegative_weights(one, NonnegativeWeights(), still)[0].blend_shapes).all()


@pytest.mark.parametrize("largest", [0, -1, 1.5])
def test_a_largest_weight_that_is_none_is_refused(largest: float) -> None:
    with pytest.raises(GarmentcError):
        NonnegativeWeights(largest)


def test_balanced_weights_need_as_few_keyframes(rig: Rig, balanced: Rig) -> None:
    """What all weights have in common jumps about and moves nothing: no keyframe is kept for it."""
    motion = read_motion(MOTION)
    clip = Clip(Motion("m", motion.poses, motion.trans, motion.fps))
    counts = [
        next(len(t.frames) for t in clip_tracks(clip, (each,), np.zeros(3), 5e-4) if t.path == "weights")
        for each in (rig, balanced)
    ]
    assert counts[1] < 1.2 * counts[0] < 1.2 * len(motion)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Compiled, Compiled]:
    """An outfit in profile web, in floats, with its animation: with the pass, and without it."""
    folder = tmp_path_factory.mktemp("nonnegative")
    with_it = compile_case(case(SKIRT, quantize=False, name="with"), folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(optimisation, "nonnegative_weights", lambda rig, options, poses: (rig, None))
        # Pruned as the other: it only makes this another case.
        without = compile_case(case(SKIRT, PruneMorphs().threshold, quantize=False, name="without"), folder)
    return with_it, without


def baked(compiled: Compiled) -> np.ndarray:
    """Morph weights of all keyframes that are written (K, M)."""
    [animation] = read_glb(compiled.written.path).animations
    [values] = [channel.values for channel in animation.channels if channel.path == "weights"]
    return values


def test_weights_in_a_compiled_file_are_within_0_and_1(files: tuple[Compiled, Compiled]) -> None:
    with_it, without = map(baked, files)
    assert without.min() < -0.1
    assert with_it.min() == 0
    assert 32 < with_it.shape[1] <= 64
    [mesh] = read_glb(files[0].path).meshes
    names = [f"pose_key_{index:03d}" for index in range(32)]
    extra = [f"animation_{index:03d}" for index in range(with_it.shape[1] - 32)]
    assert mesh.target_names == (*names, *extra)
    assert 0.1 < with_it.max() <= 1
    glb = read_glb(files[0].path)
    for pose in UNSEEN[:10]:
        assert state_at_pose(glb, pose).weights[glb.mesh_nodes[0]].min() >= 0


def test_a_compiled_file_moves_as_it_would_without(files: tuple[Compiled, Compiled]) -> None:
    """Its animation and its network, by the independent evaluation of the file."""
    with_it, without = files
    glb, [motion] = read_glb(with_it.path), without.dressed.motions
    expected = without.moved(without.rig, FRAMES)
    for time, moved in zip(TIMES, expected, strict=True):
        assert np.abs(np.concatenate(world_positions(glb, state_at_time(glb, time))) - moved).max() < FLOAT
    for frame in FRAMES:
        state = state_at_pose(glb, motion.poses[frame], motion.trans[frame])
        posed = without.rig.posed(motion.poses[frame], motion.trans[frame])[without.corner_vertices]
        assert np.abs(np.concatenate(world_positions(glb, state)) - posed).max() < FLOAT


def test_weights_as_baked_in_eight_bits_lose_little(files: tuple[Compiled, Compiled]) -> None:
    """As gltfpack stores them, as 8-bit fractions of 1: the outfit without the pass falls apart."""
    motion = files[0].dressed.motions[0]
    lost = []
    for compiled in files:
        keys = compiled.rig.animation_keys
        assert keys is not None
        stored = np.round(np.clip(keys, 0, 1) * 255) / 255
        moved = compiled.rig.posed(motion.poses, keys=stored) - compiled.rig.posed(motion.poses, keys=keys)
        lost.append(float(np.linalg.norm(moved, axis=-1).max()))
    assert lost[0] < 0.004 < 0.02 < lost[1]


def test_light_is_right_where_engines_shorten_every_targets_normal(files: tuple[Compiled, Compiled]) -> None:
    """Filament makes the normal of each target a unit vector before it adds them up: many large ones go wrong."""
    rig, frames = files[0].rig, slice(None, None, 12)
    assert rig.animation_keys is not None
    assert rig.blend_normals is not None
    rest = vertex_normals(rig.template, rig.triangles)
    turned = rest + rig.blend_normals
    shortened = turned / np.maximum(np.linalg.norm(turned, axis=2, keepdims=True), 1e-9) - rest
    apart = []
    for keys in rig.animation_keys[frames]:
        right = vertex_normals(rig.template + np.tensordot(keys, rig.blend_shapes, 1), rig.triangles)
        shown = rest + np.tensordot(keys, shortened, 1)
        cosine = np.einsum("ni,ni->n", shown, right) / np.maximum(np.linalg.norm(shown, axis=1), 1e-9)
        apart.append(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    assert np.mean(apart) < 8
    assert (np.array(apart) > 60).mean() < 0.005


def test_it_runs_where_shapes_are_chosen(files: tuple[Compiled, Compiled]) -> None:
    rig, dressed = files[0].rig, files[0].dressed
    counts = {name: len(optimisation.passes(rig, CompileOptions(**given), dressed)) for name, given in {
        "web": {}, "tolerance": {"profile": "reference", "morph_tolerance": 0.01}, "all": {"profile": "reference"},
        "one": {"morphs": 1}, "none": {"morphs": 0},
    }.items()}  # fmt: skip
    quantized = 1
    assert counts["web"] - quantized == counts["tolerance"] == counts["all"] + 2  # sorted before it, too
    assert counts["one"] == counts["none"] == counts["web"] - 2


def test_a_bound_on_movement_knows_what_balanced_targets_have_in_common(files: tuple[Compiled, Compiled]) -> None:
    glb = read_glb(files[0].path)
    [node] = glb.mesh_nodes
    network = pose_key_network(glb, node)
    assert network is not None
    count = len(network.layers[-1].bias)
    weights = np.random.default_rng(0).random((3, count))
    weights[1] = 0.5
    bound = moved_at_most(glb, node, weights)
    parts = [part.morph_positions[:count] for part in glb.meshes[0].primitives]
    shapes = np.concatenate(parts, axis=1).astype(np.float64)
    moved = np.linalg.norm(np.tensordot(weights, shapes, 1), axis=-1).max(axis=1)
    assert (moved <= bound + 1e-9).all()
    assert bound[1] < 1e-6
    assert bound[0] <= weights[0] @ morph_sizes(glb, node)[:count]
