"""Bend the blend shapes so that the outfit stays outside its body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import vertex_normals
from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.body_contacts import Contacts, find_contacts
from garmentc.passes.pose_set import PoseSet
from garmentc.passes.posed_error import posed_error, spread_vertices, take_vertices
from garmentc.passes.report import PassReport
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel

_NORMAL_REACH = 0.05
_NEIGHBOURS = 6
_VALUES_AT_ONCE = 2_000_000
_CHECKED = 16


@dataclass(frozen=True)
class ResolveCollisions:
    """How hard to try.

    clearance   metres that cloth should keep from the skin
    poses       how many poses to look at
    anchors     vertices to look at; those between them move with them
    iterations  rounds of pushing out what is still too close
    ridge       how much movement must be worth it, relative to the keys' own size; more generalises better
    smoothing   rounds of carrying a push over to the vertices around it
    """

    clearance: float = 0.003
    poses: int = 64
    anchors: int = 2500
    iterations: int = 6
    ridge: float = 3.0
    smoothing: int = 3


def resolve_collisions(
    rig: Rig, options: ResolveCollisions, poses: PoseSet, body: BodyModel, betas: NDArray[Any] | None = None
) -> tuple[Rig, PassReport]:
    """Add to the blend shapes what pushes vertices out of the body in the poses to fit.

    In every pose the vertices too close to the skin get a rest-space displacement that brings them out along the
    skin's normal. Those displacements are regressed on the keys that the rig already has (ridge least squares, one
    matrix for all vertices), so nothing is added at run time, and the rest pose stays as it is because keys are 0
    there. What is left over is pushed again.
    """
    if rig.keys is None or not rig.morph_count:
        return rig, PassReport("resolve collisions", "no blend shapes that could do it")
    fit = poses.fit[:: max(1, len(poses.fit) // options.poses)][: options.poses]
    rows = spread_vertices(rig.vertex_count, options.anchors)
    places = _places(rig)
    with single_threaded_blas():
        anchors = take_vertices(rig, rows)
        contacts = find_contacts(anchors, body, betas, fit)
        keys = rig.pose_keys(np.asarray(fit, np.float64))
        added = _pushed_out(contacts, keys, _smoother(places[rows]), options)
        resolved = replace(rig, blend_shapes=_spread(rig.blend_shapes, added, places, rows), blend_normals=None)
        both = _side_by_side(anchors, take_vertices(resolved, rows))
        inside = find_contacts(both, body, betas, poses.check[:_CHECKED]).clearance < 0
    before, after = (100 * float(half.mean()) for half in np.split(inside, 2, axis=1))
    moved = posed_error(rig, resolved, poses.check)
    detail = f"about {before:.2f} % of the vertices inside the body before, {after:.2f} % after; moved {moved}"
    return resolved, PassReport("resolve collisions", detail)


def _side_by_side(first: Rig, second: Rig) -> Rig:
    """Two rigs with the same keys as one, so that the body is posed once."""
    return replace(
        first,
        template=np.concatenate([first.template, second.template]),
        weights=np.concatenate([first.weights, second.weights]),
        blend_shapes=np.concatenate([first.blend_shapes, second.blend_shapes], axis=1),
    )


def _places(rig: Rig) -> NDArray[np.float64]:
    """(N, 6): rest positions and scaled normals. Opposite sides of a gap are far apart in it, so nothing leaks over."""
    template = rig.template.astype(np.float64)
    return np.concatenate([template, _NORMAL_REACH * vertex_normals(template, rig.triangles)], axis=1)


def _smoother(places: NDArray[np.float64]) -> Any:
    """Sparse (n, n): the mean of each vertex's nearest others."""
    from scipy.sparse import csr_matrix
    from scipy.spatial import cKDTree

    count = min(_NEIGHBOURS + 1, len(places))
    nearest = cKDTree(places).query(places, k=np.arange(1, count + 1))[1]
    share = np.full(nearest.size, 1 / count, dtype=np.float32)
    return csr_matrix((share, (np.repeat(np.arange(len(places)), count), nearest.ravel())), shape=(len(places),) * 2)


def _pushed_out(
    contacts: Contacts, keys: NDArray[np.float64], smoother: Any, options: ResolveCollisions
) -> NDArray[np.float32]:
    """Shapes (M, n, 3) to add, so that keys (P, M) times them keep the vertices out."""
    pose_count, key_count = keys.shape
    vertex_count = contacts.clearance.shape[1]
    moment = keys.T @ keys / pose_count
    moment += options.ridge * np.trace(moment) / key_count * np.eye(key_count)
    regress = np.linalg.solve(moment, keys.T / pose_count).astype(np.float32)
    keys32 = keys.astype(np.float32)
    length = np.maximum(np.einsum("pni,pni->pn", contacts.gradient, contacts.gradient), 1e-6)
    shapes = np.zeros((key_count, vertex_count * 3), dtype=np.float32)
    for _ in range(options.iterations):
        moved = (keys32 @ shapes).reshape(pose_count, vertex_count, 3)
        lacking = options.clearance - contacts.clearance - np.einsum("pni,pni->pn", contacts.gradient, moved)
        push = contacts.gradient * (np.maximum(lacking, 0) / length)[:, :, None]
        shapes += regress @ _smoothed(push, lacking > 0, smoother, options.smoothing)
    return shapes.reshape(key_count, vertex_count, 3)


def _smoothed(push: NDArray[np.float32], pushed: NDArray[np.bool_], smoother: Any, rounds: int) -> NDArray[np.float32]:
    """Pushes (P, n, 3) carried over to the vertices that are not `pushed` (P, n) themselves; returns (P, 3 n)."""
    by_vertex = np.ascontiguousarray(push.transpose(1, 0, 2))
    own = pushed.T[:, :, None]
    field = by_vertex
    for _ in range(rounds):
        around = (smoother @ field.reshape(len(field), -1)).reshape(field.shape)
        field = np.where(own, by_vertex, around)
    return np.ascontiguousarray(field.transpose(1, 0, 2)).reshape(len(push), -1)


def _spread(
    shapes: NDArray[Any], added: NDArray[np.float32], places: NDArray[np.float64], rows: NDArray[np.intp]
) -> NDArray[np.float32]:
    """Blend shapes (M, N, 3) plus those of the anchors `rows` (M, n, 3), interpolated between the nearest anchors."""
    from scipy.spatial import cKDTree

    result = np.array(shapes, dtype=np.float32)
    if len(rows) == shapes.shape[1]:
        result += added
        return result
    tree = cKDTree(places[rows])
    size = max(1, _VALUES_AT_ONCE // (3 * len(shapes)))
    for start in range(0, shapes.shape[1], size):
        distance, nearest = tree.query(places[start : start + size], k=4)
        share = 1 / np.maximum(distance, 1e-9) ** 2
        share /= share.sum(axis=1, keepdims=True)
        for column in range(4):
            result[:, start : start + size] += added[:, nearest[:, column]] * share[:, column, None].astype(np.float32)
    return result
