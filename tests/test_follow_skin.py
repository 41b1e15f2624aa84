"""Cloth on the skin takes the skin's weights where that keeps it out of the body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from worn import BODY, collided, trousers

from garmentc.evaluation.metrics import signed_distance
from garmentc.passes.follow_skin import FollowSkin, follow_skin
from garmentc.passes.pose_set import plausible_poses
from garmentc.passes.report import PassReport
from garmentc.rig import Rig
from garmentc.smpl.skeleton import JOINT_NAMES

POSES = plausible_poses(fit=256, check=48)
LEFT_KNEE, RIGHT_KNEE = JOINT_NAMES.index("left_knee"), JOINT_NAMES.index("right_knee")


@pytest.fixture(scope="module")
def lazy() -> Rig:
    """Trousers whose left leg hardly bends at the knee: the shin breaks through. The right leg is as it should be."""
    rig = trousers()
    weights = rig.weights.copy()
    weights[:, JOINT_NAMES.index("left_hip")] += 0.7 * weights[:, LEFT_KNEE]
    weights[:, LEFT_KNEE] *= 0.3
    return replace(rig, weights=weights)


@pytest.fixture(scope="module")
def followed(lazy: Rig) -> tuple[Rig, PassReport]:
    return follow_skin(lazy, FollowSkin(), POSES, BODY)


def test_the_shin_no_longer_breaks_through(lazy: Rig, followed: tuple[Rig, PassReport]) -> None:
    poses = POSES.check[:16]
    as_it_should_be = collided(trousers(), poses)
    before, after = collided(lazy, poses) - as_it_should_be, collided(followed[0], poses) - as_it_should_be
    assert before > 0.03
    assert after < 0.3 * before


def test_what_was_right_is_left_alone(lazy: Rig, followed: tuple[Rig, PassReport]) -> None:
    right_leg = lazy.weights[:, RIGHT_KNEE] > 0.5
    assert right_leg.sum() > 100
    np.testing.assert_allclose(followed[0].weights[right_leg], lazy.weights[right_leg], atol=0.02)


def test_rows_sum_to_one_and_nothing_else_changes(lazy: Rig, followed: tuple[Rig, PassReport]) -> None:
    rig, report = followed
    np.testing.assert_allclose(rig.weights.sum(axis=1), 1, atol=1e-5)
    assert rig.weights.dtype == np.float32
    assert rig.blend_shapes is lazy.blend_shapes
    assert rig.template is lazy.template
    assert "% of the cloth follows" in report.detail


def test_what_the_skin_would_hardly_mend_keeps_its_own_weights(lazy: Rig) -> None:
    """Legs modelled 1 cm too thin are in the body with any weights: the network's do as well as the skin's."""
    thin = replace(trousers(gap=-0.01), weights=lazy.weights)
    eager, _ = follow_skin(thin, FollowSkin(mended=(0, 0.01)), POSES, BODY)
    rig, _ = follow_skin(thin, FollowSkin(), POSES, BODY)
    left_shin = trousers().weights[:, LEFT_KNEE] > 0.9
    assert np.abs(eager.weights - thin.weights)[left_shin].max(axis=1).mean() > 0.1
    assert np.abs(rig.weights - thin.weights)[left_shin].max(axis=1).mean() < 0.01


def test_what_clings_to_the_skin_takes_its_weights_whatever_they_save() -> None:
    """A sock, half bound to the pelvis, where nothing that the skin's weights could save is enough."""
    sock = trousers(gap=0.0005)
    pelvis = np.zeros_like(sock.weights)
    pelvis[:, 0] = 1
    wrong = replace(sock, weights=0.5 * sock.weights + 0.5 * pelvis)
    never = FollowSkin(saved=np.inf)
    rig, _ = follow_skin(wrong, never, POSES, BODY)
    np.testing.assert_allclose(rig.weights, sock.weights, atol=0.05)
    farther, _ = follow_skin(replace(wrong, template=trousers(gap=0.01).template), never, POSES, BODY)
    kept = np.abs(farther.weights - wrong.weights).max(axis=1) < 0.01
    assert kept.mean() > 0.97  # all but where the legs touch


def test_loose_cloth_keeps_its_own_weights(lazy: Rig) -> None:
    """A gown 15 cm from the skin must not be glued to a leg."""
    loose = replace(trousers(gap=0.15), weights=lazy.weights)
    rig, _ = follow_skin(loose, FollowSkin(poses=8), POSES, BODY)
    far = signed_distance(loose.template, BODY.shaped(), BODY.faces) > 0.1  # elsewhere it is in the other leg
    assert far.mean() > 0.5
    np.testing.assert_allclose(rig.weights[far], loose.weights[far], atol=1e-3)


def test_few_anchors_speak_for_the_vertices_between_them(lazy: Rig) -> None:
    rig, _ = follow_skin(lazy, FollowSkin(anchors=400), POSES, BODY)
    poses = POSES.check[:8]
    assert lazy.vertex_count > 1000
    assert collided(rig, poses) < 0.6 * collided(lazy, poses)


def test_the_same_twice(lazy: Rig, followed: tuple[Rig, PassReport]) -> None:
    again, report = follow_skin(lazy, FollowSkin(), POSES, BODY)
    np.testing.assert_array_equal(again.weights, followed[0].weights)
    assert report == followed[1]
