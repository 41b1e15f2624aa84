"""From a run to its bundles, each with the record of how it was made."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch

from garmentc import __version__
from garmentc.rig import ENCODING_WIDTHS
from garmentc.simulation.presets import FABRICS
from garmentc.training.checkpoint import Checkpoint
from garmentc.training.deepsd_network import VERTICES
from garmentc.training.metadata import encode_metadata
from garmentc.training.recipe import CONFIGS, Recipe, read_recipe
from garmentc.training.write_bundle import write_bundle

BUNDLE = "bundle"


def has_bundle(checkpoint: Checkpoint) -> bool:
    """Whether a rig can express what was trained. Other variants are measured by `garmentc.training.predict`."""
    network = checkpoint.recipe.network
    return network.deformation != VERTICES and network.pose_encoding in ENCODING_WIDTHS


def export_run(checkpoint: Checkpoint, folder: Path, *, version: str = __version__, fabric: str | None = None) -> None:
    """Write the run's bundle into `folder`. `fabric` is what it holds for, where the network was told; None: any.

    Raises GarmentcError where no rig can express the network, or a file cannot be written.
    """
    recipe = checkpoint.recipe
    metadata = None if fabric is None else encode_metadata(recipe.metadata, fabric, ())
    write_bundle(
        checkpoint.restored(),
        folder,
        version=version,
        description=recipe.description,
        training=training_record(checkpoint) | ({} if fabric is None else {"fabric": fabric}),
        metadata=metadata,
    )


def export_all(checkpoint: Checkpoint, run: Path) -> list[Path]:
    """The bundles of a finished run, in its folder: one for any fabric and, where it was told fabrics, one of each."""
    if not has_bundle(checkpoint):
        return []
    fabrics = FABRICS if "fabric" in checkpoint.recipe.metadata else ()
    folders = {None: run / BUNDLE} | {fabric: run / f"{BUNDLE}_{fabric}" for fabric in fabrics}
    for fabric, folder in folders.items():
        export_run(checkpoint, folder, fabric=fabric)
    return list(folders.values())


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
