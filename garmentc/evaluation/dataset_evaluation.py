"""DeePSD's evaluation (Bertiche et al. 2021, section 5): bundles on outfits and motions that they have never seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path

from garmentc.errors import GarmentcError
from garmentc.evaluation.method import Method
from garmentc.evaluation.outfit_scores import OutfitScores, score_outfit
from garmentc.simulation.dataset import Dataset, Entry
from garmentc.simulation.task_runners import on_processes


@dataclass(frozen=True)
class DatasetEvaluation:
    """Methods measured on a split of a dataset.

    dataset, sha256, complete  as its manifest says
    frames                     of each sequence at most; None takes all accepted ones
    baseline                   bundle methods that the others are put in relation to
    """

    dataset: str
    sha256: str
    complete: bool
    split: str
    frames: int | None
    methods: tuple[Method, ...]
    baseline: tuple[Method, ...]
    outfits: tuple[OutfitScores, ...]


def evaluate_dataset(
    dataset: Dataset,
    split: str,
    methods: Sequence[Method],
    baseline: Sequence[Method] = (),
    *,
    frames: int | None = None,
    outfits: int | None = None,
    bodies: Sequence[Path] = (),
    workers: int = 1,
    progress: Callable[[str], None] = lambda outfit: None,
) -> DatasetEvaluation:
    """Measure `methods` and `baseline` on the split's outfits, each on all its sequences there.

    frames    of each sequence, spread evenly over the accepted ones; None takes all of these
    outfits   the first so many; None takes all
    bodies    model files of the bodies that are not default ones
    workers   processes; the result does not depend on them
    progress  called with an outfit's name when it has been measured
    Raises GarmentcError where the split holds no frames, a file is damaged or an outfit cannot be compiled.
    """
    chosen = outfits_of(dataset, split)[:outfits]
    if not chosen:
        raise GarmentcError(
            f"has no accepted frames in the split '{split}'; choose another with --split", dataset.folder
        )
    measure = partial(_measure, dataset, tuple(dict.fromkeys((*methods, *baseline))), frames, tuple(bodies))
    scores = {}
    for outfit in map(measure, chosen) if workers == 1 else on_processes(chosen, measure, workers):
        progress(outfit.outfit)
        scores[outfit.outfit] = outfit
    ordered = tuple(scores[entries[0].outfit] for entries in chosen)
    return DatasetEvaluation(
        dataset.name, dataset.sha256, dataset.complete, split, frames, tuple(methods), tuple(baseline), ordered
    )


def outfits_of(dataset: Dataset, split: str) -> list[tuple[Entry, ...]]:
    """The split's sequences that have accepted frames, outfit by outfit, in the manifest's order of outfits."""
    entries = [entry for entry in dataset.of_split(split) if entry.accepted]
    first = {entry.outfit: index for index, entry in reversed(list(enumerate(entries)))}
    ordered = sorted(entries, key=lambda entry: first[entry.outfit])
    return [tuple(group) for _, group in groupby(ordered, key=lambda entry: entry.outfit)]


def _measure(
    dataset: Dataset,
    methods: tuple[Method, ...],
    frames: int | None,
    bodies: tuple[Path, ...],
    entries: tuple[Entry, ...],
) -> OutfitScores:
    return score_outfit([dataset.sequence(entry) for entry in entries], methods, frames, bodies)
