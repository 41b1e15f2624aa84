"""A shirt's tails stay beneath the skirt that they are tucked into."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_samples import make_keys
from worn import BODY, JOINTS, PELVIS, SHOULDER, skirt, tube

from garmentc.families.held_cloth import held_cloth
from garmentc.outfit.topology import edges
from garmentc.passes.keep_tucked import KeepTucked, keep_tucked
from garmentc.passes.pose_set import plausible_poses
from garmentc.rig import Rig
from garmentc.smpl.nearest import nearest_body_weights, signed_distance

POSES = plausible_poses(fit=64, check=24)


def worn(radius: float, seed: int = 0) -> tuple[Rig, np.ndarray]:
    """A skirt and a shirt of this radius that reaches 20 cm below its waistband, and which vertices are the shirt's.

    The blend shapes of both are noise, smooth along the garments, and have nothing to do with one another.
    """
    (vertices, triangles), (shirt, faces) = skirt(), tube(PELVIS, SHOULDER + 0.05, 0.7, radius)
    points, count = np.concatenate([vertices, shirt]), len(vertices)
    rng = np.random.default_rng(seed)
    shapes = [0.2 * np.sin(points @ rng.normal(size=(3, 3)) * 5 + rng.uniform(0, 6, 3)) for _ in range(8)]
    shapes = np.array([np.where(np.arange(len(points))[:, None] < count, shape, -shape) for shape in shapes])
    return Rig(
        template=points,
        triangles=np.concatenate([triangles, faces + count]).astype(np.int32),
        joints=JOINTS,
        weights=nearest_body_weights(points, BODY.shaped(), BODY).astype(np.float32),
        blend_shapes=shapes.astype(np.float32),
        keys=make_keys(8, rng),
    ), np.arange(len(points)) >= count


def held(rig: Rig) -> np.ndarray:
    return held_cloth(rig.template, edges(rig.triangles), BODY).held > 0


def come_through(rig: Rig, shirt: np.ndarray) -> float:
    """The share of the shirt's vertices, of those well below the waistband, that are on the skirt's outer side."""
    tails = shirt & (rig.template[:, 1] < PELVIS[1] + 0.08) & (rig.template[:, 1] > PELVIS[1] - 0.1)
    lid = rig.triangles[~shirt[rig.triangles].any(axis=1)]
    at_rest = np.sign(signed_distance(rig.template[tails], rig.template, lid))
    assert abs(at_rest.sum()) == tails.sum(), "all on one side at rest"
    sides = [np.sign(signed_distance(posed[tails], posed, lid)) for posed in rig.posed(POSES.check)]
    return float(np.mean(np.array(sides) != at_rest))


def test_tails_come_through_before_and_not_after() -> None:
    rig, shirt = worn(0.19)
    kept, report = keep_tucked(rig, KeepTucked(), POSES, held(rig), BODY)
    assert come_through(rig, shirt) > 0.1
    assert come_through(kept, shirt) < 0.015  # where this skirt, which is all noise, passes through itself
    assert "move with the cloth that covers them" in report.detail


def test_the_skirt_and_the_shirt_above_it_stay_as_they_are() -> None:
    rig, shirt = worn(0.19)
    kept, _ = keep_tucked(rig, KeepTucked(), POSES, held(rig), BODY)
    changed = (kept.weights != rig.weights).any(axis=1) | (kept.blend_shapes != rig.blend_shapes).any(axis=(0, 2))
    assert changed[shirt].any()
    assert not changed[~shirt].any()
    assert not changed[rig.template[:, 1] > PELVIS[1] + 0.11].any()
    np.testing.assert_allclose(kept.weights.sum(axis=1), 1, atol=1e-5)
    assert (np.count_nonzero(kept.weights, axis=1) <= 4)[changed].all()
    assert kept.template is rig.template


@pytest.mark.parametrize("radius", [0.215, 0.16])
def test_what_is_over_the_skirt_or_far_beneath_it_moves_by_itself(radius: float) -> None:
    rig, _ = worn(radius)
    kept, report = keep_tucked(rig, KeepTucked(), POSES, held(rig), BODY)
    assert kept is rig
    assert report.detail == "nothing is tucked into held cloth"


def test_a_single_garment_is_no_layer() -> None:
    rig, shirt = worn(0.19)
    alone = replace(
        rig,
        template=rig.template[~shirt],
        triangles=rig.triangles[~shirt[rig.triangles].any(axis=1)],
        weights=rig.weights[~shirt],
        blend_shapes=rig.blend_shapes[:, ~shirt],
    )
    kept, report = keep_tucked(alone, KeepTucked(), POSES, held(alone), BODY)
    assert kept is alone
    assert report.detail == "nothing is tucked into held cloth"
