"""Bend the blend shapes so that the outfit hangs as cloth does: outside its body, and its edges as long as they are."""

from __future__ import annotations

import itertools
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.anchored_cloth import AnchoredCloth
from garmentc.passes.anchors import Anchors
from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.body_contacts import CLEARANCE, find_clearance
from garmentc.passes.cloth_dynamics import ClothDynamics
from garmentc.passes.part_of_rig import side_by_side, take_vertices
from garmentc.passes.pose_blocks import over_blocks
from garmentc.passes.pose_set import PoseSet, farthest_apart
from garmentc.passes.posed_cloth import PosedCloth
from garmentc.passes.posed_error import posed_error
from garmentc.passes.posed_skinning import PosedVertices, posed_outfit
from garmentc.passes.report import PassReport
from garmentc.passes.springs import Springs
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel

_POSES_AT_ONCE = 32
_CHECKED = 8
_NEGLIGIBLE = 0.01
"""Combinations of keys whose mean square is below this share of the ridge get less than a hundredth of the movement."""


@dataclass(frozen=True)
class ResolveCollisions:
    """How hard to try.

    clearance   metres that loose cloth should keep beyond what all cloth should; where less is there at rest, less
    bulge       metres: between the vertices of coarse cloth the skin of a round limb rises. Cloth keeps that distance
                too, but at most this much
    poses       how many poses to look at
    searched    in how many poses to search all of the skin for what is nearest to a vertex
    anchors     vertices to look at; those between them move with them
    dynamics    of the cloth that falls,
    falling     for so many rounds in every pose by itself, while
    touching    so often it is asked what it touches. What all poses have come to is regressed on the keys
    settling    then, again and again, so many rounds of bringing edges back to their lengths and pushing out what is
                too close, in every pose by itself; that is regressed, and what then still is too close pushed out and
                regressed again
    ridge       how much movement must be worth it, relative to the keys' own size; with less, shapes grow so large that
                single precision shows at rest
    relaxation  how far a round brings edges back, of the step that would do for an edge alone
    smoothing   how far the movement of vertices is brought to that of their neighbours before each regression; keeps
                cloth from crumpling
    momentum    how much of a round's movement the next one goes on with

    Rounds settle on any mesh, even a lace, where relaxation < 1 + 1 / (1 + 2 momentum); smoothing must be < 1 / 2.
    """

    clearance: float = CLEARANCE
    bulge: float = 0.005
    poses: int = 384
    searched: int = 24
    anchors: int = 3000
    dynamics: ClothDynamics = field(default_factory=lambda: ClothDynamics(smoothing=0))
    falling: int = 60
    touching: int = 2
    settling: tuple[int, ...] = (5, 5, 5, 5, 5, 2, 2, 2)
    ridge: float = 0.2
    relaxation: float = 1.2
    smoothing: float = 0.2
    momentum: float = 0.8


def resolve_collisions(
    rig: Rig,
    options: ResolveCollisions,
    poses: PoseSet,
    body: BodyModel,
    betas: NDArray[Any] | None = None,
    *,
    start: Rig | None = None,
    firmness: NDArray[np.float32] | None = None,
) -> tuple[Rig, PassReport]:
    """Add to the blend shapes what lets the outfit hang as cloth does, outside the body, in the poses to fit.

    start     the same outfit as the networks have it, where passes have bent `rig` since
    firmness  (N,) how much the skin holds each vertex, from 0 to 1; nowhere if None

    In every pose cloth falls for a moment from where `start` has it (`cloth_dynamics`): edges go back to their lengths,
    vertices out of the skin that they lay over at rest, and what hangs goes on to hang. What `rig` lacks to that is
    regressed on the keys that it already has (ridge least squares, one matrix for all vertices), so nothing is added at
    run time, and the rest pose stays as it is because keys are 0 there. Regressed after every round, what keys cannot
    express would be pushed at again and again, and shapes would grow; so poses settle first. What the regression
    leaves in the skin, or stretched, is then brought back in a few more rounds, as springs (position-based dynamics,
    Mueller et al. 2007, averaged over a vertex's edges).
    A network's keys have few principal combinations; the shapes of those are what is worked on.
    """
    if rig.keys is None or not rig.morph_count:
        return rig, PassReport("resolve collisions", "no blend shapes that could do it")
    fit = poses.some(options.poses)
    keys = rig.pose_keys(fit)
    if not keys.any():  # a bundle of blend weights alone
        return rig, PassReport("resolve collisions", "no pose keys that move")
    anchors = Anchors.of(rig, options.anchors)
    held = np.zeros(len(anchors.rows)) if firmness is None else firmness[anchors.rows]
    part = take_vertices(rig, anchors.rows)
    with single_threaded_blas():
        searched = farthest_apart(fit, options.searched)
        falling = AnchoredCloth.of(
            rig if start is None else start,
            anchors,
            body,
            betas,
            searched=searched,
            clearance=options.clearance,
            bulge=options.bulge,
        )

        def in_poses(block: NDArray[Any]) -> tuple[PosedCloth, NDArray[np.float32]]:
            fallen = falling.fallen(block, held, options.dynamics, options.falling, options.touching)
            now = posed_outfit(part, block)
            cloth = falling.touching(PosedVertices(fallen, now.turn), falling.skin.planes(block))
            cloth = replace(cloth, posed=now)
            return cloth, cloth.at_rest(fallen - now.vertices)

        cloth, ways = zip(*over_blocks(in_poses, fit, _POSES_AT_ONCE), strict=True)
        regression = _Regression.on(keys, options.ridge)
        shapes = _settled(cloth, ways, falling.springs, regression, options)
        resolved = replace(
            rig, blend_shapes=_plus(rig.blend_shapes, shapes, regression.axes, anchors), blend_normals=None
        )
        both = side_by_side(part, take_vertices(resolved, anchors.rows))
        inside = find_clearance(both, body, betas, poses.check[:_CHECKED]) < 0
    before, after = (100 * float(half.mean()) for half in np.split(inside, 2, axis=1))
    moved = posed_error(rig, resolved, poses.check)
    detail = f"about {before:.2f} % of the vertices inside the body before, {after:.2f} % after; moved {moved}"
    return resolved, PassReport("resolve collisions", detail)


