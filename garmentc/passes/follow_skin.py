"""Let cloth that lies on the skin move with it, where the network's weights push it in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.anchors import Anchors
from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.body_contacts import CLOSEST, find_clearance, wanted_clearance
from garmentc.passes.part_of_rig import side_by_side, take_vertices
from garmentc.passes.pose_set import PoseSet
from garmentc.passes.posed_error import posed_error
from garmentc.passes.report import PassReport
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel
from garmentc.smpl.nearest import ClosestPoints, closest_on_surface

_DEPTH = 0.1
"""Metres: wrong weights leave cloth behind in the body, far deeper than one pushes it out."""

_VERTICES_AT_ONCE = 100_000


@dataclass(frozen=True)
class FollowSkin:
    """When cloth follows the skin.

    reach      metres: cloth this far from the skin takes a share 1/e of the skin's weights, nearer cloth more
    tight      metres: cloth this close clings to the skin, and takes its weights even where they save nothing
    saved      metres of mean penetration that the skin's weights must save for a vertex to take them (infinite: nothing
               saves enough, and no pose is looked at),
    mended     and from which to which share of all its penetration: with less it takes none of them, with more all
    poses      how many poses to look at
    anchors    vertices to look at; those between them do as they do
    smoothing  rounds of carrying the choice over to the vertices around
    """

    reach: float = 0.03
    tight: float = 0.003
    saved: float = 5e-4
    mended: tuple[float, float] = (0.6, 0.8)
    poses: int = 20
    anchors: int = 2000
    smoothing: int = 10


CLINGING = FollowSkin(tight=0.005, saved=np.inf)
"""Only what lies on the skin follows it."""


def follow_skin(
    rig: Rig, options: FollowSkin, poses: PoseSet, body: BodyModel, betas: NDArray[Any] | None = None
) -> tuple[Rig, PassReport]:
    """Mix the weights of the closest skin into those of vertices that would otherwise sink into it.

    A network knows a body's joints roughly: a short sleeve that follows the trunk a little too much lets the arm
    through. The skin's own weights are right there, but make everything else as stiff as skin. So each vertex takes
    them where they save it from nearly all penetration, in the poses to fit with the trunk's joints turned some more,
    or as far as it clings to the skin at rest, as a shoe does; all others keep the network's. Where the skin's weights
    leave much of the penetration, cloth is loose, and the network knows it better.
    """
    skin = body.shaped(betas)
    anchors = Anchors.of(rig, options.anchors)
    part = take_vertices(rig, anchors.rows)
    closest = closest_on_surface(part.template, skin, body.faces)
    chosen = np.exp(-((closest.distance / options.tight) ** 2))
    if np.isfinite(options.saved):
        chosen = np.maximum(chosen, _saves(part, closest, options, poses.some_shaken(options.poses), body, betas))
    choice = chosen
    for _ in range(options.smoothing):
        choice = np.maximum(chosen, anchors.smoother @ choice)
    everywhere = np.empty(rig.vertex_count)
    for block, interpolator in anchors.interpolators(_VERTICES_AT_ONCE):
        everywhere[block] = interpolator @ choice
    rows = np.flatnonzero(everywhere > 1e-3)
    closest = closest_on_surface(rig.template[rows], skin, body.faces)
    weights = np.array(rig.weights, dtype=np.float32)
    weights[rows] = _mixed(weights[rows], everywhere[rows], closest, body, options.reach)
    followed = replace(rig, weights=weights)
    moved = posed_error(rig, followed, poses.check)
    detail = f"{100 * everywhere.mean():.0f} % of the cloth follows the skin beneath; moved {moved}"
    return followed, PassReport("follow skin", detail)


def _saves(
    part: Rig,
    closest: ClosestPoints,
    options: FollowSkin,
    poses: NDArray[Any],
    body: BodyModel,
    betas: NDArray[Any] | None,
) -> NDArray[Any]:
    """How far the weights of the closest skin save each vertex of `part` from sinking in, 0 to 1; (n,)."""
    all_in = replace(part, weights=_mixed(part.weights, np.ones(len(part.weights)), closest, body, options.reach))
    with single_threaded_blas():
        wanted = CLOSEST + wanted_clearance(part, body, betas)
        clearance = find_clearance(side_by_side(part, all_in), body, betas, poses, _DEPTH)
    lacking = np.maximum(np.concatenate([wanted, wanted]) - clearance, 0).mean(axis=0)
    before, after = np.split(lacking, 2)
    least, enough = options.mended
    mended = 1 - after / np.maximum(before, np.finfo(before.dtype).tiny)
    saves: NDArray[Any] = np.clip((before - after) / options.saved, 0, 1) * np.clip(
        (mended - least) / (enough - least), 0, 1
    )
    return saves


def _mixed(
    weights: NDArray[Any], choice: NDArray[Any], closest: ClosestPoints, body: BodyModel, reach: float
) -> NDArray[np.float32]:
    """Weights (n, 24) mixed with those of the closest skin, as far as `choice` (n,) in [0, 1] and its closeness say."""
    of_skin = np.einsum("nk,nkj->nj", closest.barycentric, body.weights[body.faces[closest.face]])
    share = (choice * np.exp(-((closest.distance / reach) ** 2)))[:, None]
    mixed: NDArray[np.float32] = (share * of_skin + (1 - share) * weights).astype(np.float32)
    return mixed
