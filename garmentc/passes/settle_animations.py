"""Let the cloth of animations fall and settle, frame after frame: what no key of a pose can say."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from threading import Event, Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.anchored_cloth import AnchoredCloth
from garmentc.passes.anchors import Anchors
from garmentc.passes.animated_cloth import AnimatedCloth, Falling, Settling
from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.part_of_rig import take_vertices
from garmentc.passes.posed_skinning import posed_outfit
from garmentc.passes.report import PassReport
from garmentc.passes.sparse_shapes import SparseShapes
from garmentc.passes.stretches import Stretches
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel
from garmentc.smpl.motion import Motion


@dataclass(frozen=True)
class SettleAnimations:
    """How the cloth moves, and how much of it is kept.

    shapes              blend shapes to add, at most
    tolerance           metres: fewer where what is left out is this much, root mean square
    falling, settling   see `AnimatedCloth`
    """

    shapes: int = 32
    tolerance: float = 5e-4
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

    Cloth begins where `start`, the same outfit as the networks have it, has it at rest, and then moves as a body of its
    own (`AnimatedCloth`), through stretches of the motions side by side (`Stretches`); cloth of `firmness` (N,) 1 is
    held by the skin. What `rig` lacks to that, over all frames, is made of few shapes (`SparseShapes`); those are
    added, with their amounts as `Rig.animation_keys`. In any other pose their keys are 0.
    """
    if rig.keys is None or not motions or not options.shapes:
        return rig, PassReport("settle animations", "no animations, or no blend shapes for them")
    poses = np.concatenate([motion.poses for motion in motions])
    stretches = Stretches.of(motions, rig.joints)
    with single_threaded_blas():
        seen = np.concatenate([some.poses.reshape(-1, *poses.shape[1:]) for some in stretches])

        def anchored(anchors: Anchors) -> AnchoredCloth:
            return AnchoredCloth.of(start, anchors, body, betas, seen)

        anchors = Anchors.of(rig, options.settling.anchors)
        cloth = AnimatedCloth.of(start, anchors, anchored, firmness, options.falling, options.settling)
        finished = take_vertices(rig, anchors.rows)
        lacking = np.zeros((len(poses), 3 * len(anchors.rows)), dtype=np.float32)
        _fill_in(lacking, stretches, cloth, finished)
        added = SparseShapes.of(lacking, options.shapes, options.tolerance)
        keys = np.concatenate([rig.pose_keys(np.asarray(poses, np.float64)), added.amounts], axis=1)
    if not len(added.shapes):
        return rig, PassReport("settle animations", f"{len(poses)} frames lack nothing")
    shapes = np.empty((rig.morph_count + len(added.shapes), rig.vertex_count, 3), dtype=np.float32)
    shapes[: rig.morph_count] = rig.blend_shapes
    for rows, some in anchors.carried(added.shapes.reshape(len(added.shapes), 3, -1).transpose(0, 2, 1)):
        shapes[rig.morph_count :, rows] = some
    settled = replace(rig, blend_shapes=shapes, blend_normals=None, animation_keys=keys)
    moved, left = 1000 * added.moved, 1000 * added.left
    detail = f"{len(added.shapes)} blend shapes for {len(poses)} frames; moved {moved:.1f} mm"
    return settled, PassReport("settle animations", f"{detail}, {left:.1f} mm short of settled")


def _fill_in(lacking: NDArray[np.float32], stretches: Sequence[Stretches], cloth: AnimatedCloth, finished: Rig) -> None:
    """Add to `lacking` (T, 3n) what anchors `finished` by the passes lack at rest in the frames of `stretches` to be
    where the cloth is, times how much they count. At most two stretches share a frame, so their order means nothing.

    What ends the wait for them, Ctrl-C for one, ends them too, within a frame.
    """
    lock, stopped = Lock(), Event()

    def fill(some: Stretches) -> None:
        for number, settled in cloth.along(some):
            if stopped.is_set():
                return
            if settled is None:
                continue
            after = posed_outfit(finished, some.poses[number])
            way = after.at_rest(settled - after.vertices) * some.shares[number]
            counts = some.shares[number] > 0
            with lock:
                lacking[some.frames[number, counts]] += way[:, :, counts].reshape(-1, counts.sum()).T

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        try:
            for filled in [pool.submit(fill, some) for some in stretches]:
                filled.result()
        except BaseException:
            stopped.set()
            raise
