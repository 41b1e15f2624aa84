"""Procedural outfits: clothes grown from the body, to train networks on and to simulate.

    parameters = sample_parameters(seed)
    outfit = generate_outfit(parameters, load_body(None, parameters.gender))

Per garment: an implicit solid around the body (patterns), its surface pulled taut over the body's hollows, remeshed to
the wanted density, cut at its hems, and pushed to a safe distance from the body and from the layers below.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from garmentc.simulation.body_field import Array, RestBody
from garmentc.simulation.brims import add_brim
from garmentc.simulation.hems import split_at, trim
from garmentc.simulation.layers import push_from_body, separate
from garmentc.simulation.outfit_parameters import CATEGORIES, GarmentParameters, OutfitParameters
from garmentc.simulation.outfit_sampling import sample_parameters
from garmentc.simulation.patterns import Pattern, keep_function, make_pattern
from garmentc.simulation.remeshing import Reference, even_out, relax, row_mesh, split_quads, triangle_mesh
from garmentc.simulation.slivers import mend_slivers
from garmentc.simulation.surface import (
    Faces,
    Grid,
    compact,
    face_normals,
    non_manifold,
    subdivide,
    tighten,
    vertex_normals,
)
from garmentc.smpl.body import BodyModel

__all__ = [
    "CATEGORIES",
    "GarmentParameters",
    "GeneratedOutfit",
    "OutfitParameters",
    "generate_outfit",
    "sample_parameters",
]

_FINE_KINDS = ("feet", "mittens", "band", "hat", "hood")
_LAYER_GAP = 0.003
_COARSEST_ROWS = 0.036
"""Rows of larger cells would lose sleeves."""


@dataclass(frozen=True)
class GeneratedOutfit:
    """An outfit on a body at rest.

    vertices        (N, 3) float64, metres, in the T-pose and axes of the body
    triangles       (F, 3) int32, facing outwards, manifold with hems as boundaries
    triangle_part   (F,) int32 index into `part_names`, innermost garment first
    """

    vertices: Array
    triangles: Faces
    triangle_part: NDArray[np.int32]
    part_names: tuple[str, ...]
    parameters: OutfitParameters

    @property
    def category(self) -> str:
        return self.parameters.category


def generate_outfit(parameters: OutfitParameters, body: BodyModel) -> GeneratedOutfit:
    """Make the outfit on `body` (its gender should be the parameters') with the parameters' shape.

    Deterministic. Every vertex is at least 1.5 mm outside the body; outer layers lie outside inner ones.
    Raises ValueError where the parameters leave no cloth (a hem above the neckline, say).
    """
    rest = RestBody.of(body, np.asarray(parameters.betas))
    patterns: list[Pattern] = []
    dense: list[_Dense] = []
    for garment in parameters.garments:
        pattern = _over(make_pattern(rest, garment), patterns)
        patterns.append(pattern)
        dense.append(_dense_surface(rest, pattern, garment, parameters.vertex_count))
    areas = [surface.area for surface in dense]
    if min(areas) <= 0:
        raise ValueError(f"outfit {parameters.seed}: a garment has no surface; its hems leave nothing")
    pieces = []
    for surface, area in zip(dense, areas, strict=True):
        count = max(round(parameters.vertex_count * area / sum(areas)), 60)
        vertices, faces = _cloth(surface, rest, count, parameters.seed)
        pieces.append((push_from_body(vertices, faces, rest), faces))
    pieces = separate(pieces, rest)
    start = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
    return GeneratedOutfit(
        np.concatenate([vertices for vertices, _ in pieces]),
        np.concatenate([faces + offset for (_, faces), offset in zip(pieces, start, strict=False)]).astype(np.int32),
        np.concatenate([np.full(len(faces), i, dtype=np.int32) for i, (_, faces) in enumerate(pieces)]),
        tuple(pattern.name for pattern in patterns),
        parameters,
    )


def _over(pattern: Pattern, lower: list[Pattern]) -> Pattern:
    """The pattern grown so that its solid holds the garments below it, as far as they reach."""
    if not lower:
        return pattern
    below = tuple(lower)

    def solid(points: Array, distance: Array) -> Array:
        value = pattern.solid(points, distance)
        for inner in below:
            beyond = np.maximum(-inner.keep(points) - 0.01, 0)
            value = np.minimum(value, inner.solid(points, distance) - _LAYER_GAP + 0.5 * beyond)
        return value

    bounds = pattern.bounds + np.array([[-1], [1]]) * 0.015 * len(lower)
    return Pattern(pattern.name, solid, pattern.keep, bounds, pattern.split)


@dataclass(frozen=True)
class _Dense:
    """A garment's solid on a grid and its finely sampled, taut surface."""

    pattern: Pattern
    garment: GarmentParameters
    grid: Grid
    values: Array
    vertices: Array
    faces: Faces

    @property
    def area(self) -> float:
        """Square metres of cloth."""
        area = 0.5 * np.linalg.norm(face_normals(self.vertices, self.faces), axis=1)
        return float(area[self.pattern.keep(self.vertices[self.faces].mean(1)) > 0].sum())


def _dense_surface(body: RestBody, pattern: Pattern, garment: GarmentParameters, vertex_count: int) -> _Dense:
    spacing = 0.006 if garment.kind in _FINE_KINDS else 0.009
    grid = Grid(pattern.bounds, spacing)
    values = grid.sample(lambda points: pattern.solid(points, body.distance(points)))
    vertices, faces = grid.isosurface(values)
    vertices = tighten(vertices, faces, grid, values, garment.tautness, pattern.split)
    while len(vertices) < 8 * vertex_count:
        vertices, faces = subdivide(vertices, faces)
    return _Dense(pattern, garment, grid, values, vertices, faces)


def _cloth(dense: _Dense, body: RestBody, count: int, seed: int) -> tuple[Array, Faces]:
    """Tessellate, cut and even out one garment.

    Where a tessellation is not manifold, it is tried again with other cells.
    """
    area, brim = dense.area, dense.garment.brim
    count = round(count * area / (area + brim * (0.6 + np.pi * brim)))  # a brim takes its share
    length = float(np.sqrt(area / count / 0.866))
    keep = dense.pattern.keep
    if 0 < dense.garment.opening < length:
        # An opening narrower than an edge could not be cut.
        keep = keep_function(body, replace(dense.garment, opening=length))
    vertices, faces = split_at(dense.vertices, dense.faces, keep(dense.vertices) + 1.5 * length)
    reference = Reference(vertices, faces, length)
    for attempt in range(8):
        if dense.garment.tessellation == "rows" and length < _COARSEST_ROWS and attempt < 4:
            fresh, triangles = _rows(dense, reference, count, attempt)
            reach = 1.5 * length
        else:
            rng = np.random.default_rng([seed, attempt])
            total = 0.5 * np.linalg.norm(face_normals(vertices, faces), axis=1).sum()
            fresh, triangles = triangle_mesh(vertices, faces, round(count * total / area), dense.garment.stretch, rng)
            fresh = reference.project(fresh, vertex_normals(fresh, triangles))
            reach = np.inf
        fresh, triangles = _largest_pieces(*trim(fresh, triangles, keep, length))
        if not non_manifold(triangles):
            break
    else:
        raise ValueError(f"outfit {seed}: no manifold mesh with {count} vertices; ask for more")
    fresh, triangles = mend_slivers(relax(fresh, triangles, keep, reference, reach), triangles)
    if brim > 0:
        fresh, triangles = add_brim(fresh, triangles, brim, length)
    return fresh, triangles


def _rows(dense: _Dense, reference: Reference, count: int, attempt: int) -> tuple[Array, Faces]:
    """The garment with a margin as rows of quads, about `count` vertices of it cloth."""
    steps = np.sqrt(1.3 * dense.area / count) * np.array(dense.garment.stretch) * (1 - 0.04 * attempt)
    for _ in range(2):
        vertices, quads = row_mesh(dense.grid, dense.values, steps)
        steps = steps * np.sqrt(max((dense.pattern.keep(vertices) > 0).sum(), 1) / count)
    vertices, quads = row_mesh(dense.grid, dense.values, steps)
    inside = dense.pattern.keep(vertices)[quads].max(1) > -1.2 * reference.length
    vertices, quads = compact(vertices, quads[inside])
    vertices = even_out(vertices, quads, reference, 10)
    return vertices, split_quads(vertices, quads)


def _largest_pieces(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """Without the crumbs that a cut may leave: components below a tenth of the largest one's size."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(vertices)
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    _, label = connected_components(coo_array((np.ones(len(pairs)), pairs.T), shape=(n, n)), directed=False)
    size = np.bincount(label[faces[:, 0]])
    return compact(vertices, faces[size[label[faces[:, 0]]] >= 0.1 * size.max()])
