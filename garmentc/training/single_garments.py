"""Each garment of an outfit alone: nearly the simulation that it would have had by itself, and an outfit more.

How many outfits a network has seen decides how well it does on new ones; a simulated outfit costs half a minute.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from garmentc.training.outfit_sample import make_sample
from garmentc.training.simulated_outfits import SimulatedOutfit


def single_garments(outfits: Sequence[SimulatedOutfit]) -> Iterator[SimulatedOutfit]:
    """The garments of every outfit that has several, each with all frames of its outfit."""
    for outfit in outfits:
        garments = np.unique(outfit.garment)
        if len(garments) > 1:
            for garment in garments:
                yield _alone(outfit, int(garment))


def _alone(outfit: SimulatedOutfit, garment: int) -> SimulatedOutfit:
    sample = outfit.sample
    rows = np.flatnonzero(outfit.garment == garment)
    place = np.full(len(outfit.garment), -1)
    place[rows] = np.arange(len(rows))
    triangles = place[sample.triangles.numpy()]
    alone = make_sample(
        f"{sample.name}/{garment}",
        sample.vertices.numpy()[rows],
        triangles[(triangles >= 0).all(axis=1)].astype(np.int32),
        sample.body,
        prior=sample.prior.numpy()[rows],
    )
    return replace(outfit, sample=alone, garment=outfit.garment[rows], steps=outfit.steps[:, rows])
