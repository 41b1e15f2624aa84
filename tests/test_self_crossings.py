"""Self-crossings against libigl's triangle-triangle test and hand-made cases."""

from __future__ import annotations

import igl
import numpy as np
import pytest

from garmentc.outfit.topology import edges
from garmentc.simulation.self_crossings import self_crossings
from tests.cloth_samples import ball, sheet


def exhaustive(vertices: np.ndarray, triangles: np.ndarray) -> set[tuple[int, int]]:
    """Pierced pairs by solving for the crossing point of every edge with every triangle."""
    found = set()
    for edge in edges(triangles):
        start, end = vertices[edge]
        for triangle in triangles:
            if set(edge) & set(triangle):
                continue
            a, b, c = vertices[triangle]
            system = np.stack([b - a, c - a, start - end], axis=1)
            if abs(np.linalg.det(system)) < 1e-15:
                continue
            u, v, t = np.linalg.solve(system, start - a)
            if u > 0 and v > 0 and u + v < 1 and 0 < t < 1:
                found.add((int(edge[0]), int(edge[1])))
    return found


@pytest.mark.parametrize("seed", range(3))
def test_crumpled_sheets_agree_with_an_exhaustive_search(seed: int):
    rng = np.random.default_rng(seed)
    vertices, triangles = sheet(1, 1, 6, 6)
    vertices = vertices * [1, 0, 1] + 0.25 * rng.normal(size=vertices.shape)
    found = {tuple(map(int, edge)) for edge in self_crossings(vertices, triangles)}
    assert found == exhaustive(vertices, triangles)
    assert found, "the sheet is crumpled"


def test_two_sheets_through_each_other_cross_where_libigl_says_so():
    vertices, triangles = sheet(1, 1, 5, 5)
    upright = vertices[:, [1, 0, 2]] + np.array([0.11, 0.07, 0.03])
    both = np.concatenate([vertices, upright])
    faces = np.concatenate([triangles, triangles + len(vertices)])
    crossing = self_crossings(both, faces)
    touched = np.isin(np.arange(len(both)), crossing)
    hit = [
        igl.tri_tri_intersection_test_3d(*(both[v][None] for v in (*f, *g)))[0]
        for f in triangles
        for g in triangles + len(vertices)
    ]
    assert any(hit)
    assert touched[: len(vertices)].any()
    assert touched[len(vertices) :].any()


def test_whole_meshes_have_none():
    assert len(self_crossings(*ball(0.1))) == 0
    assert len(self_crossings(*sheet(1, 1, 7, 7))) == 0


def test_a_large_triangle_among_small_ones_is_seen():
    small, faces = ball(0.1)
    large = np.array([[-50.0, 0.003, -50], [50, 0.003, -50], [0, 0.003, 80]])
    vertices = np.concatenate([small, large])
    crossing = self_crossings(vertices, np.concatenate([faces, [[642, 643, 644]]]))
    above = vertices[:, 1] > 0.003
    cut = [edge for edge in edges(faces) if above[edge[0]] != above[edge[1]]]
    assert {tuple(edge) for edge in crossing.tolist()} == {tuple(map(int, edge)) for edge in cut}
