"""Splitting corners into vertices: no more of them than needed, and every corner still says what the OBJ says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from test_topology import grid, outfit_of

from garmentc.outfit.corners import CornerMesh, linear, split_corners
from garmentc.outfit.obj import read_obj
from garmentc.outfit.outfit import Outfit
from garmentc.outfit.topology import Welded, vertex_normals, weld

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def split(folder: Path, text: str) -> tuple[Outfit, Welded, CornerMesh]:
    (folder / "a.obj").write_text(text)
    outfit = read_obj(folder / "a.obj")
    welded = weld(outfit)
    return outfit, welded, split_corners(outfit, welded)


def assert_says_what_the_obj_says(outfit: Outfit, welded: Welded, mesh: CornerMesh) -> None:
    """Corner by corner, against the outfit's own tables."""
    seen = []
    for primitive in mesh.primitives:
        tri = primitive.tri_index
        seen += tri.tolist()
        assert (outfit.tri_material[tri] == primitive.material).all()
        np.testing.assert_array_equal(primitive.vertices[primitive.triangles], welded.vertex_of[outfit.tri_v[tri]])
        np.testing.assert_array_equal(welded.vertex_of[primitive.obj_vertices], primitive.vertices)
        has_uv = outfit.tri_vt[tri] >= 0
        if primitive.texcoords is None:
            assert not has_uv.any()
        else:
            uv = outfit.texcoords[outfit.tri_vt[tri][has_uv]].astype(np.float32)
            drawn = primitive.texcoords[primitive.triangles][has_uv]
            np.testing.assert_array_equal(drawn[:, 0], uv[:, 0])
            np.testing.assert_allclose(drawn[:, 1], 1 - uv[:, 1], atol=1e-6)
        has_normal = outfit.tri_vn[tri] >= 0
        authored = outfit.normals[outfit.tri_vn[tri][has_normal]]
        length = np.linalg.norm(authored, axis=1, keepdims=True)
        drawn = primitive.normals[primitive.triangles][has_normal]
        good = length[:, 0] > 1e-6
        np.testing.assert_allclose(drawn[good], (authored / np.where(length > 0, length, 1))[good], atol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(primitive.normals, axis=1), 1, atol=1e-5)
        assert sorted(set(primitive.triangles.ravel().tolist())) == list(range(len(primitive.vertices)))
        first_use = np.unique(primitive.triangles.ravel(), return_index=True)[1]
        assert (np.diff(first_use) > 0).all()
    corner_vertex = welded.vertex_of[outfit.tri_v]
    proper = [len(set(row)) == 3 for row in corner_vertex.tolist()]
    assert sorted(seen) == np.flatnonzero(proper).tolist()


def test_a_smooth_mesh_is_not_split(tmp_path: Path) -> None:
    outfit, welded, mesh = split(tmp_path, SQUARE + "f 1 2 3 4\n")
    (primitive,) = mesh.primitives
    assert_says_what_the_obj_says(outfit, welded, mesh)
    assert len(primitive.vertices) == 4
    assert primitive.texcoords is None
    assert primitive.colors is None
    assert primitive.triangles.dtype == np.uint32
    assert primitive.vertices.dtype == primitive.obj_vertices.dtype == np.int32


def test_seams_split_and_equal_values_do_not(tmp_path: Path) -> None:
    """vt 3 and vt 7 are the same place: only the corner at vertex 1, whose coordinates differ, is split."""
    uv = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt .5 .5\nvt 1 1.0\nvt 1e0 1\n"
    outfit, welded, mesh = split(tmp_path, SQUARE + uv + "f 1/1 2/2 3/3\nf 1/5 3/7 4/4\n")
    (primitive,) = mesh.primitives
    assert_says_what_the_obj_says(outfit, welded, mesh)
    np.testing.assert_array_equal(primitive.vertices, [0, 1, 2, 0, 3])
    np.testing.assert_array_equal(primitive.triangles, [[0, 1, 2], [3, 2, 4]])
    np.testing.assert_array_equal(primitive.texcoords, np.float32([[0, 1], [1, 1], [1, 0], [0.5, 0.5], [0, 0]]))


def test_materials_become_primitives(tmp_path: Path) -> None:
    text = SQUARE + "usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\nusemtl a\nf 2 3 4\nusemtl c\nf 1 1 2\n"
    outfit, welded, mesh = split(tmp_path, text)
    assert_says_what_the_obj_says(outfit, welded, mesh)
    assert [outfit.materials[p.material].name for p in mesh.primitives] == ["a", "b"]
    assert [p.tri_index.tolist() for p in mesh.primitives] == [[0, 2], [1]]
    np.testing.assert_array_equal(mesh.primitives[1].vertices, [0, 2, 3])


def test_authored_normals_are_kept_and_made_unit(tmp_path: Path) -> None:
    text = SQUARE + "vn 0 0 5\nvn 0 3 4\nvn 0 0 5\nvn 0 0 0\nf 1//1 2//2 3//3\nf 1//3 3//1 4//4\n"
    outfit, welded, mesh = split(tmp_path, text)
    (primitive,) = mesh.primitives
    assert_says_what_the_obj_says(outfit, welded, mesh)
    np.testing.assert_array_equal(primitive.vertices, [0, 1, 2, 3])
    np.testing.assert_allclose(primitive.normals, [[0, 0, 1], [0, 0.6, 0.8], [0, 0, 1], [0, 0, 1]], atol=1e-7)


ROOF = "v 0 0 0\nv 1 0 0\nv 1 1 1\nv 0 1 1\nv 1 2 0\nv 0 2 0\n"
SLOPE = round(0.5**0.5, 5)


