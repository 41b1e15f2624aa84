"""Bend the blend shapes so that the outfit stays outside its body."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.anchors import Anchors
from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.body_contacts import Contacts, find_contacts, wanted_clearance
from garmentc.passes.part_of_rig import side_by_side, take_vertices
from garmentc.passes.pose_set import PoseSet
from garmentc.passes.posed_error import posed_error
from garmentc.passes.report import PassReport
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel

_VALUES_AT_ONCE = 2_000_000
_CHECKED = 8


@dataclass(frozen=True)
class ResolveCollisions:
    """How hard to try.

    clearance   metres that cloth should keep from the skin; cloth that is closer at rest may stay closer
    poses       how many poses to look at
    anchors     vertices to look at; those between them move with them
    iterations  rounds of pushing out what is still too close
    ridge       how much movement must be worth it, relative to the keys' own size; more generalises better
    smoothing   rounds of carrying a push over to the vertices around it
    """

    clearance: float = 0.006
    poses: int = 40
    anchors: int = 2000
    iterations: int = 4
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
    fit = poses.some(options.poses)
    anchors = Anchors.of(rig, options.anchors)
    part = take_vertices(rig, anchors.rows)
    with single_threaded_blas():
        wanted = wanted_clearance(part, body, betas, options.clearance)
        contacts = find_contacts(part, body, betas, fit)
        added = _pushed_out(contacts, wanted, rig.pose_keys(fit), anchors.smoother, options)
        resolved = replace(rig, blend_shapes=_plus(rig.blend_shapes, added, anchors), blend_normals=None)
        both = side_by_side(part, take_vertices(resolved, anchors.rows))
        inside = find_contacts(both, body, betas, poses.check[:_CHECKED]).clearance < 0
    before, after = (100 * float(half.mean()) for half in np.split(inside, 2, axis=1))
    moved = posed_error(rig, resolved, poses.check)
    detail = f"about {before:.2f} % of the vertices inside the body before, {after:.2f} % after; moved {moved}"
    return resolved, PassReport("resolve collisions", detail)


def _pushed_out(
    contacts: Contacts,
    wanted: NDArray[np.float32],
    keys: NDArray[np.float64],
    smoother: Any,
    options: ResolveCollisions,
) -> NDArray[np.float32]:
    """Shapes (M, n, 3) to add, so that keys (P, M) times them keep the vertices at the `wanted` clearances (n,)."""
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
        lacking = wanted - contacts.clearance - np.einsum("pni,pni->pn", contacts.gradient, moved)
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


def _plus(shapes: NDArray[Any], added: NDArray[np.float32], anchors: Anchors) -> NDArray[np.float32]:
    """Blend shapes (M, N, 3) plus what is added to those of the anchors (M, n, 3), carried over to all vertices."""
    result = np.array(shapes, dtype=np.float32)
    by_anchor = np.ascontiguousarray(added.transpose(1, 0, 2)).reshape(added.shape[1], -1)
    for rows, interpolator in anchors.interpolators(max(1, _VALUES_AT_ONCE // (3 * len(shapes)))):
        result[:, rows] += (interpolator @ by_anchor).reshape(-1, len(shapes), 3).transpose(1, 0, 2)
    return result
