"""Which skin an outfit lies over at rest: it should come out on that side, however deep a limb has gone through it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.body_contacts import DEPTH, Planes

DEEPEST = 0.1
"""Metres: how deep in the skin that it lay over cloth can still be mended: a thigh comes so far through a skirt."""

_TURN = 0.03
"""Metres: skin that faces away from where cloth faces counts as twice as far off as this, at least.

With more, skin on the right side but far along the limb would be taken for the nearest.
"""

_FACING = 0.3
"""Cosine from which skin faces where cloth faces."""

_CLOSE, _LOOSE = 0.015, 0.03
"""Metres from the centre of the closest triangle at rest: closer cloth follows its limb, and what is nearest to it is
what it comes out of; cloth farther off is run through by limbs."""

_BESIDE = 0.12
"""Metres: how much farther off at rest than the closest skin is what cloth lies over too, as both legs below a skirt.

The belly that a thigh presses on is not meant: cloth of the one cannot come out of the other.
"""


@dataclass(frozen=True)
class Covering:
    """n vertices of an outfit over F triangles of skin at rest, float32.

    places    (n, 3) the vertices, metres
    outwards  (n, 3) unit normals of the cloth, on the side away from the closest skin: the inner side of thick cloth
              faces out too
    gaps      (n,) metres to the centre of the closest triangle
    loose     (n,) how far all this holds for a vertex: 0 where it is close to the skin, 1 where it is loose
    centers   (F, 3) of the triangles, and
    normals   (F, 3)
    """

    places: NDArray[np.float32]
    outwards: NDArray[np.float32]
    gaps: NDArray[np.float32]
    loose: NDArray[np.float32]
    centers: NDArray[np.float32]
    normals: NDArray[np.float32]

    @classmethod
    def of(cls, cloth: NDArray[Any], cloth_normals: NDArray[Any], skin: NDArray[Any], faces: NDArray[Any]) -> Covering:
        """Of `cloth` (n, 3) with unit normals (n, 3), and the triangles `faces` (F, 3) of `skin` (V, 3)."""
        places = cloth.astype(np.float32)
        planes = Planes.of(skin.T.astype(np.float32)[:, :, None], faces)
        centers, normals = planes.centers[:, :, 0].T, planes.normals[:, :, 0].T
        closest = planes.nearest(places.T[:, :, None], np.inf)[:, 0]
        inwards = np.einsum("ni,ni->n", cloth_normals, normals[closest]) < 0
        outwards = np.where(inwards[:, None], -cloth_normals, cloth_normals).astype(np.float32)
        gaps = np.linalg.norm(places - centers[closest], axis=1)
        loose = np.clip((gaps - _CLOSE) / (_LOOSE - _CLOSE), 0, 1)
        return cls(places, outwards, gaps, loose, centers, normals)

    @property
    def marks(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Coordinates in metres of the vertices (n, 3) and of the triangles (F, 3) that are far from each other where
        they face different ways; to be added to where they are in a pose."""
        return np.float32(_TURN) * self.loose[:, None] * self.outwards, np.float32(_TURN) * self.normals

    def turned(self, faces: NDArray[np.intp]) -> NDArray[np.float32]:
        """(n, K) squared distances between the marks of the vertices and of triangles `faces` (n, K)."""
        loose = self.loose[:, None]
        squared: NDArray[np.float32] = np.float32(_TURN**2) * (1 + loose**2 - 2 * loose * self._cosines(faces))
        return squared

    def depths(self, faces: NDArray[np.intp]) -> NDArray[np.float32]:
        """(n, K) metres: how deep in triangles `faces` (n, K) the vertices may be for a contact to count.

        In skin that it lay over, cloth has been run through, and comes out again on the side where it was. Any other is
        that of a limb which presses on the cloth's own.
        """
        apart = np.linalg.norm(self.centers[faces] - self.places[:, None], axis=2)
        over = (self._cosines(faces) > _FACING) & (apart < self.gaps[:, None] + _BESIDE)
        depths: NDArray[np.float32] = DEPTH + np.float32(DEEPEST - DEPTH) * over * self.loose[:, None]
        return depths

    def _cosines(self, faces: NDArray[np.intp]) -> NDArray[np.float32]:
        cosines: NDArray[np.float32] = np.einsum("nki,ni->nk", self.normals[faces], self.outwards)
        return cosines
