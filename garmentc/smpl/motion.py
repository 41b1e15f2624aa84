"""A motion: what the body does, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import Diagnostic


@dataclass(frozen=True)
class Motion:
    """Poses over time in the body's axes: Y up, +Z front at zero heading, metres.

    poses   (T, 24, 3) axis-angle, radians, relative to the parent, each at most pi long
    trans   (T, 3) added to the posed vertices: the pelvis joint is at `trans` + its rest position
    fps     frames a second
    betas   (S,) shape of the recorded body, or None
    gender  of the recorded body, or None
    """

    name: str
    poses: NDArray[Any]
    trans: NDArray[Any]
    fps: float
    betas: NDArray[Any] | None = None
    gender: str | None = None
    warnings: tuple[Diagnostic, ...] = field(default=())

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def times(self) -> NDArray[np.float64]:
        """Seconds from the first frame, (T,)."""
        return np.arange(len(self.poses)) / self.fps
