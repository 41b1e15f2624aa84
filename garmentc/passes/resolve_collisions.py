"""Bend the blend shapes so that the outfit stays outside its body, and its edges as long as they are."""

from __future__ import annotations

import itertools
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.anchored_cloth import AnchoredCloth
from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.body_contacts import find_clearance
from garmentc.passes.key_regression import KeyRegression
from garmentc.passes.part_of_rig import side_by_side, take_vertices
from garmentc.passes.pose_blocks import over_blocks
from garmentc.passes.pose_set import PoseSet
from garmentc.passes.posed_cloth import PosedCloth
from garmentc.passes.posed_error import posed_error
from garmentc.passes.posed_skinning import posed_outfit
from garmentc.passes.report import PassReport
from garmentc.passes.springs import Springs
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel

_POSES_AT_ONCE = 32
_CHECKED = 8


@dataclass(frozen=True)
class ResolveCollisions:
    """How hard to try.

    poses       how many poses to look at
    settling    again and again, so many rounds of bringing edges back to their lengths and pushing out what is too
                close, in every pose by itself; that is regressed, and what then still is too close pushed out and
                regressed again
    ridge       see `KeyRegression`
    most        combinations of keys to use: with more, shapes learn accidents of the poses looked at, and more vertices
                are in the skin in others
    relaxation  how far a round brings edges back, of the step that would do for an edge alone
    smoothing   how far the movement of vertices is brought to that of their neighbours before each regression; keeps
                cloth from crumpling
    momentum    how much of a round's movement the next one goes on with

    Rounds settle on any mesh, even a lace, where relaxation < 1 + 1 / (1 + 2 momentum); smoothing must be < 1 / 2.
    """

    poses: int = 384
    settling: tuple[int, ...] = (20, 10, 2, 2, 2, 2)
    ridge: float = 0.2
    most: int = 32
    relaxation: float = 1.2
    smoothing: float = 0.2
    momentum: float = 0.8


def resolve_collisions(
    rig: Rig,
    cloth: AnchoredCloth,
    options: ResolveCollisions,
    poses: PoseSet,
    body: BodyModel,
    betas: NDArray[Any] | None = None,
) -> tuple[Rig, PassReport]:
    """Add to the blend shapes what takes the anchors of `cloth` out of the body, in the poses to fit.

    What that takes is regressed on the keys that `rig` has, so nothing is added at run time, and the rest pose stays
    as it is because keys are 0 there. Regressed after every round, what keys cannot express would be pushed at again
    and again, and shapes would grow; so poses settle first. What the regression leaves in the skin, or stretched, is
    then brought back in a few more rounds, as springs (position-based dynamics, Mueller et al. 2007, averaged over a
    vertex's edges).
    """
    fit = poses.some(options.poses)
    part = take_vertices(rig, cloth.anchors.rows)
    with single_threaded_blas():
        regression = KeyRegression.of(rig, fit, options.ridge, options.most)
        if regression is None:
            return rig, PassReport("resolve collisions", "no pose keys that move")
        blocks = over_blocks(
            lambda block: cloth.touching(posed_outfit(part, block), cloth.skin.planes(block)), fit, _POSES_AT_ONCE
        )
        resolved = regression.added(rig, cloth.anchors, _settled(blocks, cloth.springs, regression, options))
        both = side_by_side(part, take_vertices(resolved, cloth.anchors.rows))
        inside = find_clearance(both, body, betas, poses.check[:_CHECKED]) < 0
    before, after = (100 * float(half.mean()) for half in np.split(inside, 2, axis=1))
    moved = posed_error(rig, resolved, poses.check)
    detail = f"about {before:.2f} % of the vertices inside the body before, {after:.2f} % after; moved {moved}"
    return resolved, PassReport("resolve collisions", detail)


def _settled(
    blocks: Sequence[PosedCloth], springs: Springs, regression: KeyRegression, options: ResolveCollisions
) -> NDArray[np.float32]:
    """Shapes (3, n, r) to add so that n vertices settle in the poses of `blocks`."""
    ends = np.cumsum([block.least.shape[1] for block in blocks])[:-1]
    amounts, weights = (np.split(array, ends) for array in (regression.amounts, regression.weights))
    smoothing = options.smoothing * regression.kept
    shapes: NDArray[np.float32] = np.zeros((3, len(blocks[0].least), len(regression.kept)), dtype=np.float32)

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
            shapes = sum(pool.map(step, blocks, amounts, weights, itertools.repeat(rounds)), start=shapes)
    return shapes
