"""How far skin rises between the vertices of coarse cloth: so much farther must it stay away."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.body_contacts import CLOSEST
from garmentc.passes.springs import Springs, mean_edge_lengths

_ROUNDEST = 0.02
"""Metres: the radius of the thinnest limb that cloth lies on."""


@dataclass(frozen=True)
class Bulging:
    """Of the skin that n anchors of an outfit touch.

    springs  between the anchors
    finer    (n,) float32 square of how much shorter the outfit's edges are than those
    most     metres: cloth need not stay farther away than this
    """

    springs: Springs
    finer: NDArray[np.float32]
    most: float

    @classmethod
    def of(
        cls, template: NDArray[Any], edges: NDArray[Any], rows: NDArray[np.intp], springs: Springs, most: float
    ) -> Bulging:
        """For the anchors `rows` (n,) of an outfit `template` (N, 3) with `edges` (E, 2).

        Where edges are so short that skin rises by less than CLOSEST on any limb, that is said of all, unmeasured.
        """
        lengths = mean_edge_lengths(template, edges)[rows]
        finer = (lengths / np.maximum(springs.mean_lengths, np.finfo(np.float32).tiny)) ** 2
        coarse = float(lengths.max()) ** 2 / (8 * _ROUNDEST) > CLOSEST
        return cls(springs, np.minimum(finer, 1), most if coarse else CLOSEST)

    def height(self, vertices: NDArray[np.float32], normals: NDArray[np.float32]) -> NDArray[np.float32]:
        """(n, P) metres at anchors (3, n, P), from the skin's normals there (3, n, P); at least CLOSEST."""
        if self.most <= CLOSEST:
            return np.full(vertices.shape[1:], CLOSEST, dtype=np.float32)
        height = self.springs.sag(vertices, normals)
        height *= self.finer[:, None]
        return np.clip(height, CLOSEST, self.most, out=height)
