"""Welding, edges, normals and components, against trimesh and by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.outfit.outfit import Material, Outfit
from garmentc.outfit.topology import components, corner_angles, edges, surface_warnings, vertex_normals, weld


def outfit_of(vertices: NDArray[np.float64], triangles: NDArray[np.int32]) -> Outfit:
    faces = len(triangles)
    absent = np.full((faces, 3), -1, np.int32)
    zeros = np.zeros(faces, np.int32)
    return Outfit(
        path=Path("x.obj"),
        vertices=np.asarray(vertices, float),
        tri_v=np.asarray(triangles, np.int32),
        tri_vt=absent,
        tri_vn=absent,
        tri_face=np.arange(faces, dtype=np.int32),
        tri_material=zeros,
        tri_group=zeros,
        face_line=zeros,
        texcoords=np.zeros((0, 2)),
        normals=np.zeros((0, 3)),
        materials=(Material("m"),),
    )


def grid(n: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    u, v = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n))
    points = np.stack([u.ravel(), v.ravel(), 0.1 * np.sin(5 * u.ravel())], axis=1)
    index = np.arange(n * n, dtype=np.int32).reshape(n, n)
    quads = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], -1).reshape(-1, 4)
    return points, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def test_unwelded_mesh_welds_back() -> None:
    points, triangles = grid(12)
    torn = outfit_of(points[triangles.ravel()], np.arange(triangles.size).reshape(-1, 3))
    welded = weld(torn)
    assert len(welded.vertices) == len(points)
    assert len(welded.triangles) == len(triangles)
    np.testing.assert_array_equal(welded.vertices[welded.vertex_of], torn.vertices)
    np.testing.assert_array_equal(welded.vertices[welded.triangles], points[triangles])


def test_order_is_that_of_the_file_and_unreferenced_vertices_drop() -> None:
    vertices = np.array([[9, 9, 9], [1, 0, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0], [7, 7, 7], [-0.0, 0, 0]], float)
    welded = weld(outfit_of(vertices, np.array([[6, 3, 4], [2, 1, 4]])))
    np.testing.assert_array_equal(welded.vertex_of, [-1, 0, 1, 0, 2, -1, 1])
    np.testing.assert_array_equal(welded.vertices, vertices[[1, 2, 4]])
    np.testing.assert_array_equal(welded.triangles, [[1, 0, 2], [1, 0, 2]])


def test_tolerance_is_relative_and_small() -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1e-7, 0, 0], [1, 1, 1e-7], [0, 1, 0]], float)
    triangles = np.array([[0, 1, 2], [3, 4, 5]])
    for scale in (1e-3, 1.0, 1e5):
        assert len(weld(outfit_of(square * scale, triangles)).vertices) == 4
    apart = square.copy()
    apart[3, 0], apart[4, 2] = 1e-4, 1e-4
    assert len(weld(outfit_of(apart, triangles)).vertices) == 6
    assert len(weld(outfit_of(square, triangles), tolerance=0).vertices) == 6


def test_one_far_triangle_does_not_melt_the_mesh() -> None:
    points, triangles = grid(10)
    far = np.array([[1e6, 0, 0], [1e6 + 1, 0, 0], [1e6, 1, 0]])
    welded = weld(outfit_of(np.concatenate([points, far]), np.concatenate([triangles, [[100, 101, 102]]])))
    assert len(welded.vertices) == 103


def test_dense_cluster_needs_bounded_memory() -> None:
    rng = np.random.default_rng(0)
    cluster = rng.uniform(0, 1e-9, (20_000, 3))
    points, triangles = grid(120)
    extra = np.arange(len(cluster) - 2) + len(points)
    fan = np.stack([extra, extra + 1, extra + 2], axis=1)[::3]
    welded = weld(outfit_of(np.concatenate([points, cluster]), np.concatenate([triangles, fan])))
    assert len(welded.vertices) < len(points) + 20


def test_degenerate_triangles_leave_the_topology() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 0, 0]], float)
    welded = weld(outfit_of(vertices, np.array([[0, 1, 2], [0, 1, 3], [2, 2, 0]])))
    np.testing.assert_array_equal(welded.triangles, [[0, 1, 2]])


def test_edges_are_those_of_trimesh() -> None:
    import trimesh

    points, triangles = grid(9)
    expected = trimesh.Trimesh(points, triangles, process=False).edges_unique
    np.testing.assert_array_equal(edges(triangles), expected[np.lexsort(expected.T[::-1])])
    assert edges(triangles).dtype == np.int32
    assert edges(np.zeros((0, 3), np.int32)).shape == (0, 2)


def test_angles_and_normals_are_those_of_trimesh() -> None:
    import trimesh

    points, triangles = grid(9)
    mesh = trimesh.Trimesh(points, triangles, process=False)
    np.testing.assert_allclose(corner_angles(points, triangles), mesh.face_angles, atol=1e-12)
    expected = trimesh.geometry.weighted_vertex_normals(len(points), triangles, mesh.face_normals, mesh.face_angles)
    np.testing.assert_allclose(vertex_normals(points, triangles), expected, atol=1e-9)


def test_normals_without_area_are_safe() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [5, 5, 5], [0, 0, 1]], float)
    with np.errstate(all="raise"):
        normals = vertex_normals(vertices, np.array([[0, 1, 2], [0, 0, 0]], np.int32))
        both_sides = vertex_normals(vertices, np.array([[0, 1, 4], [0, 4, 1]], np.int32))
    np.testing.assert_array_equal(normals, np.tile([0.0, 1.0, 0.0], (5, 1)))
    np.testing.assert_allclose(np.linalg.norm(both_sides, axis=1), 1)


def test_components_are_numbered_by_first_vertex() -> None:
    triangles = np.array([[5, 3, 4], [0, 1, 2], [6, 1, 2]], np.int32)
    np.testing.assert_array_equal(components(triangles, 8), [0, 0, 0, 1, 1, 1, 0, 2])


def test_unwelded_garment_welds_like_the_original(shared: Path) -> None:
    from garmentc.outfit.obj import read_obj

    folder = shared / "data/garments/makehuman"
    original = weld(read_obj(folder / "female_casualsuit01.obj"))
    torn = weld(read_obj(folder / "female_casualsuit01_unwelded.obj"))
    assert len(torn.vertices) == len(original.vertices)
    assert len(edges(torn.triangles)) == len(edges(original.triangles))
    both = np.stack([np.sort(w.vertices.round(9).view([("", float)] * 3).ravel()) for w in (original, torn)])
    assert (both[0] == both[1]).all()


@pytest.mark.parametrize("faces", [0, 1])
def test_tiny_meshes(faces: int) -> None:
    welded = weld(outfit_of(np.eye(3), np.array([[0, 1, 2]])[:faces].reshape(-1, 3)))
    assert len(welded.vertices) == 3 * faces


def test_triangles_that_weld_to_nothing_or_repeat_others_are_told() -> None:
    points, triangles = grid(4)
    twin = len(points)  # at the place of vertex 0
    added = [[0, 1, twin], [1, 1, 2], *np.roll(triangles[3:5], 1, axis=1), triangles[6][::-1]]
    outfit = outfit_of(np.concatenate([points, points[:1]]), np.concatenate([triangles, added]))
    outfit = replace(outfit, face_line=np.arange(len(outfit.tri_v), dtype=np.int32) + 1)
    collapsed, duplicate = surface_warnings(outfit, weld(outfit))
    assert (collapsed.code, collapsed.line) == ("weld.collapsed", len(triangles) + 1)
    assert collapsed.message.startswith("1 triangle(s)")  # one that uses a vertex twice is the reader's to tell
    assert (duplicate.code, duplicate.line) == ("weld.duplicate", len(triangles) + 3)
    assert duplicate.message.startswith("2 triangle(s)")  # one that is turned round is the cloth's other side
    assert surface_warnings(outfit_of(points, triangles), weld(outfit_of(points, triangles))) == ()


def test_nothing_left_after_welding_is_an_error() -> None:
    outfit = outfit_of(np.array([[0, 1e6, 0], [1, 0, 0], [1, 1, 0]]), np.array([[0, 1, 2]]))
    with pytest.raises(GarmentcError, match=r"x.obj: no triangle has three corners at different places"):
        surface_warnings(outfit, weld(outfit))
