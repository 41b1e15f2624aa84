"""Pushing an outfit out of its body without stretching it, judged with exact distances, mostly on unseen poses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_samples import make_rig
from worn import BODY, collided, trousers

from garmentc.evaluation.metrics import bend, edge_mm
from garmentc.outfit.topology import edge_lengths, edges
from garmentc.passes.anchored_cloth import BULGE, AnchoredCloth
from garmentc.passes.anchors import Anchors
from garmentc.passes.body_contacts import CLEARANCE
from garmentc.passes.pose_set import plausible_poses
from garmentc.passes.report import PassReport
from garmentc.passes.resolve_collisions import ResolveCollisions, resolve_collisions
from garmentc.rig import DenseLayer, KeyNetwork, Rig
from garmentc.smpl.nearest import signed_distance
from garmentc.smpl.skeleton import JOINT_NAMES

POSES = plausible_poses(fit=512, check=64)
SETTINGS = ResolveCollisions(poses=128)


def resolve(
    rig: Rig,
    settings: ResolveCollisions = SETTINGS,
    betas: np.ndarray | None = None,
    *,
    anchors: int = 3000,
    bulge: float = 0,  # standing off for what bulges between vertices stretches a tight garment
    clearance: float = CLEARANCE,
) -> tuple[Rig, PassReport]:
    cloth = AnchoredCloth.of(
        rig, Anchors.of(rig, anchors), BODY, betas, POSES.some(settings.poses), clearance=clearance, bulge=bulge
    )
    return resolve_collisions(rig, cloth, settings, POSES, BODY, betas)


@pytest.fixture(scope="module")
def garment() -> Rig:
    return trousers()


@pytest.fixture(scope="module")
def resolved(garment: Rig) -> tuple[Rig, PassReport]:
    return resolve(garment)


def test_collisions_at_least_halve_in_unseen_poses(garment: Rig, resolved: tuple[Rig, PassReport]) -> None:
    poses = POSES.check[:24]
    before, after = collided(garment, poses), collided(resolved[0], poses)
    assert before > 0.01
    assert after < 0.5 * before


def test_the_rest_pose_stays_as_it_is(garment: Rig, resolved: tuple[Rig, PassReport]) -> None:
    np.testing.assert_allclose(resolved[0].posed(np.zeros((24, 3))), garment.template, atol=1e-6)


def stretch(rig: Rig, poses: np.ndarray) -> float:
    """Mean change of edge length, millimetres."""
    pairs = edges(rig.triangles)
    rest = edge_lengths(rig.template, pairs)
    return float(np.mean([edge_mm(vertices, rest, pairs) for vertices in rig.posed(poses)]))


def test_coming_out_of_the_body_stretches_next_to_nothing(garment: Rig, resolved: tuple[Rig, PassReport]) -> None:
    poses = POSES.check[:24]
    assert stretch(resolved[0], poses) < stretch(garment, poses) + 0.05


def test_a_shin_that_sinks_in_as_a_whole_comes_out_as_a_whole(garment: Rig) -> None:
    """A leg that hardly bends at the knee. Pushing each vertex by itself costs 0.3 mm."""
    weights = garment.weights.copy()
    weights[:, JOINT_NAMES.index("left_hip")] += 0.4 * weights[:, JOINT_NAMES.index("left_knee")]
    weights[:, JOINT_NAMES.index("left_knee")] *= 0.6
    lazy = replace(garment, weights=weights)
    rig, _ = resolve(lazy)
    poses = POSES.check[:8]
    before = collided(lazy, poses)
    assert before > 0.03
    assert collided(rig, poses) < 0.3 * before
    assert stretch(rig, poses) < stretch(lazy, poses) + 0.26


def test_skin_does_not_bulge_out_between_the_vertices_of_coarse_cloth() -> None:
    coarse, poses = trousers(gap=0.003), POSES.check[:16]

    def poked(bulge: float) -> float:
        """The share of triangles whose middle is inside the body."""
        rig, _ = resolve(coarse, bulge=bulge, clearance=0.002)
        middles = rig.posed(poses)[:, rig.triangles].mean(axis=2)
        skins = BODY.posed(poses)
        return float(np.mean([signed_distance(m, b, BODY.faces) < 0 for m, b in zip(middles, skins, strict=True)]))

    assert poked(BULGE) < 0.8 * poked(0)


def test_edges_come_back_to_their_lengths_in_unseen_poses() -> None:
    """Loose cloth, which has little to do with the body."""
    loose, poses = trousers(gap=0.02), POSES.check[:24]
    rig, _ = resolve(loose)
    assert stretch(rig, poses) < 0.95 * stretch(loose, poses)


def test_a_lace_does_not_run_wild() -> None:
    """Vertices in a row are the worst case for rounds that overshoot."""
    rng = np.random.default_rng(7)
    count = 60
    lace = np.column_stack([0.001 * (np.arange(count) % 2), np.linspace(0, -0.6, count), np.full(count, 3.0)])
    triangles = (np.arange(count - 2)[:, None] + np.arange(3)).astype(np.int32)
    weights = rng.dirichlet(np.full(3, 5.0), count) @ np.eye(24)[[1, 4, 7]]
    whole = trousers()
    rig = replace(
        whole,
        template=lace,
        triangles=triangles,
        weights=weights.astype(np.float32),
        blend_shapes=np.zeros((whole.morph_count, count, 3), np.float32),
    )
    poses = POSES.fit[:24]
    relaxed = [resolve(rig, replace(SETTINGS, settling=(rounds,), ridge=0.01))[0] for rounds in (20, 200)]
    assert stretch(relaxed[0], poses) < stretch(rig, poses)
    assert stretch(relaxed[1], poses) < stretch(rig, poses)


def test_cloth_is_not_crumpled(garment: Rig, resolved: tuple[Rig, PassReport]) -> None:
    pairs, poses = edges(garment.triangles), POSES.check[:12]
    before, after = (
        np.mean([bend(vertices, rig.triangles, pairs) for vertices in rig.posed(poses)])
        for rig in (garment, resolved[0])
    )
    assert after < 1.25 * before


def test_only_shapes_change(garment: Rig, resolved: tuple[Rig, PassReport]) -> None:
    rig = resolved[0]
    assert rig.template is garment.template
    assert rig.weights is garment.weights
    assert rig.keys is garment.keys
    assert rig.blend_shapes.shape == garment.blend_shapes.shape
    assert rig.blend_shapes.dtype == np.float32
    assert not garment.blend_shapes.any()


def test_what_is_far_from_the_body_and_moves_as_one_is_left_alone(garment: Rig) -> None:
    weights = np.zeros_like(garment.weights)
    weights[:, 0] = 1
    far = replace(garment, template=garment.template + np.array([0, 0, 3.0]), weights=weights)
    rig, _ = resolve(far, ResolveCollisions(poses=8))
    assert np.abs(rig.blend_shapes).max() < 1e-4


def test_few_anchors_move_the_vertices_between_them(garment: Rig) -> None:
    poses = POSES.check[:12]
    rig, _ = resolve(garment, anchors=400)
    assert garment.vertex_count > 1000
    assert collided(rig, poses) < 0.6 * collided(garment, poses)


def test_the_same_twice(garment: Rig, resolved: tuple[Rig, PassReport]) -> None:
    again, report = resolve(garment)
    np.testing.assert_array_equal(again.blend_shapes, resolved[0].blend_shapes)
    assert report == resolved[1]


def test_a_body_of_another_shape(garment: Rig) -> None:
    """Trousers cut for a thinner body: they are inside everywhere, and come out."""
    betas = np.array([0.0, 1.0])
    tight = replace(garment, joints=BODY.joints(betas))
    rig, _ = resolve(tight, ResolveCollisions(poses=24), betas)
    assert np.abs(rig.blend_shapes).max() > 1e-4


def test_a_rig_without_blend_shapes_cannot_be_helped() -> None:
    bare = make_rig(morphs=0, normals=False)
    rig, report = resolve(bare)
    assert rig is bare
    assert report.error is None


def test_keys_that_never_move_cannot_help(garment: Rig) -> None:
    """A bundle of blend weights alone has one such key."""
    still = KeyNetwork((DenseLayer(np.zeros((1, 72), np.float32), np.zeros(1, np.float32), "linear"),))
    shape = np.zeros_like(garment.blend_shapes[:1])
    rig = Rig(garment.template, garment.triangles, garment.joints, garment.weights, shape, still)
    unchanged, report = resolve(rig)
    assert unchanged is rig
    assert "no pose keys" in report.detail
