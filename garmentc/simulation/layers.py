"""Keeping cloth outside the body and outer layers outside inner ones."""

from __future__ import annotations

import numpy as np

from garmentc.simulation.body_field import Array, RestBody
from garmentc.simulation.surface import Faces, boundary_edges, edges_of, vertex_normals

MIN_CLEARANCE = 0.0015
"""Smallest distance of a vertex to the body at rest, metres."""

_MIDPOINT_CLEARANCE = 0.0007
_NEAR = 0.008
"""Cloth further away than this needs no second look."""

LAYER_CLEARANCE = 0.001
"""Smallest distance of an outer layer's vertex to the layer below, metres."""

_FACING = 0.2
"""Two layers are compared only where their normals agree this much (cosine)."""

Piece = tuple[Array, Faces]


def push_from_body(vertices: Array, faces: Faces, body: RestBody, rounds: int = 12) -> Array:
    """Vertices moved out until each is MIN_CLEARANCE outside the body; edge midpoints are kept outside where possible.

    Raises ValueError where the rounds do not suffice.
    """
    moved = _outside_bumps(vertices, faces, body)
    edges = edges_of(faces)
    near_edges = np.arange(len(edges))
    near = np.arange(len(moved))
    for last in range(rounds):
        pushed = False
        if last < rounds // 2 and len(near_edges):
            depth, away = body.closest(moved[edges[near_edges]].mean(1))
            push = np.maximum(_MIDPOINT_CLEARANCE - depth, 0)[:, None] * away
            pushed = bool((depth < _MIDPOINT_CLEARANCE).any())
            total, count = np.zeros_like(moved), np.zeros(len(moved))
            for k in range(2):
                np.add.at(total, edges[near_edges, k], push)
                np.add.at(count, edges[near_edges, k], depth < _MIDPOINT_CLEARANCE)
            moved += total / np.maximum(count, 1)[:, None]
            near_edges = near_edges[depth < _NEAR]
        distance, away = body.closest(moved[near])
        short = distance < MIN_CLEARANCE
        if not short.any() and not pushed:
            return moved
        moved[near[short]] += (MIN_CLEARANCE + 2e-5 - distance[short])[:, None] * away[short]
        near = near[distance < _NEAR]
    if (body.exact_distance(moved) < MIN_CLEARANCE).any():
        raise ValueError("cloth is caught in a fold of the body that it cannot leave")
    return moved


def _outside_bumps(vertices: Array, faces: Faces, body: RestBody, rounds: int = 4) -> Array:
    """Vertices moved out where a vertex of the body pokes through a triangle, far from the triangle's corners."""
    low, high = vertices.min(0) - 0.01, vertices.max(0) + 0.01
    near = ((body.vertices > low) & (body.vertices < high)).all(1)
    normals = vertex_normals(body.vertices, body.faces)[near]
    moved = vertices.copy()
    for _ in range(rounds):
        distance, normal, corners = _against(body.vertices[near], (moved, faces))
        out = (distance > -_MIDPOINT_CLEARANCE) & (distance < 0.015) & ((normals * normal).sum(1) > 0.2)
        if not out.any():
            break
        push, count = np.zeros_like(moved), np.zeros(len(moved))
        for k in range(3):
            np.add.at(push, corners[out, k], (distance[out] + 2 * _MIDPOINT_CLEARANCE)[:, None] * normal[out])
            np.add.at(count, corners[out, k], 1)
        moved += push / np.maximum(count, 1)[:, None]
    return moved


def _against(points: Array, mesh: Piece) -> tuple[Array, Array, Faces]:
    """Signed distance (P,) to an open mesh, the mesh normal (P, 3) and the nearest triangle's corners (P, 3).

    Where the nearest point lies on the mesh's own hem there is no inside; the distance is NaN.
    """
    import igl

    vertices, faces = mesh
    signed, index, nearest, normal = igl.signed_distance(
        points, vertices, faces.astype(np.int64), sign_type=igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    )
    corners = faces[index]
    rim = np.zeros(len(vertices), dtype=bool)
    rim[boundary_edges(faces)] = True
    # On an edge between two hem vertices: far stricter than needed, but hems need no layering.
    at = vertices[corners]
    area = np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
    weight = np.stack(
        [
            (np.cross(at[:, (k + 1) % 3] - nearest, at[:, (k + 2) % 3] - nearest) * area).sum(1)
            / np.maximum((area * area).sum(1), 1e-30)
            for k in range(3)
        ],
        1,
    )
    on_hem = (rim[corners] | (weight < 1e-6)).all(1)
    return np.where(on_hem, np.nan, signed), normal, corners


def _probes(vertices: Array, faces: Faces) -> tuple[Array, Faces, Array]:
    """Points (P, 3) to test (vertices and quarters of edges), their edges' ends (P, 2) and their normals (P, 3)."""
    edges = edges_of(faces)
    alone = np.repeat(np.arange(len(vertices), dtype=np.int32)[:, None], 2, axis=1)
    ends = np.concatenate([alone, edges, edges, edges])
    share = np.repeat([0.5, 0.25, 0.5, 0.75], [len(alone), len(edges), len(edges), len(edges)])[:, None]
    points = vertices[ends[:, 0]] * (1 - share) + vertices[ends[:, 1]] * share
    normals = vertex_normals(vertices, faces)[ends].sum(1)
    return points, ends, normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def separate(pieces: list[Piece], body: RestBody, rounds: int = 15) -> list[Piece]:
    """Garments, innermost first, with every outer one pushed outside the inner ones. Only outer layers move."""
    result = [pieces[0]]
    for vertices, faces in pieces[1:]:
        moved = vertices.copy()
        for _ in range(rounds):
            push, count = np.zeros_like(moved), np.zeros(len(moved))
            for inner in result:
                # Vertices and edges of either layer against the triangles of the other.
                outer_points, ends, facing_to = _probes(moved, faces)
                distance, normal, _ = _against(outer_points, inner)
                facing = (facing_to * normal).sum(1) > _FACING
                short = (distance < LAYER_CLEARANCE) & (distance > -0.03) & facing
                for k in range(2):
                    np.add.at(push, ends[short, k], (LAYER_CLEARANCE + 2e-4 - distance[short])[:, None] * normal[short])
                    np.add.at(count, ends[short, k], 1)
                inner_points, _, facing_to = _probes(*inner)
                distance, normal, corners = _against(inner_points, (moved, faces))
                facing = (facing_to * normal).sum(1) > _FACING
                out = (distance > -0.3 * LAYER_CLEARANCE) & (distance < 0.03) & facing
                for k in range(3):
                    np.add.at(push, corners[out, k], (distance[out] + LAYER_CLEARANCE)[:, None] * normal[out])
                    np.add.at(count, corners[out, k], 1)
            if not count.any():
                break
            moved += push / np.maximum(count, 1)[:, None]
        result.append((push_from_body(moved, faces, body), faces))
    return result
