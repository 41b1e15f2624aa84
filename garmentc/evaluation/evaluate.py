"""DeePSD's metrics of an outfit along a motion."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.evaluation.bared_skin import CoveredSkin
from garmentc.evaluation.clean_frames import CleanFrames, touching_share
from garmentc.evaluation.metrics import bend, edge_mm, signed_distance
from garmentc.evaluation.open_arms import open_arms
from garmentc.evaluation.posed_outfit import PosedOutfit
from garmentc.outfit.topology import edge_lengths, edges
from garmentc.smpl.body import BodyModel
from garmentc.smpl.motion import Motion

DEEP = 0.001
"""Metres: vertices deeper inside the body than this are counted a second time, apart."""


@dataclass(frozen=True)
class EvaluationOptions:
    """What is measured.

    step         every step-th frame of a motion is evaluated
    arms_opened  degrees, see `open_arms`; 0 takes the motion as it is
    clean        when a frame counts as clean
    """

    step: int = 10
    arms_opened: float = 0.0
    clean: CleanFrames = field(default_factory=CleanFrames)

    def __post_init__(self) -> None:
        if self.step < 1:
            raise GarmentcError(f"a step of {self.step} frames does not advance; choose 1 or more")


@dataclass(frozen=True)
class BodyFrames:
    """The body in the evaluated frames of a motion, at the origin: no metric depends on where it walks.

    rest      (V, 3) the body in the rest pose
    poses     (T, 24, 3)
    vertices  (T, V, 3)
    clean     (T,) bool
    """

    motion: str
    rest: NDArray[Any]
    poses: NDArray[Any]
    vertices: NDArray[Any]
    clean: NDArray[np.bool_]


@dataclass(frozen=True)
class FrameScores:
    """One outfit in the frames of one motion: each array is (T,).

    clean      the body leaves room for cloth
    collision  share of vertices inside the body
    deep       share of vertices deeper inside than DEEP
    bared      share of the skin that is beneath the cloth at rest and has come through it
    edge_mm    mean |length - rest length|
    bend       mean 1 - cos between neighbouring vertex normals
    """

    motion: str
    clean: NDArray[np.bool_]
    collision: NDArray[np.float64]
    deep: NDArray[np.float64]
    bared: NDArray[np.float64]
    edge_mm: NDArray[np.float64]
    bend: NDArray[np.float64]


@dataclass(frozen=True)
class Summary:
    """Means over `frames` frames; None where there are no frames."""

    frames: int
    collision: float | None
    deep: float | None
    bared: float | None
    edge_mm: float | None
    bend: float | None


def body_frames(body: BodyModel, betas: NDArray[Any] | None, motion: Motion, options: EvaluationOptions) -> BodyFrames:
    """Pose the body along `motion`, with pose correctives, and find the clean frames."""
    poses = open_arms(motion.poses[:: options.step], options.arms_opened)
    return posed_frames(motion.name, body, betas, poses, options)


def posed_frames(
    name: str, body: BodyModel, betas: NDArray[Any] | None, poses: NDArray[Any], options: EvaluationOptions
) -> BodyFrames:
    """The same of `poses` (T, 24, 3) as they are."""
    vertices = body.posed(poses, betas)
    clean = touching_share(body, betas, vertices, options.clean.margin) <= options.clean.allowed
    return BodyFrames(name, body.shaped(betas), poses, vertices, clean)


def evaluate(
    outfit: PosedOutfit, body: BodyModel, frames: BodyFrames, moved: Iterable[NDArray[Any]] | None = None
) -> FrameScores:
    """Measure `outfit` against the posed body in every frame; `moved` are its vertices (N, 3) there, if known."""
    pairs = edges(outfit.triangles)
    rest_lengths = edge_lengths(outfit.rest, pairs)
    covered = CoveredSkin.of(outfit.rest, outfit.triangles, frames.rest, body.faces)
    rows = []
    moved = map(outfit.posed, frames.poses) if moved is None else moved
    for vertices, skin in zip(moved, frames.vertices, strict=True):
        distance = signed_distance(vertices, skin, body.faces)
        rows.append(
            (
                (distance < 0).mean(),
                (distance < -DEEP).mean(),
                covered.bared(vertices, skin),
                edge_mm(vertices, rest_lengths, pairs),
                bend(vertices, outfit.triangles, pairs),
            )
        )
    columns = np.array(rows).reshape(-1, 5).T
    return FrameScores(frames.motion, frames.clean, *columns)


def summarise(scores: Sequence[FrameScores], clean_only: bool) -> Summary:
    """Means over all frames of several motions, or over their clean frames."""
    taken = np.concatenate([score.clean if clean_only else np.ones_like(score.clean) for score in scores])
    if not taken.any():
        return Summary(0, None, None, None, None, None)

    def mean(name: str) -> float:
        return float(np.concatenate([getattr(score, name) for score in scores])[taken].mean())

    return Summary(int(taken.sum()), *map(mean, ("collision", "deep", "bared", "edge_mm", "bend")))
