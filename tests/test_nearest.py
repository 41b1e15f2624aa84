"""Nearest body surface, against brute force and trimesh."""

from __future__ import annotations

import numpy as np
import pytest

from garmentc.smpl.body import BodyModel
from garmentc.smpl.correctives import PoseCorrectives
from garmentc.smpl.nearest import (
    closest_on_surface,
    nearest_body_weights,
    nearest_vertex,
    signed_distance,
    surface_body_weights,
)


@pytest.fixture
def ball() -> BodyModel:
    """A unit sphere with random weights: a body only in form."""
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=2)
    vertices = np.asarray(mesh.vertices)
    weights = np.random.default_rng(1).dirichlet(np.ones(24), size=len(vertices))
    return BodyModel(
        name="ball",
        gender="neutral",
        v_template=vertices,
        faces=np.asarray(mesh.faces, dtype=np.int32),
        weights=weights,
        shapedirs=np.zeros((len(vertices), 3, 0)),
        J_template=np.zeros((24, 3)),
        J_shapedirs=np.zeros((24, 3, 0)),
        correctives=PoseCorrectives.from_dense(np.zeros((len(vertices), 3, 207))),
    )


@pytest.fixture
def points() -> np.ndarray:
    return np.random.default_rng(0).normal(size=(200, 3))


def test_nearest_vertex_is_brute_force(ball: BodyModel, points: np.ndarray) -> None:
    brute = np.linalg.norm(points[:, None] - ball.v_template[None], axis=-1).argmin(axis=1)
    np.testing.assert_array_equal(nearest_vertex(points, ball.v_template), brute)
    np.testing.assert_array_equal(nearest_body_weights(points, ball.v_template, ball), ball.weights[brute])


def test_closest_points_agree_with_trimesh(ball: BodyModel, points: np.ndarray) -> None:
    import trimesh

    mesh = trimesh.Trimesh(ball.v_template, ball.faces, process=False)
    expected, distance, _ = trimesh.proximity.closest_point_naive(mesh, points)
    closest = closest_on_surface(points, ball.v_template, ball.faces)
    np.testing.assert_allclose(closest.point, expected, atol=1e-12)
    np.testing.assert_allclose(closest.distance, distance, atol=1e-12)
    rebuilt = np.einsum("nk,nkc->nc", closest.barycentric, ball.v_template[ball.faces[closest.face]])
    np.testing.assert_allclose(rebuilt, expected, atol=1e-12)
    inside = ((points[:, None] - mesh.triangles_center) * mesh.face_normals).sum(axis=-1).max(axis=1) < 0  # convex
    assert 0 < inside.sum() < len(points)
    signed = signed_distance(points, ball.v_template, ball.faces)
    np.testing.assert_allclose(signed, np.where(inside, -distance, distance), atol=1e-12)


def test_surface_weights_interpolate_within_the_triangle(ball: BodyModel) -> None:
    rng = np.random.default_rng(2)
    face = rng.integers(0, len(ball.faces), 100)
    barycentric = rng.dirichlet(np.ones(3), size=100)
    on_skin = np.einsum("nk,nkc->nc", barycentric, ball.v_template[ball.faces[face]])
    normal = np.cross(*(np.diff(ball.v_template[ball.faces[face]], axis=1).transpose(1, 0, 2)))
    expected = np.einsum("nk,nkj->nj", barycentric, ball.weights[ball.faces[face]])
    # A sphere is convex, so the closest point to one above the skin is straight below.
    weights = surface_body_weights(on_skin + 5 * normal, ball.v_template, ball)
    np.testing.assert_allclose(weights, expected, atol=1e-9)


def test_surface_weights_at_vertices_are_the_vertex_weights(ball: BodyModel) -> None:
    np.testing.assert_allclose(surface_body_weights(ball.v_template, ball.v_template, ball), ball.weights, atol=1e-12)


def test_posed_body_moves_the_weights_with_it(ball: BodyModel, points: np.ndarray) -> None:
    moved = ball.v_template * [1, -1, -1] + [3, 0, 0]
    there = points * [1, -1, -1] + [3, 0, 0]
    np.testing.assert_allclose(
        surface_body_weights(there, moved, ball), surface_body_weights(points, ball.v_template, ball), atol=1e-9
    )


def test_weights_sum_to_one_on_a_body_with_flat_triangles(ball: BodyModel, points: np.ndarray) -> None:
    crushed = ball.v_template * [1, 1, 0]
    crushed[ball.faces[0]] = crushed[ball.faces[0, 0]]
    weights = surface_body_weights(np.concatenate([points, crushed[ball.faces[0]]]), crushed, ball)
    assert np.isfinite(weights).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    assert weights.min() >= 0
