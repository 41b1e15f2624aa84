"""Let the cloth of animations fall and settle, frame after frame: what no key of a pose can say."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import chain
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.anchored_cloth import AnchoredCloth
from garmentc.passes.anchors import Anchors
from garmentc.passes.animated_cloth import AnimatedCloth, Falling, Settling
from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.body_contacts import CLEARANCE
from garmentc.passes.key_reach import key_reach
from garmentc.passes.part_of_rig import take_vertices
from garmentc.passes.pose_set import farthest_apart
from garmentc.passes.posed_skinning import posed_outfit
from garmentc.passes.report import PassReport
from garmentc.passes.stretches import Stretches
from garmentc.resting_layer import with_silent_keys
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel
from garmentc.smpl.motion import Motion

_FRAMES_COMPARED = 1024
"""Frames that the shapes are chosen on: more tell nothing new."""

_NOTHING = 1e-6
"""Metres: a shape that moves vertices by less, root mean square, is rounding."""

_VALUES_AT_ONCE = 2_000_000


@dataclass(frozen=True)
class SettleAnimations:
    """How the cloth moves, and how much of it is kept.

    shapes      blend shapes to add, at most
    tolerance   metres: fewer where what is left out is this much, root mean square
    clearance, bulge, searched   as in `ResolveCollisions`
    falling, settling            see `AnimatedCloth`
    """

    shapes: int = 32
    tolerance: float = 5e-4
    clearance: float = CLEARANCE
    bulge: float = 0.005
    searched: int = 24
    falling: Falling = field(default_factory=Falling)
    settling: Settling = field(default_factory=Settling)


def settle_animations(
    rig: Rig,
    start: Rig,
    options: SettleAnimations,
    motions: Sequence[Motion],
    firmness: NDArray[np.float32],
    body: BodyModel,
    betas: NDArray[Any] | None = None,
) -> tuple[Rig, PassReport]:
    """Add blend shapes and keys of single frames, so that along `motions` the outfit moves as cloth.

    Cloth begins where `start`, the same outfit as the networks have it, has it in the first frame, and then moves as a
    body of its own (`AnimatedCloth`); cloth of `firmness` (N,) 1 is held by the skin. What `rig` lacks to that, over
    all frames, has few principal shapes (singular value decomposition); those are added, with their amounts as
    `Rig.animation_keys`. In any other pose their keys are 0.
    """
    if rig.keys is None or not motions or not options.shapes:
        return rig, PassReport("settle animations", "no animations, or no blend shapes for them")
    poses = np.concatenate([motion.poses for motion in motions])
    stretches = [Stretches.of(motion, rig.joints) for motion in motions]
    with single_threaded_blas():
        seen = [some.poses.reshape(-1, *poses.shape[1:]) for some in chain(*stretches)]
        searched = farthest_apart(np.concatenate(seen), options.searched)

        def anchored(anchors: Anchors) -> AnchoredCloth:
            return AnchoredCloth.of(
                start, anchors, body, betas, searched=searched, clearance=options.clearance, bulge=options.bulge
            )

        anchors = Anchors.of(rig, options.settling.anchors)
        cloth = AnimatedCloth.of(start, anchors, anchored, firmness, options.falling, options.settling)
        finished = take_vertices(rig, anchors.rows)
        lacking = np.zeros((len(poses), 3 * len(anchors.rows)), dtype=np.float32)
        parts = np.split(lacking, np.cumsum([len(motion) for motion in motions])[:-1])
        work = [(part, some) for part, each in zip(parts, stretches, strict=True) for some in each]
        lock = Lock()
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for filled in [pool.submit(_fill_in, part, some, cloth, finished, lock) for part, some in work]:
                filled.result()
        principal = _Principal.of(lacking, options.shapes, options.tolerance)
        keys = np.concatenate([rig.pose_keys(np.asarray(poses, np.float64)), principal.amounts], axis=1)
    moved, left = 1000 * principal.moved, 1000 * principal.left
    if not len(principal.shapes):
        return rig, PassReport("settle animations", f"{len(poses)} frames lack nothing")
    settled = replace(
        rig,
        blend_shapes=np.concatenate([rig.blend_shapes, _carried(principal.shapes, anchors)]),
        blend_normals=None,
        keys=with_silent_keys(rig.keys, len(principal.shapes)),
        animation_keys=keys,
    )
    detail = f"{len(principal.shapes)} blend shapes for {len(poses)} frames; moved {moved:.1f} mm"
    return settled, PassReport("settle animations", f"{detail}, {left:.1f} mm short of settled")


def _fill_in(
    lacking: NDArray[np.float32], stretches: Stretches, cloth: AnimatedCloth, finished: Rig, lock: Lock
) -> None:
    """Add to `lacking` (T, 3n) what anchors `finished` by the passes lack at rest in the frames of `stretches` to be
    where the cloth is, times how much they count. At most two stretches share a frame, so their order means nothing."""
    for number, settled in cloth.along(stretches):
        after = posed_outfit(finished, stretches.poses[number])
        way = after.at_rest(settled - after.vertices) * stretches.shares[number]
        counts = stretches.shares[number] > 0
        with lock:
            lacking[stretches.frames[number, counts]] += way[:, :, counts].reshape(-1, counts.sum()).T


@dataclass(frozen=True)
class _Principal:
    """The principal shapes of movements (T, 3n).

    shapes       (K, 3n) float32 metres
    amounts      (T, K) how much of each is in a frame; their `key_reach` is 1, and they are positive on average
    moved, left  metres, root mean square: all movement, and what the shapes leave of it
    """

    shapes: NDArray[np.float32]
    amounts: NDArray[np.float64]
    moved: float
    left: float

    @classmethod
    def of(cls, movement: NDArray[np.float32], most: int, tolerance: float) -> _Principal:
        """At most `most` shapes, and as few as leave `tolerance` metres."""
        rows = np.unique(np.linspace(0, len(movement) - 1, _FRAMES_COMPARED).astype(np.intp))
        some = movement[rows]
        energy, frames = np.linalg.eigh((some @ some.T).astype(np.float64))
        energy, frames = np.maximum(energy[::-1], 0), frames[:, ::-1]
        own = np.sqrt(energy / max(1, some.size // 3))
        left = np.sqrt(np.append(np.cumsum(own[::-1] ** 2)[-2::-1], 0))  # by those after each
        count = min(most, 1 + int(np.count_nonzero(left > tolerance)), int(np.count_nonzero(own > _NOTHING)))
        shapes = ((frames[:, :count].T @ some) / np.sqrt(energy[:count, None])).astype(np.float32)
        amounts = (movement @ shapes.T).astype(np.float64)
        sizes = np.array([float(np.square(frame).sum()) for frame in movement])
        counted = max(1, movement.size // 3)
        remaining = max(0.0, float(sizes.sum() - np.square(amounts).sum()))
        reach = key_reach(amounts) * np.where(amounts.sum(axis=0) < 0, -1, 1)
        scaled = (shapes * reach[:, None]).astype(np.float32)
        return cls(scaled, amounts / reach, np.sqrt(sizes.sum() / counted), np.sqrt(remaining / counted))


def _carried(shapes: NDArray[np.float32], anchors: Anchors) -> NDArray[np.float32]:
    """Blend shapes (K, N, 3) of the whole outfit from those of its anchors, (K, 3n)."""
    by_anchor = shapes.reshape(len(shapes), 3, -1).transpose(2, 0, 1).reshape(-1, 3 * len(shapes))
    result = np.empty((len(shapes), len(anchors.places), 3), dtype=np.float32)
    for rows, interpolator in anchors.interpolators(max(1, _VALUES_AT_ONCE // (3 * len(shapes)))):
        result[:, rows] = (interpolator @ by_anchor).reshape(-1, len(shapes), 3).transpose(1, 0, 2)
    return result
