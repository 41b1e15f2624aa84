"""Shoes, hats, bands and gloves, which move with the skin: they are generated and skinned, not simulated.

Datasets hold what hangs and swings. A network that saw nothing else would let shoes flutter, so generated ones are
mixed in: every other one alone, every other one worn together with a simulated outfit, as in an artist's suit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from garmentc.simulation.outfit_parameters import OutfitParameters
from garmentc.simulation.outfit_sampling import sample_parameters
from garmentc.simulation.outfits import generate_outfit
from garmentc.smpl.nearest import surface_body_weights
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.smpl.skinning import skin
from garmentc.training.outfit_sample import make_sample
from garmentc.training.simulated_outfits import SimulatedOutfit, compact

CATEGORIES = ("footwear", "headwear", "accessories")
POSES = 48
"""Of an outfit that is worn alone; with a simulated outfit it has that one's poses."""


def rigid_outfits(count: int, simulated: Sequence[SimulatedOutfit], seed: int) -> list[SimulatedOutfit]:
    """`count` outfits of things that move with the skin, on the bodies of simulated outfits spread over `simulated`."""
    made: list[SimulatedOutfit] = []
    attempt = 0
    while len(made) < count:
        index = len(made)
        wearer = simulated[index * len(simulated) // count]
        parameters = _parameters(CATEGORIES[index // 2 % len(CATEGORIES)], seed, attempt, wearer)
        attempt += 1
        try:
            outfit = generate_outfit(parameters, wearer.sample.body.model)
        except ValueError:  # rare: parameters that do not go together
            continue
        alone = index % 2 == 0
        poses = sample_poses(POSES, seed + index).astype(np.float32) if alone else wearer.poses
        moved = _skinned(f"{parameters.category}{index:03d}", outfit.vertices, outfit.triangles, wearer, poses)
        made.append(moved if alone else worn_together(wearer, moved))
    return made


def _parameters(category: str, seed: int, attempt: int, wearer: SimulatedOutfit) -> OutfitParameters:
    rng = np.random.default_rng((seed, 3, attempt))
    while (drawn := sample_parameters(int(rng.integers(1 << 31)))).category != category:
        pass
    body = wearer.sample.body
    return replace(drawn, gender=body.model.gender, betas=tuple(map(float, body.betas)))


def _skinned(
    name: str,
    vertices: NDArray[np.float64],
    triangles: NDArray[np.int32],
    wearer: SimulatedOutfit,
    poses: NDArray[np.float32],
) -> SimulatedOutfit:
    body = wearer.sample.body
    weights = surface_body_weights(vertices, body.vertices, body.model)
    transforms = body.transforms(poses)
    rest = np.broadcast_to(vertices.astype(np.float32), (len(poses), *vertices.shape))
    return SimulatedOutfit(
        make_sample(name, vertices, triangles, body),
        "rigid",
        np.zeros_like(wearer.metadata),
        poses,
        transforms[:, :, :3],
        compact(skin(rest, weights, transforms)),
    )


def worn_together(first: SimulatedOutfit, second: SimulatedOutfit) -> SimulatedOutfit:
    """Both as one outfit: they have the same body and the same poses."""
    a, b = first.sample, second.sample
    sample = make_sample(
        f"{a.name}+{b.name}",
        np.concatenate([a.vertices.numpy(), b.vertices.numpy()]),
        np.concatenate([a.triangles.numpy(), b.triangles.numpy() + len(a.vertices)]).astype(np.int32),
        a.body,
    )
    every = np.arange(len(first))
    both = np.concatenate([first.targets(every), second.targets(every)], axis=1)
    return replace(first, sample=sample, steps=compact(both))
