"""Tangents for normal maps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from gltf_samples import make_primitives, make_rig

from garmentc.gltf.tangents import vertex_tangents
from garmentc.outfit.corners import CornerPrimitive


def square(texcoords: list[list[float]]) -> tuple[np.ndarray, CornerPrimitive]:
    """A square seen from +Z, counter-clockwise from the lower left."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    return points, CornerPrimitive(
        material=0,
        vertices=np.arange(4, dtype=np.int32),
        obj_vertices=np.arange(4, dtype=np.int32),
        triangles=np.array([[0, 1, 2], [0, 2, 3]], np.uint32),
        tri_index=np.arange(2, dtype=np.int32),
        texcoords=np.array(texcoords, np.float32),
        normals=np.tile(np.float32([0, 0, 1]), (4, 1)),
        colors=None,
    )


UPRIGHT = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]  # v grows downwards


def test_an_upright_texture_points_right_and_is_not_mirrored() -> None:
    np.testing.assert_allclose(vertex_tangents(*square(UPRIGHT)), [[1, 0, 0, 1]] * 4, atol=1e-7)


def test_a_mirrored_texture_has_a_negative_sign() -> None:
    mirrored = [[1 - u, v] for u, v in UPRIGHT]
    np.testing.assert_allclose(vertex_tangents(*square(mirrored)), [[-1, 0, 0, -1]] * 4, atol=1e-7)


def test_a_texture_on_its_side_points_up() -> None:
    """u grows upwards and v to the right, so the image's top points left: that is where normal x tangent points."""
    turned = [[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]
    np.testing.assert_allclose(vertex_tangents(*square(turned)), [[0, 1, 0, 1]] * 4, atol=1e-7)


def test_without_texture_area_they_are_still_unit_and_across_the_normal() -> None:
    tangents = vertex_tangents(*square([[0.5, 0.5]] * 4))
    np.testing.assert_allclose(np.linalg.norm(tangents[:, :3], axis=1), 1, atol=1e-6)
    np.testing.assert_allclose(tangents[:, 2], 0, atol=1e-6)


def test_on_a_gown_they_follow_the_derivative_of_the_texture() -> None:
    """u grows with the angle about the vertical: its direction is known in closed form."""
    rig = make_rig(morphs=0, columns=48, rows=40)
    [corners] = make_primitives(rig, 48, 40, parts=1)
    points = rig.template[corners.vertices]
    tangents = vertex_tangents(points, corners)
    assert corners.texcoords is not None
    angle = 2 * np.pi * corners.texcoords[:, 0].astype(float)
    direction = np.stack([-np.sin(angle), np.zeros_like(angle), 0.8 * np.cos(angle)], axis=1)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    cosine = np.einsum("ni,ni->n", direction, tangents[:, :3])
    assert np.median(cosine) > 0.999
    assert cosine.min() > 0.99
    np.testing.assert_allclose(np.einsum("ni,ni->n", corners.normals, tangents[:, :3]), 0, atol=1e-5)
    assert len(np.unique(tangents[:, 3])) == 1
    flipped = replace(corners, texcoords=corners.texcoords * np.float32([-1, 1]))
    np.testing.assert_allclose(vertex_tangents(points, flipped), -tangents, atol=1e-5)
