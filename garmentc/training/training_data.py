"""What a run learns from and is measured on: outfits of one dataset or several."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from garmentc.errors import GarmentcError
from garmentc.simulation.dataset import Dataset
from garmentc.training.checkpoint import DataFacts
from garmentc.training.recipe import Recipe
from garmentc.training.rigid_outfits import rigid_outfits
from garmentc.training.simulated_outfits import SimulatedOutfit, read_outfits, validation_split

HELD_OUT = ("test", "test_outfits")


@dataclass(frozen=True)
class TrainingData:
    """`outfits` to learn from, those `held_out` to measure, and the `facts` that tell this data from other data."""

    outfits: tuple[SimulatedOutfit, ...]
    held_out: tuple[SimulatedOutfit, ...]
    facts: DataFacts


def read_training_data(
    datasets: Sequence[Dataset], recipe: Recipe, measure: str | None, bodies: Sequence[Path] = ()
) -> TrainingData:
    """The outfits of the split "train" of all `datasets`, and rigid ones where `recipe` wants some.

    measure  split that is held out to be measured, unless `recipe` withholds outfits for validation; None: nothing is
    bodies   model files of the bodies that the datasets were simulated on; none for the default body

    Raises GarmentcError where files are missing or damaged, where bodies are not given, or where one dataset would
    train on an outfit that another one holds out.
    """
    outfits = [outfit for data in datasets for outfit in read_outfits(data, "train", recipe.metadata, bodies)]
    if len(datasets) > 1:
        _check_held_out(datasets, outfits)
    outfits, held_out = validation_split(outfits, recipe.validation)
    if measure is None:
        held_out = []
    elif not recipe.validation:
        held_out = [outfit for data in datasets for outfit in read_outfits(data, measure, recipe.metadata, bodies)]
    facts = data_facts(datasets, outfits)
    if outfits:
        outfits = [*outfits, *rigid_outfits(recipe.rigid_outfits, outfits, recipe.seed)]
    return TrainingData(tuple(outfits), tuple(held_out), facts)


def data_facts(datasets: Sequence[Dataset], outfits: Sequence[SimulatedOutfit]) -> DataFacts:
    """Names and hashes of `datasets`, joined where there are several, and what is learned from them."""
    name, digest = " + ".join(data.name for data in datasets), datasets[0].sha256
    if len(datasets) > 1:
        digest = hashlib.sha256("\n".join(data.sha256 for data in datasets).encode()).hexdigest()
    return DataFacts(name, digest, len(outfits), sum(map(len, outfits)))


def _check_held_out(datasets: Sequence[Dataset], outfits: Sequence[SimulatedOutfit]) -> None:
    learned = {outfit.sample.vertices.numpy().tobytes(): outfit.sample.name for outfit in outfits}
    for data in datasets:
        for entry in (entry for split in HELD_OUT for entry in data.of_split(split)):
            name = learned.get(data.sequence(entry).template.astype("float32").tobytes())
            if name is not None:
                raise GarmentcError(
                    f"holds out the outfit '{entry.name}', but another dataset trains on it as '{name}'; "
                    "simulate that one with another --seed",
                    data.folder,
                )
