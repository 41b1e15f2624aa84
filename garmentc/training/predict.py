"""What a network in torch makes of an outfit: for measuring during training, and for variants that have no bundle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.training.checkpoint import CHECKPOINT, Checkpoint, read_checkpoint
from garmentc.training.deepsd_network import Deepsd
from garmentc.training.losses import MM, largest, skin
from garmentc.training.outfit_sample import OutfitSample
from garmentc.training.pose_encodings import POSE_ENCODINGS
from garmentc.training.simulated_outfits import SimulatedOutfit

_TOGETHER = 16
"""Poses at a time: this bounds memory."""


def load_run(folder: Path) -> Checkpoint:
    """The checkpoint of a run. Raises GarmentcError where there is none."""
    checkpoint = read_checkpoint(folder)
    if checkpoint is None:
        raise GarmentcError(f"is no training run: it has no {CHECKPOINT}", folder)
    return checkpoint


def poser(
    network: Deepsd,
    sample: OutfitSample,
    *,
    metadata: NDArray[np.float32] | None = None,
    influences: int = 4,
    physics: bool = True,
) -> Callable[[NDArray[Any]], NDArray[np.float32]]:
    """A function from poses (T, 24, 3) to vertices (T, N, 3) in metres, without translation, whatever the variant.

    metadata    (metadata_width,); unknown where None
    influences  the largest so many weights of each vertex skin it
    physics     with χ
    """
    device = next(network.parameters()).device
    sample = sample.to(device)
    known = None if metadata is None else torch.from_numpy(metadata).to(device)
    with torch.no_grad():
        descriptors = network.descriptors(*sample.seen, known)
        weights = largest(network.blend_weights(descriptors), influences)
        deform = network.deformer(descriptors, physics=physics)

    def posed(poses: NDArray[Any]) -> NDArray[np.float32]:
        parts = []
        for start in range(0, len(poses), _TOGETHER):
            some = poses[start : start + _TOGETHER]
            features = POSE_ENCODINGS[network.config.pose_encoding].encode(some).astype(np.float32)
            transforms = torch.from_numpy(np.ascontiguousarray(sample.body.transforms(some)[:, :, :3])).to(device)
            with torch.no_grad():
                vertices = skin(sample.vertices + deform(torch.from_numpy(features).to(device)), weights, transforms)
            parts.append(vertices.cpu().numpy())
        return np.concatenate(parts)

    return posed


def errors_mm(network: Deepsd, outfit: SimulatedOutfit, *, every: int = 1, physics: bool = True) -> NDArray[np.float64]:
    """Mean vertex distance to the simulation in each `every`-th frame, mm."""
    chosen = np.arange(0, len(outfit), every)
    found = poser(network, outfit.sample, metadata=outfit.metadata, physics=physics)(outfit.poses[chosen])
    distance = np.linalg.norm(found.astype(np.float64) - outfit.targets(chosen), axis=-1)
    errors: NDArray[np.float64] = MM * distance.mean(axis=1)
    return errors


def mean_error_mm(
    network: Deepsd, outfits: Sequence[SimulatedOutfit], *, every: int = 1, physics: bool = True
) -> float:
    """The error of each outfit, averaged over outfits."""
    return float(np.mean([errors_mm(network, outfit, every=every, physics=physics).mean() for outfit in outfits]))
