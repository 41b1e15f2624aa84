"""Let the outfit fall in many poses, and teach its pose keys where it comes to."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.anchored_cloth import AnchoredCloth
from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.cloth_dynamics import ClothDynamics
from garmentc.passes.key_regression import KeyRegression
from garmentc.passes.part_of_rig import take_vertices
from garmentc.passes.pose_blocks import over_blocks
from garmentc.passes.pose_set import PoseSet
from garmentc.passes.posed_error import posed_error
from garmentc.passes.posed_skinning import posed_outfit
from garmentc.passes.report import PassReport
from garmentc.rig import Rig

_POSES_AT_ONCE = 32


@dataclass(frozen=True)
class LetFall:
    """How long, and in how many poses.

    poses     how many; with fewer, more skin shows in poses that are like none of them
    dynamics  of the cloth that falls
    rounds    of falling in every pose by itself; so few that cloth stays near to where the networks have it, which
              know of what came before a pose
    touching  how often meanwhile it is asked what it touches
    ridge     see `KeyRegression`
    smoothing, smoothed   how far the movement of vertices is brought to that of their neighbours, and how often: what
              crumples in one pose must not in all
    """

    poses: int = 512
    dynamics: ClothDynamics = field(default_factory=lambda: ClothDynamics(smoothing=0))
    rounds: int = 60
    touching: int = 2
    ridge: float = 0.2
    smoothing: float = 0.2
    smoothed: int = 5


def let_fall(
    rig: Rig, cloth: AnchoredCloth, options: LetFall, poses: PoseSet, firmness: NDArray[Any]
) -> tuple[Rig, PassReport]:
    """Add to the blend shapes what lets the outfit hang as cloth does, in the poses to fit.

    cloth     anchors of the same outfit as the networks have it, where passes have bent `rig` since
    firmness  (N,) how much the skin holds each vertex, from 0 to 1

    In every pose `cloth` falls for a moment (`cloth_dynamics`): edges go back to their lengths, vertices out of the
    skin that they lay over at rest, and what hangs goes on to hang. What `rig` lacks to that is regressed on the keys
    that it already has, so nothing is added at run time, and the rest pose stays as it is because keys are 0 there.
    """
    fit = poses.some(options.poses)
    part, held = take_vertices(rig, cloth.anchors.rows), firmness[cloth.anchors.rows]

    def lacking(block: NDArray[Any]) -> NDArray[np.float32]:
        fallen = cloth.fallen(block, held, options.dynamics, options.rounds, options.touching)
        now = posed_outfit(part, block)
        way: NDArray[np.float32] = now.nearly_at_rest(fallen - now.vertices)
        return way

    with single_threaded_blas():
        regression = KeyRegression.of(rig, fit, options.ridge)
        if regression is None:
            return rig, PassReport("let fall", "no pose keys that move")
        ways = np.concatenate(over_blocks(lacking, fit, _POSES_AT_ONCE), axis=2)
        shapes = ways @ regression.weights
        for _ in range(options.smoothed):
            shapes += options.smoothing * cloth.springs.roughness(shapes)
        fallen = regression.added(rig, cloth.anchors, shapes)
    detail = f"in {len(fit)} poses, on {len(regression.kept)} combinations of keys"
    return fallen, PassReport("let fall", f"{detail}; moved {posed_error(rig, fallen, poses.check)}")
