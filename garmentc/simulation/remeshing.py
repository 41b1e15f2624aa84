"""Tessellation: a dense surface to a mesh of the wanted density, as isotropic triangles or as rows of quads."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from garmentc.simulation.body_field import Array, Field
from garmentc.simulation.hems import slide_to_hem
from garmentc.simulation.surface import (
    Faces,
    Grid,
    averaging_matrix,
    boundary_edges,
    compact,
    edges_of,
    face_normals,
    vertex_normals,
)

_LLOYD_ROUNDS = 12
_DENOISE_ROUNDS = 3


class Reference:
    """A dense surface to project on; positions and normals together tell close sheets apart."""

    def __init__(self, vertices: Array, faces: Faces, length: float) -> None:
        from scipy.spatial import cKDTree

        self.length = length
        self.vertices, self.normals = vertices, vertex_normals(vertices, faces)
        self.tree = cKDTree(np.concatenate([vertices, length * self.normals], axis=1))

    def project(self, points: Array, normals: Array) -> Array:
        """`points` (P, 3) moved to the tangent planes of the samples nearest in position and normal."""
        _, index = self.tree.query(np.concatenate([points, self.length * normals], axis=1))
        normal = self.normals[index]
        return np.asarray(points - ((points - self.vertices[index]) * normal).sum(1, keepdims=True) * normal)


def triangle_mesh(
    vertices: Array, faces: Faces, count: int, stretch: tuple[float, float, float], rng: np.random.Generator
) -> tuple[Array, Faces]:
    """Remeshing to about `count` vertices by centroidal Voronoi clusters, cells `stretch`ed along x, y and z.

    The dense mesh's vertices are clustered by Lloyd's algorithm; the dual of the clusters is the new mesh (Valette and
    Chassery 2004). Positions and normals together keep clusters from spanning two sheets that lie close together.
    """
    from scipy.spatial import cKDTree

    normals = vertex_normals(vertices, faces)
    area = 0.5 * np.linalg.norm(face_normals(vertices, faces), axis=1)
    weight = np.bincount(faces.reshape(-1), np.repeat(area, 3), len(vertices)) / 3
    length = np.sqrt(area.sum() / count)
    scale = np.array(stretch)
    places = np.concatenate([vertices / scale, 0.3 * length * normals], axis=1)
    weight = weight / weight.sum()
    seeds = places[rng.choice(len(vertices), size=min(count, len(vertices)), replace=False, p=weight)]
    for _ in range(_LLOYD_ROUNDS):
        _, label = cKDTree(seeds).query(places)
        total = np.bincount(label, weight, len(seeds))
        sums = np.stack([np.bincount(label, weight * places[:, k], len(seeds)) for k in range(6)], 1)
        seeds = np.where(total[:, None] > 0, sums / np.maximum(total[:, None], 1e-30), seeds)
    _, label = cKDTree(seeds).query(places)
    label = _connected(label, edges_of(faces))
    dual = label[faces]
    dual = dual[(dual[:, 0] != dual[:, 1]) & (dual[:, 1] != dual[:, 2]) & (dual[:, 2] != dual[:, 0])]
    _, first = np.unique(np.sort(dual, axis=1), axis=0, return_index=True)
    return compact(seeds[:, :3] * scale, dual[np.sort(first)].astype(np.int32))


def _connected(label: NDArray[np.int64], edges: Faces) -> NDArray[np.int64]:
    """Labels (V,) with every cluster in one piece: smaller pieces join a neighbouring cluster."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    label = label.copy()
    same = edges[label[edges[:, 0]] == label[edges[:, 1]]]
    graph = coo_array((np.ones(len(same)), (same[:, 0], same[:, 1])), shape=(len(label), len(label)))
    _, piece = connected_components(graph, directed=False)
    size = np.bincount(piece)
    largest = np.zeros(label.max() + 1, dtype=np.int64)
    np.maximum.at(largest, label, size[piece])
    loose = size[piece] < largest[label]
    while loose.any():
        a, b = np.concatenate([edges, edges[:, ::-1]]).T
        reached = loose[a] & ~loose[b]
        if not reached.any():
            break
        label[a[reached]] = label[b[reached]]
        loose[a[reached]] = False
    return label


