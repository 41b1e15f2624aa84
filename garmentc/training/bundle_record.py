"""From a run to its bundles, each with the record of how it was made."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch

from garmentc import __version__
from garmentc.rig import ENCODING_WIDTHS
from garmentc.training.checkpoint import Checkpoint
from garmentc.training.deepsd_network import VERTICES
from garmentc.training.metadata import metadata_names
from garmentc.training.recipe import CONFIGS, Recipe, read_recipe
from garmentc.training.write_bundle import write_bundle

BUNDLE = "bundle"


def has_bundle(checkpoint: Checkpoint) -> bool:
    """Whether a rig can express what was trained. Other variants are measured by `garmentc.training.predict`."""
    network = checkpoint.recipe.network
    return network.deformation != VERTICES and network.pose_encoding in ENCODING_WIDTHS


def export_run(checkpoint: Checkpoint, folder: Path, *, version: str = __version__) -> None:
    """Write the run's bundle into `folder`.

    Raises GarmentcError where no rig can express the network, or a file cannot be written.
    """
    recipe = checkpoint.recipe
    write_bundle(
        checkpoint.restored(),
        folder,
        version=version,
        description=recipe.description,
        training=training_record(checkpoint),
        metadata=metadata_names(recipe.metadata),
    )


def training_record(checkpoint: Checkpoint) -> dict[str, Any]:
    """What a bundle's manifest says about its making."""
    recipe, progress = checkpoint.recipe, checkpoint.progress
    stages = [name for name, stage in (("data", recipe.data), ("physics", recipe.physics)) if stage is not None]
    return {
        "recipe": recipe.document(),
        "data": {**asdict(checkpoint.data), "split": "train"},
        "finished": progress.stage == len(stages),
        "minutes": {name: round(s / 60, 1) for name, s in zip(stages, progress.seconds, strict=False)},
        "held_out": {
            stage: {name: round(value, 3) for name, value in figures.items()}
            for stage, figures in progress.figures.items()
        },
        "command": f"garmentc train deepsd {_data(checkpoint)} --config {_config(recipe)} --out run",
        "versions": {"garmentc": __version__, "torch": torch.__version__, "numpy": np.__version__},
    }


def _data(checkpoint: Checkpoint) -> str:
    return " ".join(f"--data {name}" for name in checkpoint.data.name.split(" + "))


def _config(recipe: Recipe) -> str:
    """The name of the recipe where it is one of garmentc's own; the record holds it in any case."""
    own = [path.stem for path in sorted(CONFIGS.glob("*.toml")) if read_recipe(path) == recipe]
    return own[0] if own else "recipe.toml"
