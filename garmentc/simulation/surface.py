"""From an implicit solid to a well-shaped triangle mesh of the part that is cloth."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.simulation.body_field import Array, Field

Faces = NDArray[np.int32]


class Grid:
    """A scalar field sampled on a regular grid, read back by trilinear interpolation."""

    def __init__(self, bounds: Array, spacing: float) -> None:
        # The mid-plane is a grid plane: the slit between two trouser legs is thinner than a cell.
        self.spacing = spacing
        low = np.floor(bounds[0] / spacing).astype(int) - 1
        high = np.ceil(bounds[1] / spacing).astype(int) + 1
        self.shape = tuple(int(n) for n in high - low + 1)
        self.origin = low * spacing
        axes = [self.origin[k] + spacing * np.arange(self.shape[k]) for k in range(3)]
        self.points: Array = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)

    def sample(self, field: Field, band: float = 0.035) -> Array:
        """Values (P,) at the grid points: exact within `band` of the surface, coarse elsewhere."""
        from scipy.ndimage import zoom

        shape = self.shape
        coarse_shape = tuple((n + 2) // 3 + 1 for n in shape)
        axes = [self.origin[k] + 3 * self.spacing * np.arange(coarse_shape[k]) for k in range(3)]
        coarse = field(np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)).reshape(coarse_shape)
        fine_shape = [3 * (n - 1) + 1 for n in coarse_shape]
        values = zoom(coarse, [f / c for f, c in zip(fine_shape, coarse_shape, strict=True)], order=1, grid_mode=False)
        values = np.ascontiguousarray(values[: shape[0], : shape[1], : shape[2]]).reshape(-1)
        near = np.abs(values) < band
        values[near] = field(self.points[near])
        return values

    def read(self, values: Array, points: Array) -> Array:
        """Interpolated values (P,) at `points` (P, 3)."""
        from scipy.ndimage import map_coordinates

        place = (points - self.origin) / self.spacing
        return np.asarray(map_coordinates(values.reshape(self.shape), place.T, order=1, mode="nearest"))

    def gradient(self, values: Array, points: Array) -> Array:
        """Unit gradient (P, 3) by central differences."""
        step = 0.5 * self.spacing
        columns = []
        for k in range(3):
            shift = np.zeros(3)
            shift[k] = step
            columns.append(self.read(values, points + shift) - self.read(values, points - shift))
        gradient = np.stack(columns, 1)
        return np.asarray(gradient / np.maximum(np.linalg.norm(gradient, axis=1, keepdims=True), 1e-12))

    def isosurface(self, values: Array) -> tuple[Array, Faces]:
        """Marching cubes at zero, triangles facing outwards (towards positive values)."""
        import igl

        order = np.ascontiguousarray(np.transpose(values.reshape(self.shape), (2, 1, 0))).reshape(-1)
        places = np.ascontiguousarray(np.transpose(self.points.reshape(*self.shape, 3), (2, 1, 0, 3))).reshape(-1, 3)
        vertices, faces = igl.marching_cubes(order, places, *self.shape, 0.0)[:2]
        return compact(vertices, faces.astype(np.int32))


def compact(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """Drop vertices that no face uses."""
    used = np.zeros(len(vertices), dtype=bool)
    used[faces] = True
    number = np.cumsum(used) - 1
    return vertices[used], number[faces].astype(np.int32)


def edges_of(faces: Faces) -> NDArray[np.int32]:
    """Undirected edges (E, 2), sorted and unique."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.unique(np.sort(pairs, axis=1), axis=0)


def boundary_edges(faces: Faces) -> NDArray[np.int32]:
    """Edges (B, 2) of exactly one face."""
    pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges, count = np.unique(pairs, axis=0, return_counts=True)
    return np.asarray(edges[count == 1])


def face_normals(vertices: Array, faces: Faces) -> Array:
    """(F, 3), as long as twice the area."""
    corners = vertices[faces]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def vertex_normals(vertices: Array, faces: Faces) -> Array:
    """Unit area-weighted normals (V, 3)."""
    from scipy.sparse import coo_array

    rows = faces.reshape(-1)
    columns = np.repeat(np.arange(len(faces)), 3)
    gather = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(vertices), len(faces))).tocsr()
    normal = np.asarray(gather @ face_normals(vertices, faces))
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30))


def averaging_matrix(vertex_count: int, edges: NDArray[np.int32]) -> Any:
    """Sparse (V, V): each row takes the mean of a vertex's neighbours (itself where it has none)."""
    from scipy.sparse import coo_array, diags_array, eye_array

    rows = np.concatenate([edges[:, 0], edges[:, 1]])
    columns = np.concatenate([edges[:, 1], edges[:, 0]])
    adjacency = coo_array((np.ones(len(rows)), (rows, columns)), shape=(vertex_count, vertex_count)).tocsr()
    degree = np.asarray(adjacency.sum(1))
    alone = diags_array((degree == 0).astype(float))
    return diags_array(1 / np.maximum(degree, 1)) @ adjacency + alone @ eye_array(vertex_count)


def tighten(vertices: Array, faces: Faces, grid: Grid, values: Array, passes: int, split: float | None) -> Array:
    """Pull cloth taut over hollows: Laplacian smoothing that may not enter the solid.

    Below `split` each side of the mid-plane stays on its side.
    """
    mean = averaging_matrix(len(vertices), edges_of(faces))
    rim = np.unique(boundary_edges(faces))
    fixed = vertices[rim]
    below = np.zeros(len(vertices), dtype=bool) if split is None else vertices[:, 1] < split - 0.002
    side = np.sign(vertices[:, 0])
    moved = vertices
    for _ in range(passes):
        moved = moved + 0.6 * (mean @ moved - moved)
        depth = np.minimum(grid.read(values, moved), 0)
        inside = depth < 0
        moved[inside] -= depth[inside, None] * grid.gradient(values, moved[inside])
        moved[rim] = fixed
        moved[below, 0] = side[below] * np.maximum(side[below] * moved[below, 0], 0.001)
    return moved


def subdivide(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """Each triangle into four."""
    pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges, number = np.unique(pairs, axis=0, return_inverse=True)
    ab, bc, ca = (number.reshape(3, -1) + len(vertices)).astype(np.int32)
    a, b, c = faces.T
    parts = [np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return np.concatenate([vertices, vertices[edges].mean(1)]), np.concatenate(parts).astype(np.int32)


def non_manifold(faces: Faces) -> bool:
    """True where an edge has more than two faces, two faces of an edge disagree, or a vertex joins two fans."""
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    if len(np.unique(directed, axis=0)) < len(directed):
        return True
    # A fan of k faces has k + 1 neighbours if open, k if closed; a vertex with two fans has more.
    degree = np.bincount(edges_of(faces).reshape(-1))
    around = np.bincount(faces.reshape(-1))
    rim = np.bincount(boundary_edges(faces).reshape(-1), minlength=len(around))
    return bool((rim > 2).any() or (degree - around != (rim > 0)).any())
