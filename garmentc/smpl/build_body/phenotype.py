"""MakeHuman's sliders: from a phenotype to a mesh, and random adults."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.build_body.makehuman import MakeHuman


@dataclass(frozen=True)
class Phenotype:
    """gender 0 (female) to 1 (male); age 0 (25 years) to 1 (90 years); ancestry sums to 1; the rest 0 to 1."""

    gender: float
    age: float = 0.2
    muscle: float = 0.5
    weight: float = 0.5
    height: float = 0.5
    proportions: float = 0.5
    ancestry: tuple[float, float, float] = (1 / 3, 1 / 3, 1 / 3)  # African, Asian, Caucasian
    cup: float = 0.5
    firmness: float = 0.5


def random_adult(random: np.random.Generator, gender: float | None) -> Phenotype:
    """One random adult; without a gender it is drawn uniformly between female and male."""

    def normal(mean: float, deviation: float, low: float = 0, high: float = 1) -> float:
        return float(np.clip(random.normal(mean, deviation), low, high))

    return Phenotype(  # the order of the draws is part of the result
        gender=gender if gender is not None else float(random.random()),
        age=float(np.clip(abs(random.normal(0, 0.35)), 0, 0.9)),
        muscle=normal(0.5, 0.22),
        weight=normal(0.5, 0.22),
        height=normal(0.5, 0.06, 0.3, 0.7),
        proportions=normal(0.5, 0.22),
        ancestry=tuple(random.dirichlet([1, 1, 1])),
        cup=normal(0.5, 0.2),
        firmness=normal(0.5, 0.2),
    )


def a_posed_mesh(data: MakeHuman, phenotype: Phenotype) -> NDArray[np.float64]:
    """The base mesh (19158, 3) with helper geometry, in MakeHuman's bent A-pose, metres."""
    factors = _factors(phenotype)
    amounts = np.array([np.prod([factors[word] for word in words]) for words in data.target_words])
    mesh: NDArray[np.float64] = (data.vertices + np.tensordot(amounts, data.target_deltas, 1)) * 0.1
    return mesh


def _factors(phenotype: Phenotype) -> dict[str, float]:
    """How much each word in a target's name counts."""
    african, asian, caucasian = phenotype.ancestry
    factors = {
        "male": phenotype.gender,
        "female": 1 - phenotype.gender,
        "young": 1 - phenotype.age,
        "old": phenotype.age,
        "african": african,
        "asian": asian,
        "caucasian": caucasian,
        "universal": 1.0,
    }
    for value, low, middle, high in (
        (phenotype.muscle, "minmuscle", "averagemuscle", "maxmuscle"),
        (phenotype.weight, "minweight", "averageweight", "maxweight"),
        (phenotype.height, "minheight", "averageheight", "maxheight"),
        (phenotype.proportions, "uncommonproportions", "regularproportions", "idealproportions"),
        (phenotype.cup, "mincup", "averagecup", "maxcup"),
        (phenotype.firmness, "minfirmness", "averagefirmness", "maxfirmness"),
    ):
        factors[low] = max(0.0, 1 - 2 * value)
        factors[high] = max(0.0, 2 * value - 1)
        factors[middle] = 1 - factors[low] - factors[high]
    return factors
