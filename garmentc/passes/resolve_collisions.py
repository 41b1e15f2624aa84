"""Bend the blend shapes so that the outfit stays outside its body, and its edges as long as they are."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import edges
from garmentc.passes.anchors import Anchors
from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.body_contacts import CLOSEST, find_clearance, wanted_clearance
from garmentc.passes.nearby_skin import NearbySkin
from garmentc.passes.part_of_rig import side_by_side, take_vertices
from garmentc.passes.pose_set import PoseSet, farthest_apart
from garmentc.passes.posed_cloth import PosedCloth
from garmentc.passes.posed_error import posed_error
from garmentc.passes.report import PassReport
from garmentc.passes.springs import Springs
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel

_VALUES_AT_ONCE = 2_000_000
_POSES_AT_ONCE = 32
_CHECKED = 8
_NEGLIGIBLE = 0.01
"""Combinations of keys whose mean square is below this share of the ridge get less than a hundredth of the movement."""


@dataclass(frozen=True)
class ResolveCollisions:
    """How hard to try.

    clearance   metres that cloth should keep from the skin; cloth that is closer at rest may stay closer
    radius      metres: how round limbs are; between the vertices of a mesh skin bulges out by edge² / (8 radius), so
                coarse cloth keeps that distance even where it has less at rest
    poses       how many poses to look at
    searched    in how many poses to search all of the skin for what is nearest to a vertex
    anchors     vertices to look at; those between them move with them
    iterations  rounds of bringing edges back to their lengths and pushing out what is too close
    ridge       how much movement must be worth it, relative to the keys' own size; with less, shapes grow so large that
                single precision shows at rest
    relaxation  how far a round brings edges back, of the step that would do for an edge alone
    smoothing   how far a round brings the movement of vertices to that of their neighbours; keeps cloth from crumpling
    momentum    how much of a round's movement the next one goes on with

    Rounds settle on any mesh, even a lace, where relaxation < 1 + 1 / (1 + 2 momentum) and smoothing < 1 / 2.
    """

    clearance: float = 0.010
    radius: float = 0.025
    poses: int = 384
    searched: int = 24
    anchors: int = 3000
    iterations: int = 12
    ridge: float = 0.2
    relaxation: float = 1.2
    smoothing: float = 0.2
    momentum: float = 0.8


def resolve_collisions(
    rig: Rig, options: ResolveCollisions, poses: PoseSet, body: BodyModel, betas: NDArray[Any] | None = None
) -> tuple[Rig, PassReport]:
    """Add to the blend shapes what keeps vertices out of the body and edges at their lengths, in the poses to fit.

    Shapes are smoothed. In every pose, vertices then get a rest-space displacement that brings the edges they are at
    back to the lengths of the rest pose, as springs (position-based dynamics, Mueller et al. 2007, averaged over a
    vertex's edges), and those too close to the skin another that brings them out along its normal. Those displacements
    are regressed on the keys that the rig already has (ridge least squares, one matrix for all vertices), so nothing is
    added at run time, and the rest pose stays as it is because keys are 0 there. What is left over is moved again.
    A network's keys have few principal combinations; the shapes of those are what is worked on.
    """
    if rig.keys is None or not rig.morph_count:
        return rig, PassReport("resolve collisions", "no blend shapes that could do it")
    fit = poses.some(options.poses)
    keys = rig.pose_keys(fit)
    if not keys.any():  # a bundle of blend weights alone
        return rig, PassReport("resolve collisions", "no pose keys that move")
    anchors = Anchors.of(rig, options.anchors)
    part = take_vertices(rig, anchors.rows)
    joined = edges(rig.triangles)
    springs = Springs.of(part.template, anchors.joined(joined))
    bulge = _edge_lengths(rig.template, joined)[anchors.rows] ** 2 / (8 * options.radius)
    closest = np.clip(bulge, CLOSEST, options.clearance / 2)
    with single_threaded_blas(), ThreadPoolExecutor(os.cpu_count()) as pool:
        wanted = wanted_clearance(part, body, betas, options.clearance, closest)
        skin = NearbySkin.of(part, body, betas, farthest_apart(fit, options.searched))
        blocks = [fit[start : start + _POSES_AT_ONCE] for start in range(0, len(fit), _POSES_AT_ONCE)]
        cloth = list(pool.map(lambda block: PosedCloth.of(part, block, skin, wanted), blocks))
        added = _relaxed(cloth, springs, keys, options, pool)
        resolved = replace(rig, blend_shapes=_plus(rig.blend_shapes, added, anchors), blend_normals=None)
        both = side_by_side(part, take_vertices(resolved, anchors.rows))
        inside = find_clearance(both, body, betas, poses.check[:_CHECKED]) < 0
    before, after = (100 * float(half.mean()) for half in np.split(inside, 2, axis=1))
    moved = posed_error(rig, resolved, poses.check)
    detail = f"about {before:.2f} % of the vertices inside the body before, {after:.2f} % after; moved {moved}"
    return resolved, PassReport("resolve collisions", detail)


def _edge_lengths(template: NDArray[Any], edges: NDArray[Any]) -> NDArray[np.float32]:
    """The mean length of the edges at each vertex, (N,) metres."""
    lengths = np.linalg.norm(np.subtract(*template[edges.T]), axis=1)
    total = sum(np.bincount(ends, lengths, len(template)) for ends in edges.T)
    return (total / np.maximum(np.bincount(edges.ravel(), minlength=len(template)), 1)).astype(np.float32)


@dataclass(frozen=True)
class _Added:
    """shapes (3, n, r) of n anchors for the r combinations axes (M, r) of keys."""

    shapes: NDArray[np.float32]
    axes: NDArray[np.float32]


def _relaxed(
    cloth: Sequence[PosedCloth],
    springs: Springs,
    keys: NDArray[np.float64],
    options: ResolveCollisions,
    pool: ThreadPoolExecutor,
) -> _Added:
    """What to add to the shapes so that they do all that in the poses of the blocks of `cloth`, with keys (P, M)."""
    moment, axes = np.linalg.eigh(keys.T @ keys / len(keys))
    ridge = options.ridge * moment.mean()
    principal = moment > _NEGLIGIBLE * ridge
    axes, moment = axes[:, principal], moment[principal]
    amounts, kept = keys @ axes, moment / (moment + ridge)
    regress = amounts * kept / moment / len(keys)
    ends = np.cumsum([block.lacking.shape[1] for block in cloth])[:-1]
    by_block = [np.split(array.astype(np.float32), ends) for array in (amounts, regress)]
    smoothing = (options.smoothing * kept).astype(np.float32)
    shapes = before = np.zeros((3, len(cloth[0].lacking), len(moment)), dtype=np.float32)

    def step(block: PosedCloth, amounts: NDArray[np.float32], regress: NDArray[np.float32]) -> NDArray[np.float32]:
        result: NDArray[np.float32] = block.step(ahead @ amounts.T, springs, options.relaxation) @ regress
        return result

    for _ in range(options.iterations):
        ahead = shapes + options.momentum * (shapes - before)
        ahead += smoothing * springs.roughness(ahead)
        # Blocks come back in order: threads do not change the sum.
        before, shapes = shapes, sum(pool.map(step, cloth, *by_block), start=ahead)
    return _Added(shapes, axes.astype(np.float32))


def _plus(shapes: NDArray[Any], added: _Added, anchors: Anchors) -> NDArray[np.float32]:
    """Blend shapes (M, N, 3) plus what is added to those of the anchors, carried over to all vertices."""
    result = np.array(shapes, dtype=np.float32)
    by_anchor = added.shapes.transpose(1, 0, 2).reshape(added.shapes.shape[1], -1)
    for rows, interpolator in anchors.interpolators(max(1, _VALUES_AT_ONCE // (3 * len(shapes)))):
        carried = (interpolator @ by_anchor).reshape(-1, len(added.axes.T))
        result[:, rows] += (added.axes @ carried.T).reshape(len(shapes), -1, 3)
    return result
