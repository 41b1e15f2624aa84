"""Training examples from nothing but the package: procedural outfits on default bodies in sampled poses."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from garmentc.simulation.outfits import generate_outfit, sample_parameters
from garmentc.smpl.default_body import load_default_body
from garmentc.training.outfit_sample import PosableBody, make_sample
from garmentc.training.pose_pool import pose_body
from garmentc.training.train_deepsd import Example

HELD_OUT_SEED = 1_000_000
"""Seeds from here on are for measuring only."""


@dataclass(frozen=True)
class CachedOutfit:
    """What is kept of a generated outfit; `vertices` is empty where the seed gave none."""

    name: str
    gender: str
    betas: NDArray[Any]
    vertices: NDArray[Any]
    triangles: NDArray[np.int32]


def outfit_of_seed(seed: int, cache: Path) -> CachedOutfit:
    """The outfit of a seed, from `cache` where it was made before."""
    path = cache / f"outfit_{seed:07d}.npz"
    if path.exists():
        with np.load(path, allow_pickle=False) as file:
            names = (str(file["name"]), str(file["gender"]))
            return CachedOutfit(*names, file["betas"], file["vertices"], file["triangles"])
    parameters = sample_parameters(seed)
    vertices, triangles = np.zeros((0, 3)), np.zeros((0, 3), np.int32)
    try:
        made = generate_outfit(parameters, load_default_body(parameters.gender))
        vertices, triangles = made.vertices, made.triangles
    except ValueError as error:  # rare: parameters that do not go together
        tqdm.write(f"outfit {seed} left out: {error}", file=sys.stderr)
    name = f"{seed}_{parameters.category}"
    outfit = CachedOutfit(name, parameters.gender, np.asarray(parameters.betas), vertices, triangles)
    cache.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part.npz")
    np.savez_compressed(part, **vars(outfit))
    part.replace(path)
    return outfit


def make_examples(count: int, poses: int, cache: Path, first_seed: int = 0) -> list[Example]:
    """`count` outfits from consecutive seeds, each with `poses` poses of its own body."""
    examples: list[Example] = []
    seed = first_seed
    with tqdm(total=count, desc="outfits", file=sys.stderr, disable=None) as bar:
        while len(examples) < count:
            outfit = outfit_of_seed(seed, cache)
            if len(outfit.vertices):
                body = PosableBody.of(load_default_body(outfit.gender), outfit.betas)
                sample = make_sample(outfit.name, outfit.vertices, outfit.triangles, body)
                examples.append(Example(sample, pose_body(body, poses, seed=seed)))
                bar.update()
            seed += 1
    return examples
