"""Few shapes that many frames are mixed of, each of a few of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_FRAMES_COMPARED = 1024
"""Frames that the shapes are chosen on: more tell nothing new."""

_NOTHING = 1e-6
"""Metres: a shape that moves vertices by less, root mean square, is rounding."""

_LEAST = 2e-5
"""Metres, root mean square: a frame does without a shape that would make up for less. Amounts of few shapes, and small
ones, are what engines mix best: normals turn along curves, and some engines shorten every target's."""

_LARGEST = 0.999
"""An amount: 1, less the rounding of whatever stores it."""

_SWEEPS, _LAST_SWEEPS = 100, 20
"""How often shapes and amounts are made to fit each other, and in the end amounts alone. Twice as many gain nothing."""


@dataclass(frozen=True)
class SparseShapes:
    """K shapes of movements (T, 3n).

    shapes       (K, 3n) float32 metres
    amounts      (T, K) how much of each is in a frame, from 0 to 1
    moved, left  metres, root mean square: all movement, and what the shapes leave of it
    """

    shapes: NDArray[np.float32]
    amounts: NDArray[np.float64]
    moved: float
    left: float

    @classmethod
    def of(cls, movement: NDArray[np.float32], most: int, tolerance: float) -> SparseShapes:
        """At most `most` shapes, and about as few as leave `tolerance` metres.

        Semi-nonnegative matrix factorization (Ding, Li & Jordan 2010), with a price on amounts: K shapes in amounts
        above 0 make nearly all of what K - 1 principal components make. It begins with these, of both signs.
        """
        count = movement.shape[1] // 3
        principal, own = _principal(movement, most + 1)
        left = np.sqrt(np.append(np.cumsum(own[::-1] ** 2)[-2::-1], 0))  # by those after each
        wanted = min(int(np.count_nonzero(left > tolerance)) + 1, int(np.count_nonzero(own > _NOTHING)))
        number = min(most, len(movement), wanted + 1) if wanted else 0
        places = (movement @ principal.T).astype(np.float64)
        shapes, amounts = _factorized(places, number, _LEAST * np.sqrt(count))
        sizes = np.array([float(np.square(frame).sum()) for frame in movement])
        total, made = float(sizes.sum()), float(np.square(places).sum())
        remaining = max(0.0, total - made) + float(np.square(places - amounts @ shapes).sum())
        counted = max(1, len(movement) * count)
        return cls(
            (shapes @ principal).astype(np.float32), amounts, np.sqrt(total / counted), np.sqrt(remaining / counted)
        )


def _principal(movement: NDArray[np.float32], most: int) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """At most `most` principal shapes (r, 3n), of unit length and with positive amounts on average; and of all that
    there are how far they move vertices, metres, root mean square."""
    rows = np.unique(np.linspace(0, len(movement) - 1, _FRAMES_COMPARED).astype(np.intp))
    some = movement[rows]
    energy, frames = np.linalg.eigh((some @ some.T).astype(np.float64))
    energy, frames = np.maximum(energy[::-1], 0), frames[:, ::-1]
    own = np.sqrt(energy / max(1, some.size // 3))
    count = min(most, int(np.count_nonzero(own > _NOTHING)))
    signs = np.where(frames[:, :count].sum(axis=0) < 0, -1, 1)
    shapes = ((signs * frames[:, :count]).T.astype(np.float32) @ some) / np.sqrt(energy[:count, None])
    return shapes.astype(np.float32), own


def _factorized(
    places: NDArray[np.float64], number: int, least: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Shapes (K, r) and amounts (T, K) that make `places` (T, r), where each amount is worth `least` of a movement."""
    width = places.shape[1]
    shapes = np.zeros((number, width))
    for row in range(number):
        shapes[row, min(row // 2, width - 1)] = 1 - 2 * (row % 2)
    amounts = np.maximum(places @ shapes.T, 0)
    for _ in range(_SWEEPS):
        _fit_amounts(amounts, places, shapes, least)
        _revive(amounts, places, shapes)
        _fit_shapes(amounts, places, shapes)
    for _ in range(_LAST_SWEEPS):
        _fit_amounts(amounts, places, shapes, least)
    largest = amounts.max(axis=0, initial=0) / _LARGEST
    used = largest > 0
    return shapes[used] * largest[used, None], amounts[:, used] / largest[used]


def _fit_amounts(
    amounts: NDArray[np.float64], places: NDArray[np.float64], shapes: NDArray[np.float64], least: float
) -> None:
    """Better `amounts` (T, K) of each shape in turn, while the others stay (coordinate descent)."""
    alike, wanted = shapes @ shapes.T, places @ shapes.T
    for k, size in enumerate(np.diag(alike)):
        if size > 0:
            lacking = wanted[:, k] - amounts @ alike[:, k] - least * np.sqrt(size)
            amounts[:, k] = np.maximum(0, amounts[:, k] + lacking / size)


def _revive(amounts: NDArray[np.float64], places: NDArray[np.float64], shapes: NDArray[np.float64]) -> None:
    """Make the first of the shapes that no frame uses what the worst frame lacks."""
    unused = np.flatnonzero(amounts.max(axis=0, initial=0) == 0)
    if len(unused):
        lacking = places - amounts @ shapes
        worst = int(np.square(lacking).sum(axis=1).argmax())
        shapes[unused[0]], amounts[worst, unused[0]] = lacking[worst], 1


def _fit_shapes(amounts: NDArray[np.float64], places: NDArray[np.float64], shapes: NDArray[np.float64]) -> None:
    """Better `shapes` (K, r), after amounts are scaled so that the largest of each is 1."""
    largest = amounts.max(axis=0, initial=0)
    largest[largest == 0] = 1
    amounts /= largest
    shapes *= largest[:, None]
    alike, wanted = amounts.T @ amounts, amounts.T @ places
    for k, size in enumerate(np.diag(alike)):
        if size > 0:
            shapes[k] += (wanted[k] - alike[k] @ shapes) / size
