"""Bring an artist's outfit into the body's canonical pose and axes: metres, Y up, +Z front, T-pose.

Nothing is read from the file but its geometry. Each guess about unit, axes, origin, rest pose and gender is judged by
how the outfit then sits on the body (fit.py). A file that already is as the body is keeps its vertices to the bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import Diagnostic, GarmentcError
from garmentc.outfit.align.axes import Frame
from garmentc.outfit.align.choose import choose_gender, choose_guesses, gender_misfits
from garmentc.outfit.align.fit import Fit, measure_fit, sample_cloth, surface_area
from garmentc.outfit.align.options import AlignOptions
from garmentc.outfit.align.origins import FITTED
from garmentc.outfit.align.pose import arms_lowered
from garmentc.outfit.align.sides import INSIDE_OUT, facing_skin, turned_round
from garmentc.outfit.align.skin import RestBody
from garmentc.outfit.align.unpose import unpose
from garmentc.outfit.outfit import Outfit
from garmentc.smpl import GENDERS
from garmentc.smpl.body import BodyModel
from garmentc.smpl.skeleton import JOINT_COUNT

__all__ = ["AlignOptions", "Alignment", "align"]

SAMPLE = 600
"""Points on the cloth that guesses are judged by."""

MEASURED = 5_000
"""Vertices at most that the reported fit is measured at."""

STRAY = 3.0
"""Metres from the body's bounding box that no train or cape reaches."""

_NO_AREA = 1e-12
"""A surface smaller than this part of its extent squared is lines and points."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """An outfit in the body's axes and T-pose, and how it got there.

    outfit          vertices in metres, Y up, +Z front, the body model's origin, T-pose
    frame           unit, axes and origin of the file
    body            the body model that the outfit was fitted to
    betas           its shape
    rest_pose       "T", "A" or "given": the pose that the file has
    pose            (24, 3) that pose; zeros for "T"
    arms            degrees by which its arms hang below the T-pose's
    unpose_weights  (V, 24) blend weights by which the pose was undone, None for "T"
    fit             how the aligned outfit sits on the body's T-pose
    misfits         by gender, metres: how badly the outfit sits on each body that was tried (choose.gender_misfits)
    warnings        what was ambiguous or doesn't fit
    """

    outfit: Outfit
    frame: Frame
    body: BodyModel
    betas: NDArray[np.float64] | None
    rest_pose: Literal["T", "A", "given"]
    pose: NDArray[np.float64]
    arms: float
    unpose_weights: NDArray[np.float64] | None
    fit: Fit
    misfits: Mapping[str, float]
    warnings: tuple[Diagnostic, ...] = field(default=())

    @property
    def gender(self) -> str:
        return self.body.gender

    @property
    def to_body(self) -> NDArray[np.float64]:
        """(4, 4) similarity from file coordinates to the body's axes and metres, before the pose is undone."""
        return self.frame.matrix

    @property
    def summary(self) -> str:
        """One line for people: "centimetres, Z up, facing -Y, origin at the floor, T-pose, male body"."""
        frame = self.frame
        words = [str(frame)]
        if frame.origin == FITTED:
            words.append("origin found by fitting")
        elif any(frame.translation):
            words.append(f"origin at the {frame.origin}")
        arms = f" with the arms {self.arms:.0f}° lower" if self.rest_pose == "A" else ""
        words.append("pose as given" if self.rest_pose == "given" else f"{self.rest_pose}-pose{arms}")
        return ", ".join([*words, f"{self.gender} body"])