def row_mesh(grid: Grid, values: Array, steps: Array) -> tuple[Array, Faces]:
    """A mesh whose edges run in rows along the axes: naive surface nets (Gibson 1998) on cells of size `steps` (3,).

    grid, values  the field to mesh. Returns vertices and quads (Q, 4).
    """
    low = np.floor(grid.origin / steps).astype(int)
    high = np.ceil((grid.origin + grid.spacing * (np.array(grid.shape) - 1)) / steps).astype(int)
    axes = [steps[k] * np.arange(low[k], high[k] + 1) for k in range(3)]
    shape = tuple(len(axis) for axis in axes)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    sampled = grid.read(values, points.reshape(-1, 3)).reshape(shape)
    inside = sampled < 0
    cells = tuple(n - 1 for n in shape)
    total, crossings, quads = np.zeros((*cells, 3)), np.zeros(cells), []
    for k in range(3):
        # A grid edge along axis k whose ends differ in sign belongs to four cells and is dual to one quad.
        first = np.moveaxis(inside, k, 0)[:-1]
        second = np.moveaxis(inside, k, 0)[1:]
        i, j, h = np.nonzero(first != second)
        place = np.empty((len(i), 3), dtype=int)
        place[:, k], place[:, (k + 1) % 3], place[:, (k + 2) % 3] = (i, j, h) if k != 1 else (i, h, j)
        ahead = place.copy()
        ahead[:, k] += 1
        a, b = sampled[tuple(place.T)], sampled[tuple(ahead.T)]
        crossing = points[tuple(place.T)].copy()
        crossing[:, k] += steps[k] * a / (a - b)
        one, two = (k + 1) % 3, (k + 2) % 3
        limit = np.array(cells)
        interior = (place[:, [one, two]] > 0).all(1) & (place[:, [one, two]] < limit[[one, two]]).all(1)
        ring = []
        for shift in ((0, 0), (-1, 0), (-1, -1), (0, -1)):
            cell = place.copy()
            cell[:, one] += shift[0]
            cell[:, two] += shift[1]
            valid = ((cell >= 0) & (cell < limit)).all(1)
            np.add.at(total, tuple(cell[valid].T), crossing[valid])
            np.add.at(crossings, tuple(cell[valid].T), 1)
            ring.append(np.ravel_multi_index(tuple(np.clip(cell, 0, limit - 1).T), cells))
        quad = np.stack(ring, 1)
        quads.append(np.where((a < 0)[:, None], quad, quad[:, ::-1])[interior])
    vertices = (total / np.maximum(crossings, 1)[..., None]).reshape(-1, 3)
    return compact(vertices, np.concatenate(quads).astype(np.int32))


def split_quads(vertices: Array, quads: Faces) -> Faces:
    """Two triangles per quad (Q, 4), along the shorter diagonal."""
    a, b, c, d = quads.T
    short = np.linalg.norm(vertices[a] - vertices[c], axis=1) <= np.linalg.norm(vertices[b] - vertices[d], axis=1)
    first = np.where(short[:, None], np.stack([a, b, c], 1), np.stack([a, b, d], 1))
    second = np.where(short[:, None], np.stack([a, c, d], 1), np.stack([b, c, d], 1))
    return np.concatenate([first, second]).astype(np.int32)


def even_out(vertices: Array, quads: Faces, reference: Reference, passes: int) -> Array:
    """Tangential Laplacian smoothing of a quad mesh on the reference surface; the rim stays."""
    sides = np.sort(np.concatenate([quads[:, [k, (k + 1) % 4]] for k in range(4)]), axis=1)
    edges, count = np.unique(sides, axis=0, return_counts=True)
    mean = averaging_matrix(len(vertices), edges)
    inner = np.ones(len(vertices), dtype=bool)
    inner[edges[count == 1]] = False
    triangles = split_quads(vertices, quads)
    moved = reference.project(vertices, vertex_normals(vertices, triangles))
    for _ in range(passes):
        normals = vertex_normals(moved, triangles)
        step = 0.5 * (mean @ moved - moved) * inner[:, None]
        step -= (step * normals).sum(1, keepdims=True) * normals
        moved = reference.project(moved + step, normals)
    # Surface nets leave small steps; Taubin's two-sided smoothing (1995) takes them without shrinking the cloth.
    for amount in (0.5, -0.52) * _DENOISE_ROUNDS:
        moved = moved + amount * inner[:, None] * (mean @ moved - moved)
    return moved


def relax(vertices: Array, faces: Faces, keep: Field, reference: Reference, reach: float, passes: int = 4) -> Array:
    """Even out the triangles within `reach` of a hem: interior vertices move towards their neighbours' mean along the
    surface, hem vertices along the hem."""
    edges, rim_edges = edges_of(faces), boundary_edges(faces)
    mean = averaging_matrix(len(vertices), edges)
    rim_mean = averaging_matrix(len(vertices), rim_edges)
    rim = np.zeros(len(vertices), dtype=bool)
    rim[rim_edges] = True
    moved = vertices
    chosen = keep(vertices)[:, None] < reach
    for _ in range(passes):
        normals = vertex_normals(moved, faces)
        step = chosen * np.where(rim[:, None], 0.4 * (rim_mean @ moved - moved), 0.5 * (mean @ moved - moved))
        step -= (step * normals).sum(1, keepdims=True) * normals
        moved = reference.project(moved + step, normals)
        slid, _ = slide_to_hem(moved[rim], normals[rim], keep, reference.length)
        moved[rim] = slid
    return moved
