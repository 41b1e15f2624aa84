"""Which outfits and poses each step learns from.

A function of the seed and the step alone, so that work can be resumed, or shared among any number of processes, and
stays the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Batch:
    """One outfit in some poses. `number` counts batches from the beginning of the stage; `seed` is its own."""

    number: int
    outfit: int
    poses: NDArray[np.intp]
    seed: tuple[int, ...]


@dataclass(frozen=True)
class BatchPlan:
    """Epoch by epoch every pose of every outfit exactly once, in batches of one outfit each, shuffled.

    pose_counts  of each outfit
    poses        of a batch; an outfit's batches are as equal as can be, and none is larger
    per_step     batches of a step, for each equal part of the `steps`
    """

    pose_counts: tuple[int, ...]
    poses: int
    steps: int
    per_step: tuple[int, ...]
    seed: tuple[int, ...]

    @property
    def batches_per_epoch(self) -> int:
        return sum(-(-count // self.poses) for count in self.pose_counts)

    def count(self, step: int) -> int:
        """Batches of a step."""
        return self.per_step[min(step * len(self.per_step) // max(self.steps, 1), len(self.per_step) - 1)]

    def first(self, step: int) -> int:
        """Number of the first batch of a step: how many came before."""
        parts = len(self.per_step)
        starts = [-(-part * self.steps // parts) for part in range(parts)] + [self.steps]
        return sum(
            count * max(0, min(step, end) - start)
            for count, start, end in zip(self.per_step, starts[:-1], starts[1:], strict=True)
        )

    def epoch(self, step: int) -> float:
        """Epochs that are over before a step."""
        return self.first(step) / self.batches_per_epoch

    def of_step(self, step: int) -> Sequence[Batch]:
        """The batches of a step."""
        first = self.first(step)
        return [self.batch(number) for number in range(first, first + self.count(step))]

    def batch(self, number: int) -> Batch:
        """Batch number `number` of the stage."""
        epoch, place = divmod(number, self.batches_per_epoch)
        outfit, poses = _epoch(self.pose_counts, self.poses, (*self.seed, epoch))[place]
        return Batch(number, outfit, poses, (*self.seed, 1, number))


@lru_cache(maxsize=2)
def _epoch(pose_counts: tuple[int, ...], poses: int, seed: tuple[int, ...]) -> tuple[tuple[int, NDArray[np.intp]], ...]:
    rng = np.random.default_rng((*seed, 0))
    batches = [
        (outfit, np.sort(part))
        for outfit, count in enumerate(pose_counts)
        if count
        for part in np.array_split(rng.permutation(count), -(-count // poses))
    ]
    return tuple(batches[index] for index in rng.permutation(len(batches)))
