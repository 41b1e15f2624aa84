"""Bend the blend shapes so that the outfit stays outside its body, and its edges as long as they are."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import edges
from garmentc.passes.anchors import Anchors
from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.body_contacts import find_contacts, wanted_clearance
from garmentc.passes.part_of_rig import side_by_side, take_vertices
from garmentc.passes.pose_set import PoseSet
from garmentc.passes.posed_cloth import PosedCloth
from garmentc.passes.posed_error import posed_error
from garmentc.passes.report import PassReport
from garmentc.passes.springs import Springs
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel

_VALUES_AT_ONCE = 2_000_000
_POSES_AT_ONCE = 16
_CHECKED = 8


@dataclass(frozen=True)
class ResolveCollisions:
    """How hard to try.

    clearance   metres that cloth should keep from the skin; cloth that is closer at rest may stay closer
    poses       how many poses to look at
    anchors     vertices to look at; those between them move with them
    iterations  rounds of bringing edges back to their lengths and pushing out what is too close
    ridge       how much movement must be worth it, relative to the keys' own size; with less, shapes grow so large that
                single precision shows at rest
    relaxation  how far a round brings edges back, of the step that would do for an edge alone
    smoothing   how far a round brings the movement of vertices to that of their neighbours; keeps cloth from crumpling
    momentum    how much of a round's movement the next one goes on with

    Rounds settle on any mesh, even a lace, where relaxation + 2 smoothing < 1 + 1 / (1 + 2 momentum).
    """

    clearance: float = 0.012
    poses: int = 400
    anchors: int = 3000
    iterations: int = 8
    ridge: float = 0.2
    relaxation: float = 1.0
    smoothing: float = 0.2
    momentum: float = 0.7


def resolve_collisions(
    rig: Rig, options: ResolveCollisions, poses: PoseSet, body: BodyModel, betas: NDArray[Any] | None = None
) -> tuple[Rig, PassReport]:
    """Add to the blend shapes what keeps vertices out of the body and edges at their lengths, in the poses to fit.

    In every pose, vertices get a rest-space displacement that brings the edges they are at back to the lengths of the
    rest pose, as springs (position-based dynamics, Mueller et al. 2007, averaged over a vertex's edges), and those too
    close to the skin another that brings them out along its normal. Those displacements are regressed on the keys that
    the rig already has (ridge least squares, one matrix for all vertices), so nothing is added at run time, and the
    rest pose stays as it is because keys are 0 there. What is left over is moved again.
    """
    if rig.keys is None or not rig.morph_count:
        return rig, PassReport("resolve collisions", "no blend shapes that could do it")
    fit = poses.some(options.poses)
    keys = rig.pose_keys(fit)
    if not keys.any():  # a bundle of blend weights alone
        return rig, PassReport("resolve collisions", "no pose keys that move")
    anchors = Anchors.of(rig, options.anchors)
    part = take_vertices(rig, anchors.rows)
    springs = Springs.of(part.template, anchors.joined(edges(rig.triangles)))
    with single_threaded_blas():
        wanted = wanted_clearance(part, body, betas, options.clearance)
        contacts = find_contacts(part, body, betas, fit)
        blocks = [slice(start, start + _POSES_AT_ONCE) for start in range(0, len(fit), _POSES_AT_ONCE)]
        cloth = [PosedCloth.of(part, fit[block], contacts.of_poses(block)) for block in blocks]
        added = _relaxed(cloth, springs, wanted, keys, options)
        resolved = replace(rig, blend_shapes=_plus(rig.blend_shapes, added, anchors), blend_normals=None)
        both = side_by_side(part, take_vertices(resolved, anchors.rows))
        inside = find_contacts(both, body, betas, poses.check[:_CHECKED]).clearance < 0
    before, after = (100 * float(half.mean()) for half in np.split(inside, 2, axis=1))
    moved = posed_error(rig, resolved, poses.check)
    detail = f"about {before:.2f} % of the vertices inside the body before, {after:.2f} % after; moved {moved}"
    return resolved, PassReport("resolve collisions", detail)


def _relaxed(
    cloth: list[PosedCloth],
    springs: Springs,
    wanted: NDArray[np.float32],
    keys: NDArray[np.float64],
    options: ResolveCollisions,
) -> NDArray[np.float32]:
    """Shapes (n, 3, M) to add, so that keys (P, M) times them do all that in the poses of the blocks of `cloth`."""
    pose_count, key_count = keys.shape
    moment = keys.T @ keys / pose_count
    moment += options.ridge * np.trace(moment) / key_count * np.eye(key_count)
    regress = np.linalg.solve(moment, keys.T / pose_count).T.astype(np.float32)
    ends = np.cumsum([block.clearance.shape[1] for block in cloth])[:-1]
    by_block = [np.ascontiguousarray(part.T, dtype=np.float32) for part in np.split(keys, ends)]
    shapes = before = np.zeros((len(wanted) * 3, key_count), dtype=np.float32)

    def step(poses: PosedCloth, keys: NDArray[np.float32]) -> NDArray[np.float32]:
        moved = (ahead @ keys).reshape(-1, 3, keys.shape[1])
        relaxed = poses.relaxation(moved, springs, options.relaxation, options.smoothing)
        pushed: NDArray[np.float32] = relaxed + poses.push(moved + relaxed, wanted)
        return pushed.reshape(-1, keys.shape[1])

    with ThreadPoolExecutor(os.cpu_count()) as pool:  # blocks come back in order: threads do not change the sum
        for _ in range(options.iterations):
            ahead = shapes + options.momentum * (shapes - before)
            steps = np.concatenate(list(pool.map(step, cloth, by_block)), axis=1)
            before, shapes = shapes, ahead + steps @ regress
    return shapes.reshape(len(wanted), 3, key_count)


def _plus(shapes: NDArray[Any], added: NDArray[np.float32], anchors: Anchors) -> NDArray[np.float32]:
    """Blend shapes (M, N, 3) plus what is added to those of the anchors (n, 3, M), carried over to all vertices."""
    result = np.array(shapes, dtype=np.float32)
    by_anchor = added.reshape(len(added), -1)
    for rows, interpolator in anchors.interpolators(max(1, _VALUES_AT_ONCE // (3 * len(shapes)))):
        result[:, rows] += (interpolator @ by_anchor).reshape(-1, 3, len(shapes)).transpose(2, 0, 1)
    return result
