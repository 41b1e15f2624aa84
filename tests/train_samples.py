"""A tiny dataset, network and recipe for the tests of training."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from simulation_stand_in import skinned_patch

from garmentc.simulation.dataset import Dataset
from garmentc.simulation.plan import Task, make_plan
from garmentc.simulation.presets import PRESETS
from garmentc.simulation.sequence import Sequence
from garmentc.simulation.task_graph import run_plan

__all__ = ["SMALL_NETWORK", "swinging_patch", "swinging_patches"]

SMALL_NETWORK = {
    "convolutions": (8, 16),
    "global_width": 12,
    "weight_head": (16,),
    "shape_head": (24, 24),
    "pose_head": (24,),
    "keys": 10,
}


def swinging_patch(task: Task) -> Sequence:
    """`skinned_patch`, moved forwards by up to 40 mm as the pelvis and a hip bend: what no skinning can follow."""
    patch = skinned_patch(task)
    swing = 0.04 * np.tanh(patch.poses[:, 0, :1] + 2 * patch.poses[:, 1, :1])
    offset = np.concatenate([0 * swing, 0 * swing, swing], axis=1).astype(np.float32)
    return replace(patch, vertices=patch.vertices + offset[:, None])


def swinging_patches(folder: Path, outfits: int = 5) -> Dataset:
    """A dataset of such patches: 12 frames in each of some sequences, the fifth outfit held out."""
    return run_plan(make_plan(PRESETS["small"], seed=1, outfits=outfits), folder, swinging_patch)
