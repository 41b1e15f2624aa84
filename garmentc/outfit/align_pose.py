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

EVIDENCE = 60
"""Independent observations that a sample of cloth is worth against `Turn.usual`: gaps of neighbouring points agree."""

GAP = 0.01
"""Metres: how far cloth usually is from where the body's skin would have it."""

OUTLIER = 0.03
"""Metres: points of the cloth further from the skin than this tell little about the limb inside (Cauchy weights)."""

LONGEST_STEP = 0.25
"""Radians or metres that one iteration may change."""


def a_pose(angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """The pose (24, 3) with the angles of `TURNS` (7,), radians, the same on both sides."""
    pose = np.zeros((JOINT_COUNT, 3))
    for turn, angle in zip(TURNS.values(), angles, strict=True):
        pose[turn.joint, turn.axis] = turn.sign * angle
    mirrored = pose[MIRROR] * [1, -1, -1]
    return pose + mirrored


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
        return RestBody(self.model, thin, self.weights[::step])

    def skin(self, pose: NDArray[np.float64] | None = None) -> Skin:
        """The skin in `pose` (24, 3), or in the T-pose."""
        if pose is None:
            return self.surface
        rest = self.surface
        transforms = joint_transforms(axis_angle_to_matrix(pose), rest.joints)
        blended = (self.weights @ transforms[:, :3, :].reshape(-1, 12)).reshape(-1, 3, 4)
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


def fit_stance(cloth: ClothSample, body: RestBody, start: Stance, turn: bool, iterations: int = 20) -> Stance:
    """Fit `body` into `cloth` (body axes, metres, not translated) from `start`.

    Gauss-Newton on the point-to-plane distances to the nearest skin (Chen and Medioni 1991), with Cauchy weights.
    With origin "fitted" the translation is fitted; any other origin stays where it is on the body.
    With `turn` the angles of `TURNS` are fitted, their usual sizes being the prior; otherwise the pose is kept.
    """
    free = start.origin == FITTED
    count = len(TURNS) if turn else 0
    stiffness = np.array([(GAP / turn.usual) ** 2 for turn in TURNS.values()])[:count] * len(cloth.points) / EVIDENCE
    here, best = start, start
    outward = 0.0
    for _ in range(iterations):
        surface = body.skin(here.pose)
        translation = here.translation if free else origin_translation(start.origin, surface)
        points = cloth.points + translation
        nearest = surface.nearest(points)
        here = replace(here, translation=translation, misfit=float(misfit(surface.distance(points, nearest))))
        best = min(best, here, key=lambda stance: stance.misfit)
        if not (free or turn):
            break
        normals = surface.normals[nearest]
        agreement = np.einsum("ij,ij->i", cloth.normals, normals)
        outward = outward or float(np.sign(agreement.sum())) or 1.0
        residual = np.einsum("ij,ij->i", normals, points - surface.vertices[nearest])
        weight = 1 / (1 + (residual / OUTLIER) ** 2) * np.where(agreement * outward > 0, 1, 0.1)
        jacobian = -normals if free else np.zeros((len(points), 0))
        if turn:
            moves = np.einsum("ij,pij->ip", normals, _skin_moves(body, nearest, here.angles))
            jacobian = np.concatenate([moves, jacobian], axis=1)
        prior, pull = np.full((2, jacobian.shape[1]), 1e-9)
        prior[:count] += stiffness
        pull[:count] -= stiffness * here.angles[:count]
        normal_matrix = (jacobian * weight[:, None]).T @ jacobian + np.diag(prior)
        step = np.linalg.solve(normal_matrix, jacobian.T @ (weight * residual) + pull)
        step *= min(1.0, LONGEST_STEP / max(np.abs(step).max(), 1e-12))
        if turn:
            angles = here.angles + step[:count]
            here = replace(here, pose=a_pose(angles), angles=angles)
        if free:
            here = replace(here, translation=here.translation + step[count:])
        if np.abs(step).max() < 2e-4:
            break
    return best


def _skin_moves(body: RestBody, index: NDArray[np.int64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative (7, S, 3) of the posed positions of body vertices `index` by each angle."""
    vertices, weights = body.surface.vertices[index], body.weights[index]
    h = 1e-4
    poses = np.stack([a_pose(angles), *(a_pose(angles + h * unit) for unit in np.eye(len(angles)))])
    moved = skin(vertices, weights, joint_transforms(axis_angle_to_matrix(poses), body.surface.joints))
    return (moved[1:] - moved[0]) / h
