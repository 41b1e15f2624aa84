"""Metrics against closed forms and formulas of their own."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from garmentc.evaluation.clean_frames import CleanFrames, clean_frames, touching_share
from garmentc.evaluation.metrics import bend, edge_lengths, edge_mm, euclidean_mm, inside, signed_distance
from garmentc.outfit.topology import edges
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.skeleton import JOINT_NAMES


def sphere(radius: float, subdivisions: int = 4) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)


def test_signed_distance_to_a_sphere() -> None:
    """The distance to a sphere of radius R is |x| - R, less at most the sagitta of its facets."""
    ball = sphere(0.5)
    points = np.random.default_rng(0).normal(size=(2000, 3)) * 0.35
    distance = signed_distance(points, ball.vertices, ball.faces)
    sagitta = 0.5 - np.abs(np.einsum("ij,ij->i", ball.triangles_center, ball.face_normals)).min()
    exact = np.linalg.norm(points, axis=1) - 0.5
    assert (distance >= exact - 1e-12).all()
    assert (distance <= exact + sagitta + 1e-12).all()


def test_signed_distance_inside_a_convex_polyhedron_is_that_to_its_nearest_plane() -> None:
    ball = sphere(0.5, subdivisions=2)
    points = np.random.default_rng(1).uniform(-0.25, 0.25, (300, 3))
    offsets = np.einsum("ij,ij->i", ball.face_normals, ball.triangles_center)
    planes = points @ ball.face_normals.T - offsets
    np.testing.assert_allclose(signed_distance(points, ball.vertices, ball.faces), planes.max(axis=1), atol=1e-12)


def test_a_garment_half_sunk_into_a_ball() -> None:
    ball, cloth = sphere(0.5), sphere(0.4)
    moved = cloth.vertices + np.array([0.3, 0, 0])
    depth = signed_distance(moved, ball.vertices, ball.faces)
    expected = np.linalg.norm(moved, axis=1) < 0.5
    clear = np.abs(np.linalg.norm(moved, axis=1) - 0.5) > 1e-3
    np.testing.assert_array_equal((depth < 0)[clear], expected[clear])
    assert 0.2 < (depth < 0).mean() < 0.8


def test_points_in_two_overlapping_parts_are_inside() -> None:
    """Two balls as one surface, as a posed body's arm and trunk. The pseudonormal sign gets this wrong."""
    import igl

    ball = sphere(0.5)
    vertices = np.concatenate([ball.vertices, ball.vertices + np.array([0.8, 0, 0])])
    faces = np.concatenate([ball.faces, ball.faces + len(ball.vertices)])
    points = np.random.default_rng(2).uniform([-0.6, -0.6, -0.6], [1.4, 0.6, 0.6], (4000, 3))
    radii = np.stack([np.linalg.norm(points, axis=1), np.linalg.norm(points - [0.8, 0, 0], axis=1)])
    clear = (np.abs(radii - 0.5) > 2e-3).all(axis=0)
    expected = (radii < 0.5).any(axis=0)
    np.testing.assert_array_equal(inside(points, vertices, faces)[clear], expected[clear])
    usual = igl.signed_distance(points, vertices, faces.astype(np.int64), igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL)[0] < 0
    assert (usual[clear] != expected[clear]).any()


def test_edge_of_a_stretched_garment() -> None:
    """Scaled by 1.1, every edge is a tenth longer."""
    cloth = sphere(0.3, subdivisions=2)
    pairs = edges(cloth.faces.astype(np.int32))
    rest = edge_lengths(cloth.vertices, pairs)
    assert edge_mm(cloth.vertices * 1.1, rest, pairs) == pytest.approx(100 * rest.mean())
    assert edge_mm(cloth.vertices * 0.9, rest, pairs) == pytest.approx(100 * rest.mean())
    assert edge_mm(cloth.vertices + np.array([0.3, -1, 4]), rest, pairs) == pytest.approx(0, abs=1e-9)
    by_hand = [abs(float(np.linalg.norm(cloth.vertices[a] - cloth.vertices[b]))) for a, b in pairs]
    np.testing.assert_allclose(rest, by_hand)


def test_bend_of_a_sphere_and_of_a_sheet() -> None:
    """Normals of a sphere are its radii: neighbours at the angle a give 1 - cos a."""
    cloth = sphere(1.0)
    pairs = edges(cloth.faces.astype(np.int32))
    cosine = np.einsum("ij,ij->i", cloth.vertices[pairs[:, 0]], cloth.vertices[pairs[:, 1]])
    assert bend(cloth.vertices, cloth.faces, pairs) == pytest.approx(float((1 - cosine).mean()), rel=1e-2)
    flat = cloth.vertices * [1, 1, 0]
    sheet = cloth.faces[cloth.face_normals[:, 2] > 1e-9]
    assert bend(flat, sheet, edges(sheet.astype(np.int32))) == pytest.approx(0, abs=1e-12)


def test_euclidean_is_a_mean_distance() -> None:
    first = np.zeros((4, 3))
    second = np.array([[0.001, 0, 0], [0, 0.002, 0], [0, 0, 0], [0.003, 0.004, 0]])
    assert euclidean_mm(first, second) == pytest.approx((1 + 2 + 0 + 5) / 4)


def pose(**rotations: tuple[float, float, float]) -> np.ndarray:
    theta = np.zeros((24, 3))
    for name, rotation in rotations.items():
        theta[JOINT_NAMES.index(name)] = rotation
    return theta


def test_clean_frames_are_those_where_the_body_leaves_room() -> None:
    body = load_default_body("male")
    poses = np.stack(
        [
            pose(),
            pose(left_shoulder=(0, 0, -0.6)),  # the arm hangs away from the trunk
            pose(left_shoulder=(0, 0, -1.7)),  # the arm is in the trunk
            pose(left_elbow=(0, -2.9, 0)),  # forearm into the upper arm
            pose(pelvis=(0.3, 1.0, -0.4)),  # lying about as a whole
        ]
    )
    posed = body.posed(poses)
    assert clean_frames(body, None, posed).tolist() == [True, True, False, False, True]
    share = touching_share(body, None, posed)
    assert share[0] == share[4] == 0
    assert share[2] > 0.005
    assert not clean_frames(body, None, posed, CleanFrames(allowed=-1.0)).any()