@dataclass(frozen=True)
class _Regression:
    """Ridge least squares on the r principal combinations of M keys in P poses.

    axes     (M, r) float32 the combinations, of unit length
    amounts  (P, r) float32 how much of each is in a pose
    weights  (P, r) float32: displacements (n, P) times these are the shapes (n, r) to add
    kept     (r,) float32 how much of a movement the ridge leaves
    """

    axes: NDArray[np.float32]
    amounts: NDArray[np.float32]
    weights: NDArray[np.float32]
    kept: NDArray[np.float32]

    @classmethod
    def on(cls, keys: NDArray[np.float64], ridge: float) -> _Regression:
        """On `keys` (P, M), with a ridge relative to their mean square."""
        moment, axes = np.linalg.eigh(keys.T @ keys / len(keys))
        ridge = ridge * moment.mean()
        principal = moment > _NEGLIGIBLE * ridge
        axes, moment = axes[:, principal], moment[principal]
        amounts, kept = keys @ axes, moment / (moment + ridge)
        weights = amounts * kept / moment / len(keys)
        return cls(*(array.astype(np.float32) for array in (axes, amounts, weights, kept)))


def _settled(
    cloth: Sequence[PosedCloth],
    ways: Sequence[NDArray[np.float32]],
    springs: Springs,
    regression: _Regression,
    options: ResolveCollisions,
) -> NDArray[np.float32]:
    """Shapes (3, n, r) to add so that n vertices go the `ways` (3, n, P), at rest, in the poses of the blocks of
    `cloth`, and settle there."""
    ends = np.cumsum([block.least.shape[1] for block in cloth])[:-1]
    amounts, weights = (np.split(array, ends) for array in (regression.amounts, regression.weights))
    smoothing = options.smoothing * regression.kept
    shapes: NDArray[np.float32] = np.zeros((*ways[0].shape[:2], len(regression.kept)), dtype=np.float32)
    for way, share in zip(ways, weights, strict=True):
        shapes += way @ share

    def step(
        block: PosedCloth, amounts: NDArray[np.float32], weights: NDArray[np.float32], rounds: int
    ) -> NDArray[np.float32]:
        way = block.way(shapes @ amounts.T, springs, rounds, options.relaxation, options.momentum)
        result: NDArray[np.float32] = way @ weights
        return result

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for rounds in (0, *itertools.chain.from_iterable((rounds, 0) for rounds in options.settling)):
            shapes += smoothing * springs.roughness(shapes)
            # Blocks come back in order: threads do not change the sum.
            shapes = sum(pool.map(step, cloth, amounts, weights, itertools.repeat(rounds)), start=shapes)
    return shapes


def _plus(
    shapes: NDArray[Any], added: NDArray[np.float32], axes: NDArray[np.float32], anchors: Anchors
) -> NDArray[np.float32]:
    """Blend shapes (M, N, 3) plus what is added to those of the anchors, (3, n, r), carried over to all vertices."""
    result = np.array(shapes, dtype=np.float32)
    for rows, some in anchors.carried(added.T):
        result[:, rows] += (axes @ some.reshape(len(some), -1)).reshape(len(shapes), -1, 3)
    return result