def align(
    outfit: Outfit,
    bodies: Mapping[str, BodyModel] | Callable[[str], BodyModel],
    options: AlignOptions | None = None,
) -> Alignment:
    """`outfit` in the body's canonical pose and axes.

    bodies   body models by gender, or a function that loads one (then "auto" tries female, male and neutral)
    options  what is known already

    The vertices come out unchanged, as the same array, where the file is in metres, Y up, facing +Z, in the T-pose and
    around the body model's origin.
    Raises GarmentcError where the outfit has no surface or there is no such body.
    """
    options = options or AlignOptions()
    rest_bodies = _rest_bodies(bodies, options)
    if not len(outfit.tri_v):
        raise GarmentcError("the outfit has no faces; export its surface too", outfit.path)
    extent = np.linalg.norm(np.ptp(outfit.vertices[outfit.tri_v.ravel()], axis=0))
    if not surface_area(outfit.vertices, outfit.tri_v) > _NO_AREA * extent**2:
        raise GarmentcError("all faces of the outfit have no area; export it again", outfit.path)
    cloth = sample_cloth(outfit.vertices, outfit.tri_v, SAMPLE)

    guesses, frame_warnings = choose_guesses(cloth, rest_bodies, options)
    misfits = gender_misfits(guesses, cloth, rest_bodies)
    gender, gender_warnings = choose_gender(misfits)
    frame, stance, body = guesses[gender].frame, guesses[gender].stance, rest_bodies[gender]
    normals = outfit.normals if frame.is_identity else frame.rotated(outfit.normals)
    aligned = replace(outfit, vertices=frame.apply(outfit.vertices), normals=normals)
    weights = None
    if stance.pose is not None and stance.pose.any():
        aligned, weights = unpose(aligned, body.model, stance.pose, options.betas)

    used = np.zeros(len(aligned.vertices), dtype=bool)
    used[aligned.tri_v] = True
    fit = measure_fit(aligned.vertices[used], body.surface.vertices, body.model.faces, MEASURED)
    warnings = [*frame_warnings, *gender_warnings, *_fit_warnings(fit)]
    if fit.on_body:
        warnings += _stray_warnings(aligned.vertices[used], body.surface.vertices)
        if facing_skin(sample_cloth(aligned.vertices, aligned.tri_v, SAMPLE), body.surface) > INSIDE_OUT:
            aligned = turned_round(aligned)
            message = "the outfit is inside out (its faces are wound to face the body); they were turned round"
            warnings.append(Diagnostic("outfit-inside-out", message))
    return Alignment(
        outfit=aligned,
        frame=frame,
        body=body.model,
        betas=options.betas,
        rest_pose="given" if options.given_pose is not None else "T" if stance.pose is None else "A",
        pose=np.zeros((JOINT_COUNT, 3)) if stance.pose is None else stance.pose,
        arms=0.0 if stance.pose is None else arms_lowered(stance.pose, body.surface.joints),
        unpose_weights=weights,
        fit=fit,
        misfits=misfits,
        warnings=tuple(replace(warning, file=str(outfit.path)) for warning in warnings),
    )


def _rest_bodies(
    bodies: Mapping[str, BodyModel] | Callable[[str], BodyModel], options: AlignOptions
) -> dict[str, RestBody]:
    """The bodies to try, by gender."""
    known = tuple(bodies) if isinstance(bodies, Mapping) else GENDERS
    genders = known if options.gender == "auto" else (options.gender,)
    if options.gender not in ("auto", *known):
        raise GarmentcError(f"there is no {options.gender} body; choose {' or '.join(known)}")
    load = bodies.__getitem__ if isinstance(bodies, Mapping) else bodies
    return {gender: RestBody.of(load(gender), options.betas) for gender in genders}


def _fit_warnings(fit: Fit) -> list[Diagnostic]:
    warnings = []
    if not fit.on_body:
        message = f"the outfit doesn't fit the body: mean gap {fit.mean_gap * 100:.1f} cm, {fit.inside:.0%} inside; "
        warnings.append(
            Diagnostic("outfit-does-not-fit", message + "check --units, --up, --pose, --gender and --betas")
        )
    if fit.inside > 0:
        message = f"{fit.inside:.1%} of the vertices are inside the body by up to {fit.depth * 1000:.1f} mm"
        warnings.append(Diagnostic("outfit-inside-body", message))
    return warnings


def _stray_warnings(vertices: NDArray[np.float64], body_vertices: NDArray[np.float64]) -> list[Diagnostic]:
    beyond = np.maximum(body_vertices.min(axis=0) - vertices, vertices - body_vertices.max(axis=0)).max(axis=1)
    strays = beyond > STRAY
    if not strays.any():
        return []
    message = f"{strays.sum()} vertices lie up to {beyond.max():.0f} m from the body; delete them if they are no part "
    return [Diagnostic("outfit-strays", message + "of the outfit, as positions get coarser the further they spread")]
