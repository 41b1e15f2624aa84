"""The A-pose that an outfit was modelled in, found by fitting the body into it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.align_fit import ClothSample, Skin, misfit
from garmentc.outfit.align_origin import FITTED, origin_translation
from garmentc.outfit.topology import unit_rows
from garmentc.smpl.body import BodyModel
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_COUNT, JOINT_NAMES, MIRROR
from garmentc.smpl.skinning import joint_transforms, skin


@dataclass(frozen=True)
class Turn:
    """One angle of the A-pose: `joint` turns about its `axis` (0 x, 1 y, 2 z), its twin on the right mirrors it.

    `usual` is the standard deviation, in radians, that modelled poses are expected to have.
    """

    joint: int
    axis: int
    sign: int
    usual: float


TURNS = {
    "collar down": Turn(JOINT_NAMES.index("left_collar"), 2, -1, 0.3),
    "shoulder down": Turn(JOINT_NAMES.index("left_shoulder"), 2, -1, 0.8),
    "shoulder forward": Turn(JOINT_NAMES.index("left_shoulder"), 1, -1, 0.2),
    "elbow bend": Turn(JOINT_NAMES.index("left_elbow"), 1, -1, 0.5),
    "hip spread": Turn(JOINT_NAMES.index("left_hip"), 2, 1, 0.15),
    "hip forward": Turn(JOINT_NAMES.index("left_hip"), 0, -1, 0.1),
    "knee bend": Turn(JOINT_NAMES.index("left_knee"), 0, 1, 0.1),
}

NO_TURNS, ALL_TURNS = (np.full(len(TURNS), fitted) for fitted in (False, True))

_MOVED_BY = {
    JOINT_NAMES.index(joint): np.array([JOINT_NAMES.index(name) for name in moved])
    for joint, moved in {
        "left_collar": ("left_shoulder", "left_elbow"),
        "left_shoulder": ("left_shoulder", "left_elbow"),
        "left_elbow": ("left_elbow",),
        "left_hip": ("left_hip", "left_knee"),
        "left_knee": ("left_knee",),
    }.items()
}
"""The limbs whose cloth tells about the turn of a joint. Not the hands: wide skirts reach them."""

WRAPPING_GAP = 0.05
ONE_SIDED = 0.4
FEW_POINTS = 8
"""Cloth wraps a limb where it has so many points within this gap, in metres, and their mean normal is shorter."""

ITERATIONS = 20

EVIDENCE = 60
"""Independent observations that a sample of cloth is worth against `Turn.usual`: gaps of neighbouring points agree."""

GAP = 0.01
"""Metres: how far cloth usually is from where the body's skin would have it."""

OUTLIER = 0.03
"""Metres: points of the cloth further from the skin than this tell little about the limb inside (Cauchy weights)."""

WIDENED, NARROWING = 4.0, 0.75
"""The first iteration takes points so many times further for real, each later one fewer (graduated non-convexity)."""

LONGEST_STEP = 0.25
"""Radians or metres that one iteration may change."""


