"""Pushing an outfit out of its body, judged on poses the pass has not seen, with exact distances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_samples import make_keys, make_rig

from garmentc.evaluation.baselines import nearest_skinning
from garmentc.evaluation.metrics import edge_lengths, edge_mm, signed_distance
from garmentc.outfit.topology import edges, vertex_normals
from garmentc.passes.pose_set import PoseSet, plausible_poses
from garmentc.passes.report import PassReport
from garmentc.passes.resolve_collisions import ResolveCollisions, resolve_collisions
from garmentc.rig import Rig
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.skeleton import JOINT_NAMES

BODY = load_default_body("male")
POSES = plausible_poses(fit=512, check=64)


@pytest.fixture(scope="module")
def trousers() -> Rig:
    """The skin of the legs, 4 mm farther out, with the nearest weights and blend shapes that do nothing yet."""
    skin = BODY.shaped()
    legs = [JOINT_NAMES.index(name) for name in ("pelvis", "left_hip", "right_hip", "left_knee", "right_knee")]
    kept = BODY.weights[:, legs].sum(axis=1) > 0.5
    number = np.cumsum(kept) - 1
    triangles = number[BODY.faces[kept[BODY.faces].all(axis=1)]].astype(np.int32)
    used = np.unique(triangles)
    triangles = np.searchsorted(used, triangles).astype(np.int32)
    template = (skin + 0.004 * vertex_normals(skin, BODY.faces))[kept][used]
    rig = nearest_skinning(template, triangles, BODY)
    keys = make_keys(48, np.random.default_rng(5))
    return replace(rig, blend_shapes=np.zeros((48, len(template), 3), np.float32), keys=keys)


def collided(rig: Rig, poses: np.ndarray) -> float:
    skins, posed = BODY.posed(poses), rig.posed(poses)
    return float(np.mean([signed_distance(p, s, BODY.faces) < 0 for p, s in zip(posed, skins, strict=True)]))


@pytest.fixture(scope="module")
def resolved(trousers: Rig) -> tuple[Rig, PassReport]:
    return resolve_collisions(trousers, ResolveCollisions(), POSES, BODY)


def test_collisions_at_least_halve_in_unseen_poses(trousers: Rig, resolved: tuple[Rig, PassReport]) -> None:
    poses = POSES.check[:24]
    before, after = collided(trousers, poses), collided(resolved[0], poses)
    assert before > 0.01
    assert after < 0.5 * before


def test_the_rest_pose_stays_as_it_is(trousers: Rig, resolved: tuple[Rig, PassReport]) -> None:
    np.testing.assert_allclose(resolved[0].posed(np.zeros((24, 3))), trousers.template, atol=1e-6)


def test_the_cloth_stays_smooth(trousers: Rig, resolved: tuple[Rig, PassReport]) -> None:
    pairs = edges(trousers.triangles)
    rest = edge_lengths(trousers.template, pairs)
    before, after = (
        np.mean([edge_mm(vertices, rest, pairs) for vertices in rig.posed(POSES.check[:12])])
        for rig in (trousers, resolved[0])
    )
    assert after < before + 0.4


def test_only_shapes_change(trousers: Rig, resolved: tuple[Rig, PassReport]) -> None:
    rig = resolved[0]
    assert rig.template is trousers.template
    assert rig.weights is trousers.weights
    assert rig.keys is trousers.keys
    assert rig.blend_shapes.shape == trousers.blend_shapes.shape
    assert rig.blend_shapes.dtype == np.float32
    assert not trousers.blend_shapes.any()


def test_what_is_far_from_the_body_is_left_alone(trousers: Rig) -> None:
    far = replace(trousers, template=trousers.template + np.array([0, 0, 3.0]))
    rig, _ = resolve_collisions(far, ResolveCollisions(poses=8), POSES, BODY)
    assert not rig.blend_shapes.any()


def test_few_anchors_move_the_vertices_between_them(trousers: Rig) -> None:
    poses = POSES.check[:12]
    rig, _ = resolve_collisions(trousers, ResolveCollisions(anchors=400), POSES, BODY)
    assert trousers.vertex_count > 1000
    assert collided(rig, poses) < 0.6 * collided(trousers, poses)


def test_the_same_twice(trousers: Rig, resolved: tuple[Rig, PassReport]) -> None:
    again, report = resolve_collisions(trousers, ResolveCollisions(), POSES, BODY)
    np.testing.assert_array_equal(again.blend_shapes, resolved[0].blend_shapes)
    assert report == resolved[1]


def test_a_body_of_another_shape(trousers: Rig) -> None:
    """Trousers cut for a thinner body: they are inside everywhere, and come out."""
    betas = np.array([0.0, 1.0])
    tight = replace(trousers, joints=BODY.joints(betas))
    rig, _ = resolve_collisions(tight, ResolveCollisions(poses=24), POSES, BODY, betas)
    assert np.abs(rig.blend_shapes).max() > 1e-4


def test_a_rig_without_blend_shapes_cannot_be_helped() -> None:
    bare = make_rig(morphs=0, normals=False)
    rig, report = resolve_collisions(bare, ResolveCollisions(), PoseSet(POSES.fit[:4], POSES.check[:4]), BODY)
    assert rig is bare
    assert report.error is None
