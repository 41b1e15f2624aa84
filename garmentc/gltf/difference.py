"""What differs between two .glb files, in meaning rather than in bytes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError


@dataclass(frozen=True)
class DiffTolerances:
    """How much two files may differ and still be the same.

    position     metres: template vertices, blend shapes, joints, animated translations
    normal       length of the difference of two unit normals
    texcoord     parts of the texture
    color        linear, of 1
    weight       blend weights, of 1
    rotation     radians: animated joints
    key          morph weights, animated or from the pose-key network
    material     every number of a material
    time         seconds: duration of animations

    Raises GarmentcError for one that is negative or no number. Infinity means: not compared.
    """

    position: float = 1e-5
    normal: float = 0.02
    texcoord: float = 2e-5
    color: float = 1e-3
    weight: float = 1e-4
    rotation: float = 1e-3
    key: float = 1e-3
    material: float = 1e-5
    time: float = 1e-4

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not value >= 0:
                raise GarmentcError(f"the tolerance {name} is {value}; give 0 or more")


@dataclass(frozen=True)
class Difference:
    """One thing that differs, at a place in the file, as "meshes/0/primitives/1/POSITION"."""

    where: str
    message: str

    def __str__(self) -> str:
        return f"{self.where}: {self.message}"


def unequal(where: str, left: Any, right: Any) -> Iterator[Difference]:
    """A difference unless both are the same; of lists it tells their lengths, or the first items that differ."""
    if left == right:
        return
    if not all(isinstance(value, (list, tuple)) for value in (left, right)):
        yield Difference(where, f"{_shown(left)} became {_shown(right)}")
    elif len(left) != len(right):
        yield Difference(where, f"{len(left)} became {len(right)}")
    else:
        changed = [number for number, (a, b) in enumerate(zip(left, right, strict=True)) if a != b]
        first = changed[0]
        shown = f"number {first} from {_shown(left[first])} to {_shown(right[first])}"
        yield Difference(where, f"{len(changed)} of {len(left)} differ, {shown}")


def apart(
    where: str, left: NDArray[Any], right: NDArray[Any], tolerance: float, unit: str = "", scale: float = 1.0
) -> Iterator[Difference]:
    """A difference where rows (n, ...) of equal shape are further apart than `tolerance`, by Euclidean length.

    unit, scale  how lengths are printed
    """
    if left.shape != right.shape:
        yield Difference(where, f"shape {left.shape} became {right.shape}")
        return
    if left.size == 0:
        return
    rows = left.reshape(len(left), -1).astype(np.float64) - right.reshape(len(right), -1)
    distance = np.linalg.norm(rows, axis=1)
    beyond = distance > tolerance
    if beyond.any():
        yield Difference(
            where,
            f"{beyond.sum()} of {len(rows)} differ, number {distance.argmax()} by {distance.max() * scale:.4g}{unit} "
            f"(tolerance {tolerance * scale:.4g}{unit})",
        )


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
