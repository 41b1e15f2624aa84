"""Units, axes and origin of a file: the similarity that takes its coordinates to the body's."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

PER_METRE = {"m": 1.0, "cm": 100.0, "mm": 1000.0, "dm": 10.0, "in": 1 / 0.0254, "ft": 1 / 0.3048}
"""Lengths in a metre, the likelier units first."""

UNIT_NAMES = {"m": "metres", "cm": "centimetres", "mm": "millimetres", "dm": "decimetres", "in": "inches", "ft": "feet"}

AXES = ("y", "z", "x", "-y", "-z", "-x")

USUAL_FRONT = {"y": "z", "z": "-y"}
"""Where characters look: +Z in Y-up tools (Maya, glTF), -Y in Z-up tools (Blender, 3ds Max)."""


def axis_vector(axis: str) -> NDArray[np.int64]:
    """The unit vector (3,) of "x", "-x", "y", ..."""
    vector = np.zeros(3, dtype=np.int64)
    vector["xyz".index(axis[-1])] = -1 if axis.startswith("-") else 1
    return vector


@dataclass(frozen=True)
class Frame:
    """Where a file has its body: `unit`, the axes that point `up` and to the `front`, and where its origin lies.

    `origin` names the point of the body at the file's origin; `translation` (metres, body axes) is added last and
    moves it to where the body model has it. There is no mirroring: the third axis follows from the two.
    """

    unit: str = "m"
    up: str = "y"
    front: str = "z"
    origin: str = "body"
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def rotation(self) -> NDArray[np.int64]:
        """(3, 3) signed permutation: rows are the body's X (left), Y (up) and Z (front) in file axes."""
        up, front = axis_vector(self.up), axis_vector(self.front)
        return np.stack([np.cross(up, front), up, front])

    @property
    def matrix(self) -> NDArray[np.float64]:
        """(4, 4) from file coordinates to the body's."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation / PER_METRE[self.unit]
        matrix[:3, 3] = self.translation
        return matrix

    @property
    def is_identity(self) -> bool:
        return (self.unit, self.up, self.front) == ("m", "y", "z") and not any(self.translation)

    def rotated(self, vectors: NDArray[Any]) -> NDArray[Any]:
        """`vectors` (N, 3) in the body's axes, exactly: columns change places and signs, nothing is multiplied."""
        rotation = self.rotation
        column = np.abs(rotation).argmax(axis=1)
        flipped = rotation[np.arange(3), column] < 0
        turned = vectors[:, column]
        turned[:, flipped] = 0.0 - turned[:, flipped]  # no negative zeros
        return turned

    def apply(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """`vertices` (N, 3) of the file as the body has them.

        The very same array where there is nothing to do; otherwise each coordinate is divided once by the unit, which
        for decimal units is as exact as float64 can be, and moved once.
        """
        if self.is_identity:
            return vertices
        moved = self.rotated(vertices)
        if self.unit != "m":
            moved /= PER_METRE[self.unit]
        if any(self.translation):
            moved += self.translation
        return moved


def axis_pairs(up: str = "auto", front: str = "auto") -> Iterator[tuple[str, str]]:
    """The (up, front) pairs that options leave open, the usual ones first."""
    pairs = [(u, f) for u in AXES for f in AXES if u[-1] != f[-1]]
    usual = sorted(pairs, key=lambda pair: axes_prior(*pair))
    return ((u, f) for u, f in usual if up in ("auto", u) and front in ("auto", f))


def axes_prior(up: str, front: str) -> float:
    """How much worse than the usual axes these may fit and still be taken, as a factor above 1 for unusual ones."""
    if USUAL_FRONT.get(up) == front:
        return 1.0
    if up not in USUAL_FRONT:
        return 1.5
    return 1.15 if front[-1] == USUAL_FRONT[up][-1] else 1.3  # turned about, or sideways
