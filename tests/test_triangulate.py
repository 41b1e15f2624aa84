"""Polygons to triangles: filled once, same winding, no corner lost."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from obj_reference import assert_fills

from garmentc.outfit.triangulate import triangulate

TILTS = {
    "flat": np.eye(3),
    "upside down": np.diag([1.0, -1.0, -1.0]),
    "on edge": np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    "askew": np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0],
}


def cut(ring: NDArray[np.float64]) -> tuple[NDArray[np.int32], list[int]]:
    """Triangles of one polygon, with vertices shuffled so that corner and vertex numbers differ."""
    order = np.random.default_rng(0).permutation(len(ring)).astype(np.int32)
    points = np.empty_like(ring)
    points[order] = ring
    triangles, polygon, degenerate = triangulate(points, order, np.array([len(ring)], np.int32))
    assert (polygon == 0).all()
    return triangles, degenerate.tolist()


def doubled_areas(ring: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.float64]:
    a, b, c = (ring[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def assert_filled_once(ring: NDArray[np.float64]) -> None:
    triangles, degenerate = cut(ring)
    assert not degenerate
    assert_fills([[(c, 0, 0) for c in t] for t in triangles.tolist()], [(c, 0, 0) for c in range(len(ring))])
    total = np.cross(ring - ring[0], np.roll(ring, -1, axis=0) - ring[0]).sum(axis=0)
    areas = doubled_areas(ring, triangles) @ (total / np.linalg.norm(total))
    assert (areas > -1e-9 * np.linalg.norm(total)).all()
    np.testing.assert_allclose(areas.sum(), np.linalg.norm(total), rtol=1e-9)


def in_space(outline: list[tuple[float, float]], tilt: str) -> NDArray[np.float64]:
    flat = np.column_stack([np.array(outline, float), np.zeros(len(outline))])
    return flat @ TILTS[tilt].T + [100.0, -50.0, 7.0]


SHAPES = {
    "triangle": [(0, 0), (1, 0), (0, 1)],
    "square": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "dart": [(0, 0), (2, 1), (0, 2), (0.5, 1)],
    "dart from its reflex corner": [(0.5, 1), (0, 0), (2, 1), (0, 2)],
    "quad with a corner on an edge": [(0, 0), (1, 0), (2, 0), (1, 1)],
    "quad beginning on an edge": [(1, 0), (2, 0), (1, 1), (0, 0)],
    "pentagon": [(0, 0), (2, 0), (2, 1), (1, 2), (0, 1)],
    "arrow": [(0, 0), (2, 2), (0, 4), (1, 2.5), (1, 1.5)],
    "C": [(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (3, 2), (3, 3), (0, 3)],
    "comb": [(0, 0), (7, 0), (7, 3), (6, 1), (5, 3), (4, 1), (3, 3), (2, 1), (1, 3), (0, 1)],
    "corners on edges": [(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (3, 2), (2, 2), (1, 2), (0, 2), (0, 1)],
    "star": [(np.cos(a) * r, np.sin(a) * r) for a, r in zip(np.arange(20) * np.pi / 10, [3, 1] * 10, strict=True)],
}


@pytest.mark.parametrize("tilt", TILTS)
@pytest.mark.parametrize("shape", SHAPES)
def test_shapes(shape: str, tilt: str) -> None:
    ring = in_space(SHAPES[shape], tilt)
    for start in range(len(ring)):
        assert_filled_once(np.roll(ring, start, axis=0))


def test_three_hundred_corners() -> None:
    angle = np.arange(300) * 2 * np.pi / 300
    assert_filled_once(np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1))
    spiral = np.where(np.arange(300) % 2, 1.0, 0.2)
    assert_filled_once(np.stack([np.cos(angle) * spiral, 0 * angle, np.sin(angle) * spiral], axis=1))


@settings(max_examples=60, deadline=None)
@given(st.integers(5, 14), st.integers(0, 10**6), st.sampled_from(sorted(TILTS)))
def test_star_shaped_polygons(count: int, seed: int, tilt: str) -> None:
    rng = np.random.default_rng(seed)
    angle = (np.arange(count) + rng.uniform(0, 0.8, count)) * 2 * np.pi / count
    radius = rng.uniform(0.2, 1.0, count)
    assert_filled_once(in_space(list(zip(np.cos(angle) * radius, np.sin(angle) * radius, strict=True)), tilt))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from(sorted(TILTS)))
def test_corners_on_edges_and_doubled_corners_are_kept(seed: int, tilt: str) -> None:
    """The clipper drops such corners; neighbours that share them would then come apart in motion."""
    rng = np.random.default_rng(seed)
    outline = [np.array(p, float) for p in [(0, 0), (4, 0), (4, 4), (2, 4), (2, 2), (0, 2)]]
    ring: list[NDArray[np.float64]] = []
    for a, b in zip(outline, [*outline[1:], outline[0]], strict=True):
        ring += [a, *(a + s * (b - a) for s in sorted(rng.random(rng.integers(0, 4))))]
        ring += [ring[-1]] if rng.random() < 0.15 else []
    points = in_space([(float(x), float(y)) for x, y in ring], tilt)
    assert_filled_once(np.roll(points, int(rng.integers(len(ring))), axis=0))


def test_a_quad_that_is_not_flat_is_cut_along_its_first_diagonal() -> None:
    bent = np.array([[0, 0, 0], [1, 0, 0.3], [1, 1, 0], [0, 1, 0.3]])
    np.testing.assert_array_equal(
        triangulate(bent, np.arange(4, dtype=np.int32), np.array([4], np.int32))[0], [[0, 1, 2], [0, 2, 3]]
    )


def test_polygons_keep_their_order() -> None:
    points = np.array([[x, y, 0] for y in range(3) for x in range(5)], float)
    corners = np.array([0, 1, 5, 1, 2, 7, 6, 5, 2, 3, 4, 9, 8, 7, 12, 11, 10], np.int32)
    counts = np.array([3, 4, 6, 4], np.int32)
    corners[3:7] = [1, 2, 7, 6]
    triangles, polygon, _ = triangulate(points, corners, counts)
    assert polygon.tolist() == [0, 1, 1, 2, 2, 2, 2, 3, 3]
    starts = np.cumsum(counts) - counts
    for triangle, owner in zip(triangles, polygon, strict=True):
        assert starts[owner] <= triangle.min()
        assert triangle.max() < starts[owner] + counts[owner]


DEGENERATE = {
    "a point": np.zeros((6, 3)),
    "a line": np.linspace(0, 1, 6)[:, None] * [1.0, 2.0, 3.0],
    "there and back": np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0, 0], [0, 0, 0]], float),
}


@pytest.mark.parametrize("ring", DEGENERATE.values(), ids=DEGENERATE)
def test_polygons_without_area_are_fanned_and_told(ring: NDArray[np.float64]) -> None:
    triangles, degenerate = cut(ring)
    assert degenerate == [0]
    np.testing.assert_array_equal(triangles, [[0, i, i + 1] for i in range(1, len(ring) - 1)])


def test_crossing_polygons_lose_no_corner() -> None:
    angle = np.arange(5) * 4 * np.pi / 5
    pentagram = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    bow = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0]], float)
    for ring in (pentagram, bow):
        triangles, _ = cut(ring)
        assert_fills([[(c, 0, 0) for c in t] for t in triangles.tolist()], [(c, 0, 0) for c in range(len(ring))])
