"""How a body stands in an outfit: its pose and place, fitted to the cloth."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.align.fit import ClothSample, misfit
from garmentc.outfit.align.origins import FITTED, origin_translation
from garmentc.outfit.align.pose import LIMBS_MOVED_BY, NO_TURNS, TURNS, a_pose
from garmentc.outfit.align.skin import RestBody, Skin
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import MIRROR
from garmentc.smpl.skinning import joint_transforms, skin

WRAPPING_GAP = 0.05
ONE_SIDED = 0.4
FEW_POINTS = 8
"""Cloth wraps a limb where it has so many points within this gap, in metres, and their mean normal is shorter."""

ITERATIONS = 20

TRUSTED = 1.1
"""The last iteration is the result, unless its misfit is so many times that of the best one."""

EVIDENCE = 60
"""Independent observations that a sample of cloth is worth against `Turn.usual`: gaps of neighbouring points agree."""

GAP = 0.01
"""Metres: how far cloth usually is from where the body's skin would have it."""

OUTLIER = 0.03
"""Metres: points of the cloth further from the skin than this tell little about the limb inside (Cauchy weights)."""

WIDENED, NARROWING = 4.0, 0.75
"""The first iteration takes points so many times further for real, each later one fewer (graduated non-convexity)."""

LONGEST_STEP, SMALLEST_STEP = 0.25, 5e-4
"""Radians or metres that one iteration may change, and that end the fit."""


@dataclass(frozen=True)
class Stance:
    """How a body stands in an outfit: its pose, where the file's origin lies on it, and how well the cloth then sits.

    pose         (24, 3), or None for the T-pose
    angles       (7,) of `TURNS` where the pose was fitted
    translation  (3,) metres, added to the cloth
    misfit       metres, see fit.misfit
    """

    pose: NDArray[np.float64] | None
    origin: str
    translation: NDArray[np.float64]
    misfit: float = np.inf
    angles: NDArray[np.float64] = field(default_factory=lambda: np.zeros(len(TURNS)))


def fit_stance(cloth: ClothSample, body: RestBody, start: Stance, turns: NDArray[np.bool_] = NO_TURNS) -> Stance:
    """Fit `body` into `cloth` (body axes, metres, not translated) from `start`.

    Gauss-Newton on the point-to-plane distances to the nearest skin (Chen and Medioni 1991), with Cauchy weights. The
    median distance is taken off: cloth lies on the skin as on one that is a little thicker all over.
    With origin "fitted" the translation is fitted; any other origin stays where it is on the body.
    `turns` (7,) says which angles of `TURNS` are fitted, their usual sizes being the prior; the others are kept.
    """
    active = np.flatnonzero(turns)
    moved, last = start, replace(start, misfit=np.inf)
    best = last
    for iteration in range(ITERATIONS):
        surface = body.skin(moved.pose)
        moved = _placed(moved, surface)
        points = cloth.points + moved.translation
        nearest = surface.nearest(points)
        last = replace(moved, misfit=float(misfit(surface.height(points, nearest))))
        best = min(best, last, key=lambda stance: stance.misfit)
        outlier = OUTLIER * max(1.0, WIDENED * NARROWING**iteration)
        residual, weight = _residuals(points, cloth.normals, surface, nearest, outlier)
        normals = surface.normals[nearest]
        by_angle = np.einsum("ij,pij->ip", normals, _skin_moves(body, nearest, moved.angles, active))
        by_translation = -normals if start.origin == FITTED else np.zeros((len(points), 0))
        step = _step(np.concatenate([by_angle, by_translation], axis=1), residual, weight, moved.angles[active], active)
        if np.abs(step).max(initial=0) < SMALLEST_STEP and outlier == OUTLIER:
            break
        moved = _moved(moved, active, step)
    return last if last.misfit < TRUSTED * best.misfit else best


def _placed(stance: Stance, surface: Skin) -> Stance:
    """`stance` with a known origin where it is on the posed body."""
    return (
        stance if stance.origin == FITTED else replace(stance, translation=origin_translation(stance.origin, surface))
    )


