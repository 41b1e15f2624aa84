"""A-poses: found by fitting the body into the outfit, and undone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from align_samples import SHIRT, SUIT, a_pose, cut, flared_skirt, worn_in
from test_align import in_file

from garmentc.outfit.align import AlignOptions, align
from garmentc.outfit.align.unpose import unpose
from garmentc.outfit.topology import edges, triangle_normals, vertex_normals
from garmentc.smpl import load_default_body
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skinning import joint_transforms, skin

POSES = {
    "shoulders": a_pose(0.8),
    "arms down": a_pose(1.15, hip=0.05),
    "collars and elbows": a_pose(0.5, collar=0.3, elbow=0.6, hip=0.03),
    "slight": a_pose(0.35),
}


@pytest.mark.parametrize("name", POSES)
@pytest.mark.parametrize("parts", [SUIT, SHIRT], ids=["suit", "shirt"])
def test_a_poses_are_found_and_undone(name: str, parts: tuple[str, ...]) -> None:
    body, pose = load_default_body("female"), POSES[name]
    outfit, weights = cut(body, parts)
    worn = worn_in(outfit, weights, body, pose)
    place = np.array([0.0, body.posed(pose)[:, 1].min(), 0.0])
    file = replace(worn, vertices=in_file(worn.vertices, "cm", "z", "-y", place))
    found = align(file, load_default_body)

    assert (found.frame.unit, found.frame.up, found.rest_pose, found.gender) == ("cm", "z", "A", "female")
    joints = body.joints()
    lowered = np.degrees(-(pose[13, 2] + pose[16, 2]))
    assert found.arms == pytest.approx(lowered, abs=4)
    error = np.linalg.norm(found.outfit.vertices - outfit.vertices, axis=1)
    assert error.mean() < 0.006
    assert np.percentile(error, 95) < 0.02
    turned = triangle_normals(found.outfit.vertices, outfit.tri_v) * triangle_normals(outfit.vertices, outfit.tri_v)
    assert (turned.sum(axis=1) < 0).mean() < 0.002  # hardly a triangle is folded over
    assert found.unpose_weights is not None
    # What was undone can be done again: the weights and the pose are those reported.
    transforms = joint_transforms(axis_angle_to_matrix(found.pose), joints)
    again = skin(found.outfit.vertices, found.unpose_weights, transforms)
    np.testing.assert_allclose(again, found.frame.apply(file.vertices), atol=1e-10)


@pytest.mark.parametrize("gender", ["female", "male", "neutral"])
def test_a_pose_in_the_bodys_own_frame(gender: str) -> None:
    body = load_default_body(gender)
    outfit, weights = cut(body, SUIT)
    file = worn_in(outfit, weights, body, a_pose(0.8))
    found = align(file, load_default_body)
    assert (found.frame.is_identity, found.rest_pose, found.gender) == (True, "A", gender)
    assert found.warnings == ()


def test_straight_outfits_are_left_straight_where_an_a_pose_is_asked_for() -> None:
    outfit, _ = cut(load_default_body("male"), SUIT)
    found = align(outfit, load_default_body, AlignOptions(pose="a"))
    assert found.rest_pose == "A"
    assert found.arms == pytest.approx(0, abs=3)
    assert np.linalg.norm(found.outfit.vertices - outfit.vertices, axis=1).mean() < 0.005


def test_a_t_pose_that_is_said_is_not_undone() -> None:
    body = load_default_body("female")
    outfit, weights = cut(body, SUIT)
    file = worn_in(outfit, weights, body, a_pose(0.8))
    found = align(file, load_default_body, AlignOptions(pose="t", gender="female", origin="keep"))
    assert (found.rest_pose, found.outfit.vertices is file.vertices) == ("T", True)


def test_a_given_pose_is_undone_exactly() -> None:
    body = load_default_body("female")
    pose = a_pose(0.6, elbow=0.3)
    pose[[13, 16, 18]] *= 1.2  # lopsided
    outfit, weights = cut(body, SUIT, gap=0.002)
    file = worn_in(outfit, weights, body, pose)
    found = align(file, load_default_body, AlignOptions(pose=pose))
    assert (found.rest_pose, found.frame.is_identity, found.gender) == ("given", True, "female")
    np.testing.assert_array_equal(found.pose, pose)
    error = np.linalg.norm(found.outfit.vertices - outfit.vertices, axis=1)
    assert np.median(error) < 1e-3
    assert np.percentile(error, 95) < 0.006


@pytest.mark.parametrize("hem", [0.25, 0.4])
def test_skirts_do_not_spread_the_legs(hem: float) -> None:
    """A skirt touches each leg from one side only; it says nothing about their angle."""
    skirt = flared_skirt(load_default_body("neutral"), hem)
    found = align(skirt, load_default_body, AlignOptions(gender="neutral"))
    assert (found.rest_pose, found.outfit.vertices is skirt.vertices) == ("T", True)


def test_unposing_does_not_tear_the_armpits() -> None:
    body = load_default_body("female")
    outfit, weights = cut(body, SUIT, gap=0.02)
    pose = a_pose(1.1)
    straight, _ = unpose(worn_in(outfit, weights, body, pose), body, pose)
    pairs = edges(outfit.tri_v)

    def lengths(vertices: np.ndarray) -> np.ndarray:
        return np.linalg.norm(vertices[pairs[:, 0]] - vertices[pairs[:, 1]], axis=1)

    stretched = lengths(straight.vertices) - lengths(outfit.vertices)
    assert stretched.max() < 0.03
    assert np.abs(stretched).mean() < 0.001


def test_seams_stay_closed_and_loose_vertices_go_along() -> None:
    body = load_default_body("female")
    outfit, weights = cut(body, SHIRT)
    pose = a_pose(0.9)
    worn = worn_in(outfit, weights, body, pose)
    corner = np.arange(3 * len(worn.tri_v), dtype=np.int32).reshape(-1, 3)  # every triangle on its own
    torn = replace(worn, vertices=np.concatenate([worn.vertices[worn.tri_v.ravel()], worn.vertices[:1]]), tri_v=corner)
    whole, _ = unpose(worn, body, pose)
    parts, part_weights = unpose(torn, body, pose)
    np.testing.assert_allclose(parts.vertices[:-1], whole.vertices[worn.tri_v.ravel()], atol=1e-9)
    np.testing.assert_allclose(part_weights.sum(axis=1), 1, atol=1e-6)
    assert np.isfinite(parts.vertices).all()


def test_normals_are_unposed_with_the_surface() -> None:
    body = load_default_body("female")
    outfit, weights = cut(body, SUIT)
    pose = a_pose(0.9)
    worn = worn_in(outfit, weights, body, pose)
    worn = replace(worn, normals=vertex_normals(worn.vertices, worn.tri_v))
    straight, _ = unpose(worn, body, pose)
    per_vertex = np.zeros_like(straight.vertices)
    per_vertex[straight.tri_v] = straight.normals[straight.tri_vn]
    cosine = (per_vertex * vertex_normals(straight.vertices, straight.tri_v)).sum(axis=1)
    assert np.median(cosine) > 0.999
    assert np.percentile(cosine, 2) > 0.85  # armpits
    np.testing.assert_allclose(np.linalg.norm(straight.normals, axis=1), 1)

    # One normal that many vertices share turns differently at each of them.
    shared = replace(worn, normals=np.array([[0.0, 1.0, 0.0]]), tri_vn=np.zeros_like(worn.tri_v))
    split, _ = unpose(shared, body, pose)
    assert len(split.normals) == len(np.unique(worn.tri_v))
    assert np.ptp(split.normals, axis=0).max() > 0.3


def test_the_same_twice() -> None:
    body = load_default_body("female")
    outfit, weights = cut(body, SUIT)
    file = worn_in(outfit, weights, body, a_pose(0.7))
    one, two = align(file, load_default_body), align(file, load_default_body)
    assert one.outfit.vertices.tobytes() == two.outfit.vertices.tobytes()
    assert one.pose.tobytes() == two.pose.tobytes()