def a_pose(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """The pose (24, 3) with the angles of `TURNS` (7,), radians, the same on both sides."""
    pose = np.zeros((JOINT_COUNT, 3))
    for turn, angle in zip(TURNS.values(), angles, strict=True):
        pose[turn.joint, turn.axis] = turn.sign * angle
    mirrored = pose[MIRROR] * [1, -1, -1]
    return pose + mirrored


def largest_turn(angles: NDArray[np.float64]) -> float:
    """Radians by which the limb that moved most has moved, given `angles` (7,); raised arms don't count.

    Collar and shoulder count together: cloth cut for other shoulders turns them against each other.
    """
    collar, shoulder, *others = angles
    return float(max(collar + shoulder, np.abs(others).max()))


def arms_lowered(pose: NDArray[np.float64], joints: NDArray[Any]) -> float:
    """Degrees by which the upper arms hang below those of the T-pose, the mean of both sides."""
    turned = posed_joints(pose, joints)
    lowered = []
    for side in ("left", "right"):
        shoulder, elbow = JOINT_NAMES.index(f"{side}_shoulder"), JOINT_NAMES.index(f"{side}_elbow")
        fall = [np.arctan2(*_drop(at[shoulder], at[elbow])) for at in (joints, turned)]
        lowered.append(fall[1] - fall[0])
    return float(np.degrees(np.mean(lowered)))


def _drop(shoulder: NDArray[Any], elbow: NDArray[Any]) -> tuple[float, float]:
    return float(shoulder[1] - elbow[1]), float(abs(elbow[0] - shoulder[0]))


def posed_joints(pose: NDArray[np.float64], joints: NDArray[Any]) -> NDArray[np.float64]:
    """Where `pose` (24, 3) takes the rest `joints` (24, 3)."""
    transforms = joint_transforms(axis_angle_to_matrix(pose), joints)
    turned: NDArray[np.float64] = np.einsum("kij,kj->ki", transforms[:, :3, :3], joints) + transforms[:, :3, 3]
    return turned


@dataclass(frozen=True)
class RestBody:
    """A body of one shape, ready to be posed many times; float64, without pose correctives.

    surface  its skin in the T-pose
    weights  (V, 24) blend weights of the skin's vertices
    """

    model: BodyModel
    surface: Skin
    weights: NDArray[np.float64]

    @classmethod
    def of(cls, model: BodyModel, betas: NDArray[Any] | None) -> RestBody:
        """The body `model` with shape `betas`."""
        surface = Skin.of(model.shaped(betas), model.faces, model.joints(betas))
        return cls(model, surface, model.weights.astype(np.float64))

    def thinned(self, step: int) -> RestBody:
        """The body with every `step`-th vertex of its skin."""
        whole = self.surface
        radii = whole.radii[::step] * np.sqrt(step)
        thin = Skin(whole.vertices[::step].copy(), whole.normals[::step], radii, whole.joints)
        return RestBody(self.model, thin, self.weights[::step].copy())

    def skin(self, pose: NDArray[np.float64] | None = None) -> Skin:
        """The skin in `pose` (24, 3), or in the T-pose."""
        if pose is None:
            return self.surface
        rest = self.surface
        transforms = joint_transforms(axis_angle_to_matrix(pose), rest.joints)
        # Not a matrix product: for so small a one, waking BLAS's threads takes longer than the sums.
        blended = np.einsum("nj,jk->nk", self.weights, transforms[:, :3, :].reshape(-1, 12)).reshape(-1, 3, 4)
        vertices = np.einsum("nij,nj->ni", blended[..., :3], rest.vertices) + blended[..., 3]
        normals = unit_rows(np.einsum("nij,nj->ni", blended[..., :3], rest.normals))
        return Skin(vertices, normals, rest.radii, posed_joints(pose, rest.joints))


@dataclass(frozen=True)
class Stance:
    """How a body stands in an outfit: its pose, where the file's origin lies on it, and how well the cloth then sits.

    pose         (24, 3), or None for the T-pose
    angles       (7,) of `TURNS` where the pose was fitted
    translation  (3,) metres, added to the cloth
    misfit       metres, see align_fit.misfit
    """

    pose: NDArray[np.float64] | None
    origin: str
    translation: NDArray[np.float64]
    misfit: float = np.inf
    angles: NDArray[np.float64] = field(default_factory=lambda: np.zeros(len(TURNS)))


def fit_stance(cloth: ClothSample, body: RestBody, start: Stance, turns: NDArray[np.bool_] = NO_TURNS) -> Stance:
    """Fit `body` into `cloth` (body axes, metres, not translated) from `start`.

    Gauss-Newton on the point-to-plane distances to the nearest skin (Chen and Medioni 1991), with Cauchy weights.
    With origin "fitted" the translation is fitted; any other origin stays where it is on the body.
    `turns` (7,) says which angles of `TURNS` are fitted, their usual sizes being the prior; the others are kept.
    """
    free = start.origin == FITTED
    active = np.flatnonzero(turns)
    usual = np.array([turn.usual for turn in TURNS.values()])[active]
    stiffness = (GAP / usual) ** 2 * len(cloth.points) / EVIDENCE
    here, best = start, replace(start, misfit=np.inf)
    outward = 0.0
    for iteration in range(ITERATIONS):
        surface = body.skin(here.pose)
        translation = here.translation if free else origin_translation(start.origin, surface)
        points = cloth.points + translation
        nearest = surface.nearest(points)
        here = replace(here, translation=translation, misfit=float(misfit(surface.height(points, nearest))))
        best = min(best, here, key=lambda stance: stance.misfit)
        if not (free or len(active)):
            break
        normals = surface.normals[nearest]
        agreement = np.einsum("ij,ij->i", cloth.normals, normals)
        outward = outward or float(np.sign(agreement.sum())) or 1.0
        residual = np.einsum("ij,ij->i", normals, points - surface.vertices[nearest])
        outlier = OUTLIER * max(1.0, WIDENED * NARROWING**iteration)
        weight = 1 / (1 + (residual / outlier) ** 2) * np.where(agreement * outward > 0, 1, 0.1)
        moves = _skin_moves(body, nearest, here.angles, active)
        jacobian = np.einsum("ij,pij->ip", normals, moves)
        prior, pull = stiffness, -stiffness * here.angles[active]
        if free:
            jacobian = np.concatenate([jacobian, -normals], axis=1)
            prior, pull = np.append(prior, np.zeros(3)), np.append(pull, np.zeros(3))
        normal_matrix = (jacobian * weight[:, None]).T @ jacobian + np.diag(prior + 1e-9)
        step = np.linalg.solve(normal_matrix, jacobian.T @ (weight * residual) + pull)
        step *= min(1.0, LONGEST_STEP / max(np.abs(step).max(), 1e-12))
        if len(active):
            angles = here.angles.copy()
            angles[active] += step[: len(active)]
            here = replace(here, pose=a_pose(angles), angles=angles)
        if free:
            here = replace(here, translation=here.translation + step[len(active) :])
        if np.abs(step).max() < 5e-4 and outlier == OUTLIER:
            break
    return best


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
    agreement = np.einsum("ij,ij->i", cloth.normals, normals)
    # A bodice between trunk and hanging arm faces the arm: it is no sleeve.
    close = (np.abs(surface.height(points, nearest)) < WRAPPING_GAP) & (agreement * agreement.sum() > 0)
    told = []
    for turn in TURNS.values():
        moved = _MOVED_BY[turn.joint]
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
    return (moved[1:] - moved[0]) / h
