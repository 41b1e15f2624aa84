"""Procedural outfits: what a network is trained on must be clothes outside a body, whole and well-shaped."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh

from garmentc.simulation.hems import split_at
from garmentc.simulation.outfits import CATEGORIES, GeneratedOutfit, generate_outfit, sample_parameters
from garmentc.simulation.remeshing import row_mesh, split_quads, triangle_mesh
from garmentc.simulation.slivers import mend_slivers, shape_quality
from garmentc.simulation.surface import Grid, edges_of, non_manifold, vertex_normals
from garmentc.smpl import BodyModel, load_body

SEEDS = {
    "top": 13,
    "open_top": 7,
    "trousers": 38,
    "skirt": 33,
    "dress": 21,
    "jumpsuit": 26,
    "top_trousers": 32,
    "top_skirt": 83,
    "jacket_top_trousers": 11,
    "jacket_dress": 104,
    "footwear": 19,
    "headwear": 37,
    "accessories": 10,
}
"""One seed of every category."""


@cache
def body_of(gender: str) -> BodyModel:
    return load_body(None, gender)


@cache
def outfit_of(category: str) -> GeneratedOutfit:
    parameters = sample_parameters(SEEDS[category])
    return generate_outfit(parameters, body_of(parameters.gender))


def rest_body(outfit: GeneratedOutfit) -> trimesh.Trimesh:
    body = body_of(outfit.parameters.gender)
    return trimesh.Trimesh(body.shaped(np.array(outfit.parameters.betas)), body.faces, process=False)


def part(outfit: GeneratedOutfit, index: int) -> trimesh.Trimesh:
    """One garment alone."""
    mesh = trimesh.Trimesh(outfit.vertices, outfit.triangles[outfit.triangle_part == index], process=False)
    mesh.remove_unreferenced_vertices()
    return mesh


def test_parameters_are_reproducible_and_cover_everything():
    drawn = [sample_parameters(seed) for seed in range(200)]
    assert drawn[:20] == [sample_parameters(seed) for seed in range(20)]
    assert {p.category for p in drawn} == set(CATEGORIES) == set(SEEDS)
    assert {p.gender for p in drawn} == {"female", "male", "neutral"}
    betas = np.array([p.betas for p in drawn])
    plain = (betas == 0).all(1).mean()
    assert 0.23 < plain < 0.43
    assert np.abs(betas).max() <= 2
    assert 0.8 < betas[(betas != 0).any(1)].std() < 1.0  # a normal clipped at two deviations: 0.88
    counts = np.array([p.vertex_count for p in drawn])
    assert counts.min() >= 250
    assert counts.max() <= 4000


@pytest.mark.parametrize("category", CATEGORIES)
def test_outfit_is_sound_cloth_outside_the_body(category: str):
    import igl

    outfit = outfit_of(category)
    assert outfit.category == category
    assert np.isfinite(outfit.vertices).all()
    assert outfit.triangles.dtype == np.int32
    assert len(outfit.triangle_part) == len(outfit.triangles)
    assert sorted(set(outfit.triangle_part)) == list(range(len(outfit.part_names)))
    assert 0.75 < len(outfit.vertices) / outfit.parameters.vertex_count < 1.35
    assert np.array_equal(np.unique(outfit.triangles), np.arange(len(outfit.vertices)))

    # Exact distance to the triangles, sign from the winding number.
    body = rest_body(outfit)
    squared = igl.point_mesh_squared_distance(outfit.vertices, body.vertices, body.faces)[0]
    winding = igl.fast_winding_number(np.array(body.vertices), np.array(body.faces), outfit.vertices)
    assert np.abs(winding).max() < 0.5
    assert np.sqrt(squared).min() >= 0.0015 - 1e-6

    mesh = trimesh.Trimesh(outfit.vertices, outfit.triangles, process=False)
    assert mesh.is_winding_consistent
    sides = np.sort(outfit.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert np.unique(sides, axis=0, return_counts=True)[1].max() == 2
    assert shape_quality(outfit.vertices, outfit.triangles).min() > 0.05
    assert mesh.area_faces.min() > 1e-8


@pytest.mark.parametrize("category", CATEGORIES)
def test_faces_look_away_from_the_body(category: str):
    outfit = outfit_of(category)
    body = rest_body(outfit)
    mesh = trimesh.Trimesh(outfit.vertices, outfit.triangles, process=False)
    nearest = body.vertices[body.kdtree.query(mesh.triangles_center)[1]]
    away = ((mesh.triangles_center - nearest) * mesh.face_normals).sum(1) > 0
    assert away.mean() > 0.85  # not all: hollows are bridged, brims stand off


def test_same_parameters_same_bytes():
    parameters = sample_parameters(SEEDS["top"])
    again = generate_outfit(parameters, body_of(parameters.gender))
    assert again.vertices.tobytes() == outfit_of("top").vertices.tobytes()
    assert again.triangles.tobytes() == outfit_of("top").triangles.tobytes()


def test_density_follows_the_parameter():
    parameters = sample_parameters(SEEDS["skirt"])
    coarse = generate_outfit(replace(parameters, vertex_count=500), body_of(parameters.gender))
    fine = generate_outfit(replace(parameters, vertex_count=10_000), body_of(parameters.gender))
    assert 400 < len(coarse.vertices) < 650
    assert 8_000 < len(fine.vertices) < 12_500


@pytest.mark.parametrize("category", ["top_trousers", "jacket_top_trousers", "jacket_dress", "top_skirt"])
def test_outer_layers_lie_outside_inner_ones(category: str):
    outfit = outfit_of(category)
    compared = 0
    for inner in range(len(outfit.part_names)):
        for outer in range(inner + 1, len(outfit.part_names)):
            under, over = part(outfit, inner), part(outfit, outer)
            near, distance, triangle = trimesh.proximity.closest_point(under, over.vertices)
            normal = under.face_normals[triangle]
            facing = (np.array(over.vertex_normals) * normal).sum(1) > 0.5
            # Where the nearest point is inside a triangle, there is cloth below; at hems there may be none.
            corners = trimesh.triangles.points_to_barycentric(under.triangles[triangle], near)
            covered = facing & (corners.min(1) > 0.02) & (distance < 0.03)
            height = ((over.vertices - near) * normal).sum(1)[covered]
            compared += len(height)
            assert (height > 0).all()
    assert compared > 100


def test_trouser_legs_and_sleeves_are_tubes_of_their_own():
    outfit = outfit_of("jumpsuit")
    body = body_of(outfit.parameters.gender)
    joints = body.joints(np.array(outfit.parameters.betas))
    middle = outfit.vertices[outfit.triangles].mean(1)
    for below in (middle[:, 1] < joints[1, 1] - 0.12, np.abs(middle[:, 0]) > joints[16, 0] + 0.1):
        pieces = trimesh.graph.connected_components(
            trimesh.Trimesh(outfit.vertices, outfit.triangles[below], process=False).face_adjacency,
            nodes=np.arange(below.sum()),
        )
        assert len(pieces) == 2
        centres = [middle[below][piece][:, 0].mean() for piece in pieces]
        assert np.prod(np.sign(centres)) == -1
    # No web of cloth between arm and trunk: sleeves stay within a hand's breadth of the arm's axis.
    sleeve = outfit.vertices[np.abs(outfit.vertices[:, 0]) > joints[16, 0] + 0.1]
    assert np.linalg.norm(sleeve[:, 1:] - joints[16, 1:], axis=1).max() < 0.15


def sphere_grid() -> tuple[Grid, np.ndarray]:
    grid = Grid(np.array([[-0.3, -0.3, -0.3], [0.3, 0.3, 0.3]]), 0.01)
    return grid, np.linalg.norm(grid.points, axis=1) - 0.25


@pytest.mark.parametrize("kind", ["triangles", "rows"])
def test_tessellations_of_a_sphere(kind: str):
    grid, values = sphere_grid()
    dense = grid.isosurface(values)
    if kind == "rows":
        vertices, quads = row_mesh(grid, values, np.array([0.03, 0.04, 0.05]))
        faces = split_quads(vertices, quads)
    else:
        vertices, faces = triangle_mesh(*dense, 600, (1.0, 1.0, 1.0), np.random.default_rng(0))
        assert abs(len(vertices) - 600) < 10
        assert np.quantile(shape_quality(vertices, faces), 0.05) > 0.7
    assert not non_manifold(faces)
    assert len(vertices) - len(edges_of(faces)) + len(faces) == 2
    assert np.abs(np.linalg.norm(vertices, axis=1) - 0.25).max() < 0.01
    outwards = (vertex_normals(vertices, faces) * vertices).sum(1) / np.linalg.norm(vertices, axis=1)
    assert outwards.min() > 0.7


def test_cut_keeps_exactly_the_positive_side():
    grid, values = sphere_grid()
    vertices, faces = grid.isosurface(values)
    height = 0.05
    cut_vertices, cut_faces = split_at(vertices, faces, vertices[:, 1] - height)
    cap = trimesh.Trimesh(cut_vertices, cut_faces, process=False)
    assert cut_vertices[:, 1].min() == pytest.approx(height, abs=1e-12)
    assert cap.area == pytest.approx(2 * np.pi * 0.25 * (0.25 - height), rel=2e-3)
    assert not non_manifold(cut_faces)


def test_non_manifold_meshes_are_seen():
    fan = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    assert not non_manifold(fan)
    assert non_manifold(np.concatenate([fan, [[2, 0, 4]]]))  # three faces on an edge
    assert non_manifold(np.array([[0, 1, 2], [0, 3, 4]], dtype=np.int32))  # two fans on a vertex
    assert non_manifold(np.array([[0, 1, 2], [0, 1, 3]], dtype=np.int32))  # faces that disagree


def test_slivers_are_mended():
    steps = np.linspace(0, 1, 6)
    vertices = np.stack([*np.meshgrid(steps, steps, indexing="ij"), np.zeros((6, 6))], -1).reshape(-1, 3)
    number = np.arange(36).reshape(6, 6)
    quads = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], -1).reshape(-1, 4)
    faces = split_quads(vertices, quads)
    vertices[14] = vertices[15] + [0, -0.004, 0]
    assert shape_quality(vertices, faces).min() < 0.05
    mended, kept = mend_slivers(vertices, faces)
    assert shape_quality(mended, kept).min() > 0.15
    assert not non_manifold(kept)
    assert trimesh.Trimesh(mended, kept, process=False).area == pytest.approx(1)
