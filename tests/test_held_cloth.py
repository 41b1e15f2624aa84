"""What the body holds up by an upper rim, on garments cut as surfaces of revolution round the default body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_samples import make_rig
from worn import BODY, JOINTS, PELVIS, SHOULDER, skirt, tube

from garmentc.families.held_cloth import held_cloth, hold_beneath
from garmentc.outfit.topology import edges
from garmentc.smpl.nearest import surface_body_weights
from garmentc.smpl.skeleton import JOINT_NAMES

KNEE, WRIST = (JOINTS[JOINT_NAMES.index(name)] for name in ("left_knee", "left_wrist"))


@pytest.mark.parametrize("tilt", [0, 0.2])
@pytest.mark.parametrize("around", [16, 48])
def test_a_skirt_hangs_on_its_waistband(tilt: float, around: int) -> None:
    vertices, triangles = skirt(tilt=tilt, around=around)
    cloth = held_cloth(vertices, edges(triangles), BODY)
    assert (cloth.held == 1).all()
    assert cloth.firmness[:around].min() > 0.85  # the rim itself
    ring = cloth.firmness.reshape(12, around)
    assert (np.diff(ring, axis=0) < 1e-6).all()
    assert ring[6:].max() < 0.01
    np.testing.assert_allclose(cloth.skin, surface_body_weights(vertices, BODY.shaped(), BODY), atol=1e-6)


def test_a_slit_or_a_fly_changes_nothing_but_half_a_skirt_is_not_held() -> None:
    for span, held in ((1.8 * np.pi, True), (np.pi, False)):
        vertices, triangles = skirt(span=span)
        assert held_cloth(vertices, edges(triangles), BODY).held.any() == held


def test_what_goes_over_the_shoulders_hangs_on_them() -> None:
    for top, held in ((SHOULDER + 0.02, False), (SHOULDER - 0.1, True)):
        vertices, triangles = tube(PELVIS, top, 0.6, 0.22)
        assert held_cloth(vertices, edges(triangles), BODY).held.any() == held


def test_a_sock_is_held_and_a_button_and_a_sleeve_are_not() -> None:
    sock = tube(KNEE, KNEE[1] - 0.1, 0.2, 0.07)
    button = tube(PELVIS + np.array([0, 0, 0.25]), PELVIS[1], 0.01, 0.01)
    vertices, triangles = tube(np.zeros(3), 0, 0.2, 0.06)
    sleeve = vertices[:, [1, 0, 2]] + WRIST, triangles
    for (points, faces), held in ((sock, True), (button, False), (sleeve, False)):
        assert held_cloth(points, edges(faces), BODY).held.any() == held


def test_every_garment_of_an_outfit_is_judged_by_itself_in_any_order() -> None:
    vertices, triangles = skirt()
    top, faces = tube(PELVIS, SHOULDER + 0.05, 0.5, 0.22)
    points, joined = np.concatenate([vertices, top]), edges(np.concatenate([triangles, faces + len(vertices)]))
    cloth = held_cloth(points, joined, BODY)
    assert (cloth.held[: len(vertices)] == 1).all()
    assert not cloth.firmness[len(vertices) :].any()
    order = np.random.default_rng(0).permutation(len(points))
    shuffled = held_cloth(points[order], np.argsort(order)[joined], BODY)
    np.testing.assert_allclose(shuffled.firmness, cloth.firmness[order], atol=1e-7)


def test_a_shirt_that_is_tucked_in_is_held_with_the_waistband_and_one_over_it_is_not() -> None:
    vertices, triangles = skirt()
    still = make_rig()
    for radius, tucked in ((0.19, True), (0.215, False)):
        top, faces = tube(PELVIS, SHOULDER + 0.05, 0.7, radius)
        points, both = np.concatenate([vertices, top]), np.concatenate([triangles, faces + len(vertices)])
        rig = replace(
            still,
            template=points,
            triangles=both.astype(np.int32),
            joints=JOINTS,
            weights=np.tile(np.eye(24, dtype=np.float32)[0], (len(points), 1)),
            blend_shapes=np.ones((still.morph_count, len(points), 3), np.float32),
            blend_normals=None,
        )
        cloth = held_cloth(points, edges(both), BODY)
        found = hold_beneath(rig, cloth, BODY)
        changed = np.flatnonzero((found.blend_shapes != 1).any(axis=(0, 2)))
        assert (len(changed) > 0) == tucked
        assert (changed >= len(vertices)).all(), "only the shirt"
        assert (np.abs(points[changed, 1] - PELVIS[1]) < 0.15).all(), "only near the waistband"
        np.testing.assert_allclose(found.weights.sum(axis=1), 1, atol=1e-5)


def test_nothing_is_held_of_nothing() -> None:
    cloth = held_cloth(np.zeros((0, 3)), np.zeros((0, 2), int), BODY)
    assert cloth.skin.shape == (0, 24)
