"""Units, axes and origin of a file: the similarity that takes its coordinates to the body's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

PER_METRE = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "dm": 10.0, "in": 1 / 0.0254, "ft": 1 / 0.3048}
"""How many of each unit are a metre, the likelier units first."""

UNIT_NAMES = {"m": "metres", "cm": "centimetres", "mm": "millimetres", "dm": "decimetres", "in": "inches", "ft": "feet"}

AXES = ("y", "z", "x", "-y", "-z", "-x")


@dataclass(frozen=True)
class Axes:
    """A file's `unit` and the axes that point `up` and to the body's `front`. The third follows, unmirrored."""

    unit: str = "m"
    up: str = "y"
    front: str = "z"

    def __str__(self) -> str:
        return f"{UNIT_NAMES[self.unit]}, {self.up.upper()} up, facing {self.front.upper()}"

    @property
    def rotation(self) -> NDArray[np.int64]:
        """(3, 3) signed permutation: rows are the body's X (left), Y (up) and Z (front) in file axes."""
        up, front = _axis_vector(self.up), _axis_vector(self.front)
        return np.stack([np.cross(up, front), up, front])

    def rotated(self, vectors: NDArray[Any]) -> NDArray[Any]:
        """`vectors` (N, 3) in the body's axes, exactly: columns change places and signs, nothing is multiplied."""
        rotation = self.rotation
        column = np.abs(rotation).argmax(axis=1)
        flipped = rotation[np.arange(3), column] < 0
        turned = vectors[:, column]
        turned[:, flipped] = 0.0 - turned[:, flipped]  # no negative zeros
        return turned

    def metres(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """`points` (N, 3) in metres and the body's axes.

        Each coordinate is divided once by the unit, which for decimal units is as exact as float64 can be.
        """
        return self.rotated(points) if self.unit == "m" else self.rotated(points) / PER_METRE[self.unit]


AS_BODY = Axes()
"""Metres, Y up, facing +Z: as the body is."""


@dataclass(frozen=True)
class Frame(Axes):
    """Unit, axes and origin of a file.

    `origin` names the point of the body that the file has at its origin; `translation` (metres, body axes) is added
    last and takes it to where the body model has it.
    """

    origin: str = "body"
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def matrix(self) -> NDArray[np.float64]:
        """(4, 4) from file coordinates to the body's."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation / PER_METRE[self.unit]
        matrix[:3, 3] = self.translation
        return matrix

    @property
    def is_identity(self) -> bool:
        return (self.unit, self.up, self.front) == (AS_BODY.unit, AS_BODY.up, AS_BODY.front) and not any(
            self.translation
        )

    def apply(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """`vertices` (N, 3) of the file as the body has them: the very same array where there is nothing to do."""
        if self.is_identity:
            return vertices
        moved = self.metres(vertices)
        return moved + self.translation if any(self.translation) else moved


def _axis_vector(axis: str) -> NDArray[np.int64]:
    vector = np.zeros(3, dtype=np.int64)
    vector["xyz".index(axis[-1])] = -1 if axis.startswith("-") else 1
    return vector
