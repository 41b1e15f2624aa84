"""What a run keeps between starts: checkpoint.pt, written whole or not at all, read without executing anything."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch

from garmentc.errors import GarmentcError
from garmentc.output import written_whole
from garmentc.training.deepsd_network import Deepsd
from garmentc.training.recipe import Recipe, differences, recipe_of
from garmentc.training.stage import Progress

CHECKPOINT = "checkpoint.pt"


@dataclass(frozen=True)
class DataFacts:
    """What a network learns from: a dataset by its name and hash, outfits and frames of the split "train"."""

    name: str
    sha256: str
    outfits: int
    frames: int


@dataclass(frozen=True)
class Checkpoint:
    """A network under training.

    optimizer  state of the stage's optimiser; None at the beginning of a stage
    """

    recipe: Recipe
    data: DataFacts
    network: dict[str, Any]
    optimizer: dict[str, Any] | None
    progress: Progress

    def restored(self) -> Deepsd:
        """The network."""
        network = Deepsd(self.recipe.network)
        network.load_state_dict(self.network)
        return network


def write_checkpoint(folder: Path, checkpoint: Checkpoint) -> None:
    """Raises GarmentcError where it cannot be written."""
    document = {
        "recipe": json.dumps(checkpoint.recipe.document()),
        "data": asdict(checkpoint.data),
        "network": checkpoint.network,
        "optimizer": checkpoint.optimizer,
        "progress": asdict(checkpoint.progress),
    }
    with written_whole(folder / CHECKPOINT) as file:
        torch.save(document, file)


def read_checkpoint(folder: Path) -> Checkpoint | None:
    """The run in `folder`; None where it has not begun. Raises GarmentcError where its checkpoint is damaged."""
    path = folder / CHECKPOINT
    if not path.exists():
        return None
    try:
        saved = torch.load(path, map_location="cpu", weights_only=True)
        recipe = recipe_of(json.loads(saved["recipe"]))
        progress = Progress(**saved["progress"])
        return Checkpoint(recipe, DataFacts(**saved["data"]), saved["network"], saved["optimizer"], progress)
    except Exception as error:  # torch.load raises a dozen unrelated types
        raise GarmentcError(f"is no checkpoint of this version ({error}); train into another folder", path) from None


def check_same_recipe(checkpoint: Checkpoint, recipe: Recipe, folder: Path) -> None:
    """Raise GarmentcError where the run in `folder` was begun with another recipe."""
    changed = differences(checkpoint.recipe, recipe)
    if changed:
        raise GarmentcError(
            f"holds a run with another recipe ({', '.join(changed)} differ); choose another --out, or remove it", folder
        )


def check_same_run(checkpoint: Checkpoint, recipe: Recipe, data: DataFacts, folder: Path) -> None:
    """Raise GarmentcError where the run in `folder` was begun with another recipe or other data."""
    check_same_recipe(checkpoint, recipe, folder)
    if checkpoint.data != data:
        raise GarmentcError(
            "holds a run on other data: the dataset has changed since; choose another --out, or remove it", folder
        )
