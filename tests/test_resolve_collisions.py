"""Pushing an outfit out of its body, judged on poses the pass has not seen, with exact distances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_samples import make_rig
from worn import BODY, collided, trousers

from garmentc.evaluation.metrics import edge_lengths, edge_mm
from garmentc.outfit.topology import edges
from garmentc.passes.pose_set import PoseSet, plausible_poses
from garmentc.passes.report import PassReport
from garmentc.passes.resolve_collisions import ResolveCollisions, resolve_collisions
from garmentc.rig import Rig

POSES = plausible_poses(fit=512, check=64)
SETTINGS = ResolveCollisions(poses=128, iterations=8)  # the sample network is untrained: it needs more to go by


@pytest.fixture(scope="module")
def garment() -> Rig:
    return trousers()


@pytest.fixture(scope="module")
def resolved(garment: Rig) -> tuple[Rig, PassReport]:
    return resolve_collisions(garment, SETTINGS, POSES, BODY)


def test_collisions_at_least_halve_in_unseen_poses(garment: Rig, resolved: tuple[Rig, PassReport]) -> None:
    poses = POSES.check[:24]
    before, after = collided(garment, poses), collided(resolved[0], poses)
    assert before > 0.01
    assert after < 0.5 * before


def test_the_rest_pose_stays_as_it_is(garment: Rig, resolved: tuple[Rig, PassReport]) -> None:
    np.testing.assert_allclose(resolved[0].posed(np.zeros((24, 3))), garment.template, atol=1e-6)


def test_the_cloth_stays_smooth(garment: Rig, resolved: tuple[Rig, PassReport]) -> None:
    pairs = edges(garment.triangles)
    rest = edge_lengths(garment.template, pairs)
    before, after = (
        np.mean([edge_mm(vertices, rest, pairs) for vertices in rig.posed(POSES.check[:12])])
        for rig in (garment, resolved[0])
    )
    assert after < before + 0.4


def test_only_shapes_change(garment: Rig, resolved: tuple[Rig, PassReport]) -> None:
    rig = resolved[0]
    assert rig.template is garment.template
    assert rig.weights is garment.weights
    assert rig.keys is garment.keys
    assert rig.blend_shapes.shape == garment.blend_shapes.shape
    assert rig.blend_shapes.dtype == np.float32
    assert not garment.blend_shapes.any()


def test_what_is_far_from_the_body_is_left_alone(garment: Rig) -> None:
    far = replace(garment, template=garment.template + np.array([0, 0, 3.0]))
    rig, _ = resolve_collisions(far, ResolveCollisions(poses=8), POSES, BODY)
    assert not rig.blend_shapes.any()


def test_few_anchors_move_the_vertices_between_them(garment: Rig) -> None:
    poses = POSES.check[:12]
    rig, _ = resolve_collisions(garment, replace(SETTINGS, anchors=400), POSES, BODY)
    assert garment.vertex_count > 1000
    assert collided(rig, poses) < 0.6 * collided(garment, poses)


def test_the_same_twice(garment: Rig, resolved: tuple[Rig, PassReport]) -> None:
    again, report = resolve_collisions(garment, SETTINGS, POSES, BODY)
    np.testing.assert_array_equal(again.blend_shapes, resolved[0].blend_shapes)
    assert report == resolved[1]


def test_a_body_of_another_shape(garment: Rig) -> None:
    """Trousers cut for a thinner body: they are inside everywhere, and come out."""
    betas = np.array([0.0, 1.0])
    tight = replace(garment, joints=BODY.joints(betas))
    rig, _ = resolve_collisions(tight, ResolveCollisions(poses=24), POSES, BODY, betas)
    assert np.abs(rig.blend_shapes).max() > 1e-4


def test_a_rig_without_blend_shapes_cannot_be_helped() -> None:
    bare = make_rig(morphs=0, normals=False)
    rig, report = resolve_collisions(bare, ResolveCollisions(), PoseSet(POSES.fit[:4], POSES.check[:4]), BODY)
    assert rig is bare
    assert report.error is None
