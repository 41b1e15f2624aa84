"""The samples to look at: the best, the median and the worst one."""

from __future__ import annotations

from dataclasses import dataclass

from garmentc.evaluation.dataset_evaluation import DatasetEvaluation
from garmentc.evaluation.method import Method


@dataclass(frozen=True)
class Representative:
    """One frame and its place among all frames by the error of `method`. collision is a share."""

    place: str
    method: str
    outfit: str
    category: str
    sequence: str
    frame: int
    error_mm: float
    collision: float


def shown_method(evaluation: DatasetEvaluation) -> Method:
    """The one that the picture shows: the last, so of one bundle its last profile."""
    return evaluation.methods[-1]


def representatives(evaluation: DatasetEvaluation) -> tuple[Representative, ...]:
    """The frames with the least, the median and the largest error; of equal ones the first by name."""
    method = shown_method(evaluation).name
    ranked = sorted(
        (
            Representative(
                "",
                method,
                outfit.outfit,
                outfit.category,
                sequence,
                frame,
                float(outfit.scores[method].error_mm[index]),
                float(outfit.scores[method].collision[index]),
            )
            for outfit in evaluation.outfits
            for index, (sequence, frame) in enumerate(outfit.frames)
        ),
        key=lambda sample: (sample.error_mm, sample.sequence, sample.frame),
    )
    places = {"best": 0, "median": len(ranked) // 2, "worst": len(ranked) - 1}
    return tuple(Representative(**{**vars(ranked[at]), "place": place}) for place, at in places.items())
