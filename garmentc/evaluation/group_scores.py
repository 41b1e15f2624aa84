"""Scores summed up: over everything, over the categories of outfits, over the kinds of garments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.evaluation.dataset_evaluation import DatasetEvaluation
from garmentc.evaluation.method import NEAREST_METHOD
from garmentc.evaluation.outfit_scores import MethodScores, OutfitScores

PERCENTILE = 95


@dataclass(frozen=True)
class Figure:
    """mean over frames per outfit, then over outfits; p95 over all frames; None where there are no frames."""

    mean: float | None
    p95: float | None


@dataclass(frozen=True)
class GroupScores:
    """One method on a group of outfits. Millimetres, and shares in [0, 1]; `clean_` ones over clean frames only."""

    group: str
    method: str
    outfits: int
    frames: int
    clean_frames: int
    error_mm: Figure
    edge_mm: Figure
    bend: Figure
    collision: Figure
    deep: Figure
    clean_collision: Figure
    clean_deep: Figure


@dataclass(frozen=True)
class GarmentScores:
    """The error of one method on all garments of a kind, whatever is worn with them."""

    garment: str
    method: str
    outfits: int
    frames: int
    error_mm: Figure


@dataclass(frozen=True)
class Ratio:
    """A method's mean over a baseline's, over everything; None where the baseline's is 0 or there are no frames."""

    method: str
    baseline: str
    error: float | None
    clean_collision: float | None


def method_names(evaluation: DatasetEvaluation) -> tuple[str, ...]:
    """Of all rows: the simulation first."""
    return tuple(evaluation.outfits[0].scores)


def overall(evaluation: DatasetEvaluation) -> tuple[GroupScores, ...]:
    """Each method over all outfits."""
    return tuple(_group("all", method, evaluation.outfits) for method in method_names(evaluation))


def by_category(evaluation: DatasetEvaluation) -> tuple[GroupScores, ...]:
    """Each method over the outfits of each category, in alphabetical order."""
    return tuple(
        _group(category, method, [outfit for outfit in evaluation.outfits if outfit.category == category])
        for category in sorted({outfit.category for outfit in evaluation.outfits})
        for method in method_names(evaluation)
    )


def by_outfit(evaluation: DatasetEvaluation) -> tuple[GroupScores, ...]:
    """Each method on each outfit."""
    return tuple(
        _group(outfit.outfit, method, [outfit]) for outfit in evaluation.outfits for method in method_names(evaluation)
    )


def by_garment(evaluation: DatasetEvaluation) -> tuple[GarmentScores, ...]:
    """Each method over each kind of garment, in alphabetical order: as the paper's last table has it."""
    return tuple(
        _garment(kind, method, [outfit for outfit in evaluation.outfits if kind in outfit.garments])
        for kind in sorted({kind for outfit in evaluation.outfits for kind in outfit.garments})
        for method in method_names(evaluation)
    )


def ratios(evaluation: DatasetEvaluation) -> tuple[Ratio, ...]:
    """Each method to nearest-body skinning, and to the baseline compiled with the same profile."""
    rows = {row.method: row for row in overall(evaluation)}
    nearest = [method for method in evaluation.methods if method == NEAREST_METHOD]
    pairs = [
        (method, other)
        for method in evaluation.methods
        if method != NEAREST_METHOD and method not in evaluation.baseline
        for other in (*nearest, *evaluation.baseline)
        if other == NEAREST_METHOD or other.profile == method.profile
    ]
    return tuple(
        Ratio(
            method.name,
            other.name,
            _over(rows[method.name].error_mm, rows[other.name].error_mm),
            _over(rows[method.name].clean_collision, rows[other.name].clean_collision),
        )
        for method, other in pairs
    )


def _over(figure: Figure, base: Figure) -> float | None:
    if figure.mean is None or not base.mean:
        return None
    return figure.mean / base.mean


def _group(name: str, method: str, outfits: Sequence[OutfitScores]) -> GroupScores:
    def figure(metric: str, clean: bool = False) -> Figure:
        return _figure(outfits, lambda outfit: getattr(outfit.scores[method], metric)[outfit.clean if clean else ...])

    return GroupScores(
        group=name,
        method=method,
        outfits=len(outfits),
        frames=sum(len(outfit.frames) for outfit in outfits),
        clean_frames=sum(int(outfit.clean.sum()) for outfit in outfits),
        error_mm=figure("error_mm"),
        edge_mm=figure("edge_mm"),
        bend=figure("bend"),
        collision=figure("collision"),
        deep=figure("deep"),
        clean_collision=figure("collision", clean=True),
        clean_deep=figure("deep", clean=True),
    )


def _garment(kind: str, method: str, outfits: Sequence[OutfitScores]) -> GarmentScores:
    def errors(outfit: OutfitScores) -> NDArray[Any]:
        worn = [index for index, garment in enumerate(outfit.garments) if garment == kind]
        scores: MethodScores = outfit.scores[method]
        return np.asarray(scores.garment_error_mm[:, worn].mean(axis=1))

    return GarmentScores(
        kind, method, len(outfits), sum(len(outfit.frames) for outfit in outfits), _figure(outfits, errors)
    )


def _figure(outfits: Sequence[OutfitScores], values: Callable[[OutfitScores], NDArray[Any]]) -> Figure:
    measured = [of_frames for outfit in outfits if len(of_frames := values(outfit))]
    if not measured:
        return Figure(None, None)
    return Figure(
        float(np.mean([of_frames.mean() for of_frames in measured])),
        float(np.percentile(np.concatenate(measured), PERCENTILE)),
    )