def normals_at(mesh: CornerMesh, vertex: int) -> set[tuple[float, ...]]:
    (primitive,) = mesh.primitives
    return {tuple(row) for row in primitive.normals[primitive.vertices == vertex].astype(float).round(5).tolist()}


def test_smoothing_groups(tmp_path: Path) -> None:
    """A ridge (vertices 2, 3): smooth without `s` lines and within a group, sharp between groups and when off."""
    one, other, mean = (
        (0.0, -round(SLOPE, 5), round(SLOPE, 5)),
        (0.0, round(SLOPE, 5), round(SLOPE, 5)),
        (0.0, 0.0, 1.0),
    )
    faces = "f 1 2 3 4\n{}f 4 3 5 6\n"
    for head, between, expected in (
        ("", "", {mean}),
        ("s 1\n", "", {mean}),
        ("s 1\n", "s 2\n", {one, other}),
        ("s off\n", "", {one, other}),
        ("s off\n", "s 1\n", {one, other}),
    ):
        outfit, welded, mesh = split(tmp_path, ROOF + head + faces.format(between))
        assert_says_what_the_obj_says(outfit, welded, mesh)
        assert normals_at(mesh, 2) == normals_at(mesh, 3) == expected
        assert len(mesh.primitives[0].vertices) == 6 + 2 * (len(expected) - 1)


def test_flat_polygons_are_flat_as_a_whole(tmp_path: Path) -> None:
    """A quad that is not plane has one normal, not one for each of its triangles."""
    _, _, mesh = split(tmp_path, "v 0 0 0\nv 1 0 .3\nv 1 1 0\nv 0 1 .3\ns 0\nf 1 2 3 4\n")
    (primitive,) = mesh.primitives
    assert len(primitive.vertices) == 4
    assert len(np.unique(primitive.normals, axis=0)) == 1


def test_computed_normals_ignore_seams(tmp_path: Path) -> None:
    points, triangles = grid(8)
    torn = outfit_of(points[triangles.ravel()], np.arange(triangles.size).reshape(-1, 3))
    welded = weld(torn)
    (primitive,) = split_corners(torn, welded).primitives
    assert len(primitive.vertices) == len(points)
    expected = vertex_normals(welded.vertices, welded.triangles)[primitive.vertices]
    np.testing.assert_allclose(primitive.normals, expected, atol=1e-6)


def test_both_sides_modelled_on_the_same_vertices(tmp_path: Path) -> None:
    """Front and back faces share their vertices: each keeps its own side's normal."""
    _, _, mesh = split(tmp_path, SQUARE + "f 1 2 3 4\nf 4 3 2 1\n")
    for vertex in range(4):
        assert normals_at(mesh, vertex) == {(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)}


def test_partly_missing_texture_coordinates(tmp_path: Path) -> None:
    outfit, welded, mesh = split(tmp_path, SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\nf 1 3 4\n")
    assert_says_what_the_obj_says(outfit, welded, mesh)
    assert mesh.primitives[0].texcoords is not None


def test_colors_are_linear_and_split(tmp_path: Path) -> None:
    text = "v 0 0 0 1 0 0\nv 1 0 0 .5 .5 .5\nv 1 1 0 0 0 1\nv 0 0 0 0 1 0\nv 0 1 0 1 1 1\nf 1 2 3\nf 4 3 5\n"
    outfit, welded, mesh = split(tmp_path, text)
    (primitive,) = mesh.primitives
    assert_says_what_the_obj_says(outfit, welded, mesh)
    assert primitive.colors is not None
    np.testing.assert_array_equal(primitive.vertices, [0, 1, 2, 0, 3])
    np.testing.assert_allclose(primitive.colors[0], [1, 0, 0])
    np.testing.assert_allclose(primitive.colors[1], [0.21404114] * 3, rtol=1e-5)
    np.testing.assert_allclose(primitive.colors[3], [0, 1, 0])


def test_linear_is_the_srgb_curve() -> None:
    np.testing.assert_allclose(linear(np.array([0.0, 0.04045, 0.5, 1.0])), [0, 0.0031308, 0.2140411, 1], atol=1e-6)


def test_keys_too_large_for_one_number(tmp_path: Path) -> None:
    """Many colours, coordinates and normals at once: the combined key is compressed rather than overflowing."""
    count = 60_000
    rng = np.random.default_rng(0)
    outfit = outfit_of(rng.random((3 * count, 3)), np.arange(3 * count).reshape(-1, 3))
    own = outfit.tri_v
    values: dict[str, NDArray[np.float64]] = {
        "texcoords": rng.random((3 * count, 2)),
        "normals": rng.random((3 * count, 3)),
    }
    outfit = replace(outfit, tri_vt=own, tri_vn=own, colors=rng.random((3 * count, 3)), **values)
    welded = weld(outfit)
    (primitive,) = split_corners(outfit, welded).primitives
    np.testing.assert_array_equal(primitive.vertices, np.arange(3 * count))
    np.testing.assert_array_equal(primitive.triangles.ravel(), np.arange(3 * count))


GARMENTS = (
    "male_outfit_casualsuit04_shoes01_fedora",
    "female_casualsuit01_unwelded",
    "male_casualsuit04_ngon_negative_crlf",
    "male_worksuit01",
)


@pytest.mark.parametrize("name", GARMENTS)
def test_garments(shared: Path, name: str) -> None:
    outfit = read_obj(shared / f"data/garments/makehuman/{name}.obj")
    welded = weld(outfit)
    assert_says_what_the_obj_says(outfit, welded, split_corners(outfit, welded))