def _residuals(
    points: NDArray[np.float64],
    cloth_normals: NDArray[np.float64],
    surface: Skin,
    nearest: NDArray[np.int64],
    outlier: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Heights (S,) of `points` over the skin less their median, and weights (S,).

    Outliers count little, and so does cloth that faces the other way than the skin: a lining, or the far side.
    """
    normals = surface.normals[nearest]
    facing = _facing(cloth_normals, normals)
    height = np.einsum("ij,ij->i", normals, points - surface.vertices[nearest])
    residual = height - np.median(height[facing])
    return residual, np.where(facing, 1.0, 0.1) / (1 + (residual / outlier) ** 2)


def _facing(cloth_normals: NDArray[np.float64], skin_normals: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where cloth and skin face the same way, (S,); files that wind their faces inward included."""
    agreement = np.einsum("ij,ij->i", cloth_normals, skin_normals)
    facing: NDArray[np.bool_] = agreement * (1.0 if agreement.sum() >= 0 else -1.0) >= 0
    return facing


def _step(
    jacobian: NDArray[np.float64],
    residual: NDArray[np.float64],
    weight: NDArray[np.float64],
    angles: NDArray[np.float64],
    active: NDArray[np.int64],
) -> NDArray[np.float64]:
    """The Gauss-Newton step of the `active` angles, radians, and of the translation where it is free, metres."""
    usual = np.array([turn.usual for turn in TURNS.values()])[active]
    stiffness = (GAP / usual) ** 2 * len(residual) / EVIDENCE
    normal_matrix = (jacobian * weight[:, None]).T @ jacobian + 1e-9 * np.eye(jacobian.shape[1])
    gradient = jacobian.T @ (weight * residual)
    normal_matrix[: len(active), : len(active)] += np.diag(stiffness)
    gradient[: len(active)] -= stiffness * angles
    step = np.linalg.solve(normal_matrix, gradient).astype(np.float64, copy=False)
    step *= min(1.0, LONGEST_STEP / max(np.abs(step).max(initial=0), 1e-12))
    return step


def _moved(stance: Stance, active: NDArray[np.int64], step: NDArray[np.float64]) -> Stance:
    if len(active):
        angles = stance.angles.copy()
        angles[active] += step[: len(active)]
        stance = replace(stance, pose=a_pose(angles), angles=angles)
    if stance.origin == FITTED:
        stance = replace(stance, translation=stance.translation + step[len(active) :])
    return stance


def wrapped_turns(cloth: ClothSample, body: RestBody, stance: Stance) -> NDArray[np.bool_]:
    """Which of `TURNS` (7,) the cloth tells about: those of limbs that it wraps all round.

    Skirts and capes touch a limb from one side only; the limb could be anywhere inside. There the skin next to the
    cloth looks one way; in a sleeve or trouser leg it looks every way and its mean normal is short.
    """
    surface = body.skin(stance.pose)
    points = cloth.points + stance.translation
    nearest = surface.nearest(points)
    limb = body.weights[nearest].argmax(axis=1)
    normals = surface.normals[nearest]
    # A bodice between trunk and hanging arm faces the arm: it is no sleeve.
    close = (np.abs(surface.height(points, nearest)) < WRAPPING_GAP) & _facing(cloth.normals, normals)
    told = []
    for turn in TURNS.values():
        moved = LIMBS_MOVED_BY[turn.joint]
        left, right = (close & np.isin(limb, side) for side in (moved, MIRROR[moved]))
        around = np.concatenate([normals[left], normals[right] * [-1, 1, 1]])
        told.append(len(around) >= FEW_POINTS and bool(np.linalg.norm(around.mean(axis=0)) < ONE_SIDED))
    return np.array(told)


def _skin_moves(
    body: RestBody, index: NDArray[np.int64], angles: NDArray[np.float64], active: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Derivative (A, S, 3) of the posed positions of body vertices `index` (S,) by each `active` (A,) angle."""
    vertices, weights = body.surface.vertices[index], body.weights[index]
    h = 1e-4
    poses = np.stack([a_pose(angles), *(a_pose(angles + h * unit) for unit in np.eye(len(angles))[active])])
    moved = skin(vertices, weights, joint_transforms(axis_angle_to_matrix(poses), body.surface.joints))
    derivative: NDArray[np.float64] = (moved[1:] - moved[0]) / h
    return derivative
