"""A motion: what the body does, frame by frame."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import Diagnostic, GarmentcError
from garmentc.smpl.rotations import axis_angle_to_quaternion, quaternion_to_axis_angle, slerp


@dataclass(frozen=True)
class Motion:
    """Poses over time in the body's axes: Y up, +Z front at zero heading, metres.

    poses   (T, 24, 3) axis-angle, radians, relative to the parent, each at most pi long
    trans   (T, 3) added to the posed vertices: the pelvis joint is at `trans` + its rest position
    fps     frames a second
    betas   (S,) shape of the recorded body, or None
    gender  of the recorded body, or None
    source  what the file was recognised as, one line for reports
    """

    name: str
    poses: NDArray[Any]
    trans: NDArray[Any]
    fps: float
    betas: NDArray[Any] | None = None
    gender: str | None = None
    source: str = ""
    warnings: tuple[Diagnostic, ...] = field(default=())

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def times(self) -> NDArray[np.float64]:
        """Seconds from the first frame, (T,)."""
        return np.arange(len(self.poses)) / self.fps

    def clipped(self, start: int = 0, stop: int | None = None) -> Motion:
        """Frames `start` to `stop` (exclusive; None is the end). Raises GarmentcError where none is left."""
        poses = self.poses[start:stop]
        if not len(poses):
            raise GarmentcError(f"the motion '{self.name}' has frames 0 to {len(self) - 1}; none is left to take")
        return replace(self, poses=poses, trans=self.trans[start:stop])

    def resampled(self, fps: float) -> Motion:
        """The motion at another frame rate: rotations by slerp, translation linearly; the first frame stays.

        Where the last source frame falls between two new frames, the motion ends before it.
        """
        if not (np.isfinite(fps) and fps > 0):
            raise GarmentcError(f"cannot resample to {fps} frames a second; use a positive number")
        last = len(self) - 1
        steps = np.arange(int(last * fps / self.fps + 1e-6) + 1) * (self.fps / fps)
        before = np.minimum(steps.astype(np.intp), max(last - 1, 0))
        after = np.minimum(before + 1, last)
        share = np.clip(steps - before, 0, 1)[:, None]
        quaternions = axis_angle_to_quaternion(self.poses)
        return replace(
            self,
            poses=quaternion_to_axis_angle(slerp(quaternions[before], quaternions[after], share)),
            trans=self.trans[before] * (1 - share) + self.trans[after] * share,
            fps=float(fps),
        )
