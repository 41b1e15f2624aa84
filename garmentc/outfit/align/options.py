"""What is known about a file before its outfit is aligned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.outfit.align.axes import AXES, PER_METRE
from garmentc.smpl import GENDERS
from garmentc.smpl.skeleton import JOINT_COUNT


@dataclass(frozen=True, eq=False)
class AlignOptions:
    """What is known about a file; "auto" is found out. Raises GarmentcError for values that mean nothing.

    units   "auto", "m", "dm", "cm", "mm", "in" or "ft"
    up      "auto" or the file's axis that points up: "x", "y", "z", "-x", "-y", "-z"
    front   "auto" or the file's axis that the body faces
    pose    "auto", "t" (T-pose), "a" (an A-pose, its angles fitted) or the pose itself, (24, 3) axis-angle in radians
    gender  "auto", "female", "male" or "neutral"
    betas   shape of the body, (S,) or None
    origin  "auto", or "keep": the file has its origin where the body model has it
    """

    units: str = "auto"
    up: str = "auto"
    front: str = "auto"
    pose: str | NDArray[np.float64] = "auto"
    gender: str = "auto"
    betas: NDArray[np.float64] | None = None
    origin: str = "auto"

    def __post_init__(self) -> None:
        choices = {"units": PER_METRE, "up": AXES, "front": AXES, "gender": GENDERS, "origin": ("keep",)}
        if isinstance(self.pose, str):
            choices["pose"] = ("t", "a")
        else:
            pose = np.asarray(self.pose, dtype=np.float64)
            if pose.size != 3 * JOINT_COUNT or not np.isfinite(pose).all():
                raise GarmentcError(f"the rest pose has shape {pose.shape}; give 24 rotation vectors in radians")
            object.__setattr__(self, "pose", pose.reshape(JOINT_COUNT, 3))
        for name, offered in choices.items():
            if getattr(self, name) not in ("auto", *offered):
                raise GarmentcError(f"{name} is {getattr(self, name)!r}; choose one of auto, {', '.join(offered)}")
        if "auto" not in (self.up, self.front) and self.up[-1] == self.front[-1]:
            raise GarmentcError(f"up is {self.up!r} and front is {self.front!r}; choose two different axes")

    @property
    def given_pose(self) -> NDArray[np.float64] | None:
        """The rest pose (24, 3) where it was given as such."""
        return None if isinstance(self.pose, str) else self.pose

    @property
    def fits_pose(self) -> bool:
        """True where the body may leave the T-pose to fit the outfit."""
        return isinstance(self.pose, str) and self.pose != "t"

    @property
    def needs_pose(self) -> bool:
        """True where it must: the file is said to be in an A-pose."""
        return isinstance(self.pose, str) and self.pose == "a"
