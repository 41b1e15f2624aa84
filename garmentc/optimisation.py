"""The stage before the last: passes that make a rig one that engines can run, and keep the cloth out of the body."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from garmentc.emission import file_meshes
from garmentc.layer import Dressed, Layer
from garmentc.options import CompileOptions
from garmentc.passes.anchored_cloth import AnchoredCloth
from garmentc.passes.anchors import Anchors
from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.follow_skin import CLINGING, FollowSkin, follow_skin
from garmentc.passes.hidden_keys import HiddenKeys, hidden_keys
from garmentc.passes.keep_tucked import KeepTucked, keep_tucked
from garmentc.passes.let_fall import LetFall, let_fall
from garmentc.passes.limit_influences import LimitInfluences, limit_influences
from garmentc.passes.morph_normals import MorphNormals, morph_normals
from garmentc.passes.nonnegative_weights import NonnegativeWeights, nonnegative_weights
from garmentc.passes.pose_set import PoseSet, plausible_poses
from garmentc.passes.principal_shapes import principal_shapes
from garmentc.passes.prune_morphs import PruneMorphs, prune_morphs
from garmentc.passes.quantize import Quantize, quantize
from garmentc.passes.reduce_blend_shapes import ReduceBlendShapes, reduce_blend_shapes
from garmentc.passes.report import PassReport
from garmentc.passes.resolve_collisions import ResolveCollisions, resolve_collisions
from garmentc.passes.rigid_pieces import rigid_pieces
from garmentc.passes.settle_animations import SettleAnimations, settle_animations
from garmentc.rig import Rig

CHECKED_POSES = 32
"""Poses that the error of a pass is measured on; a quarter as many frames of the motions join them."""

_ANCHORS = 3000
"""Vertices that fall and settle in the poses to fit, at most; those between them move with them."""

Pass = Callable[[Rig, PoseSet], tuple[Rig, PassReport]]


def passes(inferred: Rig, options: CompileOptions, dressed: Dressed) -> tuple[Pass, ...]:
    """The passes for a rig as the networks have made it, in the order in which they run."""
    settings, body, betas = options.settings, dressed.alignment.body, dressed.alignment.betas
    cloth, influences = dressed.cloth, LimitInfluences(settings.influences)
    # One blend shape is no choice: it keeps its weights of both signs. All of them stay as they are.
    balanced = options.morph_tolerance is not None or (settings.morphs or 0) > 1
    count = settings.morphs - 1 if balanced and settings.morphs else settings.morphs
    reduction = ReduceBlendShapes(None if options.morph_tolerance else count, options.morph_tolerance)
    invisible = PruneMorphs() if settings.sparse == "auto" else PruneMorphs(threshold=0)
    settling = SettleAnimations(settings.animation_morphs)

    @cache
    def start(poses: PoseSet) -> Rig:
        """Where cloth falls from: the networks' own weights are nearer to how it hangs than those that follow the skin
        to keep out of it."""
        clinging, _ = follow_skin(inferred, CLINGING, poses, body, betas)
        return limit_influences(clinging, influences, poses)[0]

    @cache
    def firmness(poses: PoseSet) -> NDArray[np.float32]:
        """What does not fall: what the skin holds, and what is no cloth."""
        return np.maximum(cloth.firmness, rigid_pieces(start(poses), poses))

    @cache
    def falling(poses: PoseSet) -> AnchoredCloth:
        rig = start(poses)
        return AnchoredCloth.of(rig, Anchors.of(rig, _ANCHORS), body, betas, poses.some(LetFall().poses))

    steps: list[Pass] = [
        lambda rig, poses: follow_skin(rig, FollowSkin(), poses, body, betas),
        lambda rig, poses: limit_influences(rig, influences, poses),
        lambda rig, poses: hidden_keys(rig, HiddenKeys(), poses),
        # Needs the final weights, and works best with all keys that there are.
        lambda rig, poses: let_fall(rig, falling(poses), LetFall(), poses, firmness(poses)),
        lambda rig, poses: reduce_blend_shapes(rig, reduction, poses),
        # Makes up for what the reduction has left out, too, and is faster and smoother on fewer shapes.
        lambda rig, poses: resolve_collisions(rig, falling(poses), ResolveCollisions(), poses, body, betas),
    ]
    if balanced:
        steps.append(principal_shapes)
    steps += [
        lambda rig, poses: settle_animations(
            rig, start(poses), settling, dressed.motions, firmness(poses), body, betas
        ),
        # Copies what all passes before have made of the cloth above.
        lambda rig, poses: keep_tucked(
            rig, KeepTucked(influences=settings.influences), poses, cloth.held > 0, body, betas
        ),
        # Whatever mixes or adds to shapes fills their zeros.
        lambda rig, poses: prune_morphs(rig, invisible, poses),
        # Follow from the final shapes.
        lambda rig, poses: morph_normals(rig, MorphNormals(), poses),
    ]
    if balanced:
        # Turns finished shapes and normals into others, exactly.
        steps.append(lambda rig, poses: nonnegative_weights(rig, NonnegativeWeights(), poses))
    if settings.quantize:
        # Only measures: the back end rounds, once.
        rounding = Quantize(settings.influences, compress=options.meshopt)
        steps.append(lambda rig, poses: quantize(rig, rounding, poses))
    return tuple(steps)


def optimise(rig: Rig, options: CompileOptions, dressed: Dressed) -> tuple[Rig, tuple[PassReport, ...]]:
    """Run the passes. Each says what it costs in posed vertices."""
    frames = [motion.poses for motion in dressed.motions]
    poses = plausible_poses(np.concatenate(frames) if frames else None, check=CHECKED_POSES)
    reports = []
    with single_threaded_blas():  # passes have threads of their own
        for run in passes(rig, options, dressed):
            rig, report = run(rig, poses)
            reports.append(report)
    return rig, tuple(reports)


def quantized_together(layers: Sequence[Layer], options: CompileOptions) -> list[Layer]:
    """The layers with the error of quantization measured anew, where several meshes share a file's box of positions."""
    rigs = [mesh.rig for mesh in file_meshes(layers, options)]
    if not options.settings.quantize or len(rigs) == 1:
        return list(layers)
    poses = plausible_poses(check=CHECKED_POSES)
    measured = []
    for number, layer in enumerate(layers):
        beside = (*rigs[:number], *rigs[number + 1 :])
        rounding = Quantize(options.settings.influences, beside, options.meshopt)
        _, report = quantize(layer.rig, rounding, poses)
        measured.append(replace(layer, passes=(*layer.passes[:-1], report)))
    return measured
