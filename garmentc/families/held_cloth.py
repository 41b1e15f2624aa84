"""Where the body holds an outfit up: a garment that does not hang on the shoulders hangs on its upper rim.

Trousers, skirts, strapless dresses and socks would fall if the rim around the waist, the chest or the calf were not
tight, so there the cloth goes wherever the skin goes. No network of DeePSD's kind learns that to the centimetre, and it
carries the error down the whole garment.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel
from garmentc.smpl.nearest import closest_on_surface, surface_body_weights
from garmentc.smpl.skeleton import JOINT_NAMES

_REACH = 0.06
"""Metres below the rim at which the skin's hold has fallen to 1/e."""

_BAND = 0.1
"""Metres: how much of a garment's upper end tells whether that goes round a limb."""

_BELOW_SHOULDERS = 0.03
"""Metres: what ends so far below the joints of the arms does not go over them."""

_BENEATH = 0.03
"""Metres: cloth that is farther from a held garment is not caught by it."""

_SECTORS = 32
_FIRM = 0.01
"""Firmness below which cloth hangs free."""

_WIDEST_GAP = np.pi / 2
"""Radians: a rim goes round a limb though a slit or a fly this wide is open."""

_ARMS = [
    JOINT_NAMES.index(f"{side}_{joint}")
    for side in ("left", "right")
    for joint in ("shoulder", "elbow", "wrist", "hand")
]
_SHOULDERS = [JOINT_NAMES.index(f"{side}_shoulder") for side in ("left", "right")]


@dataclass(frozen=True)
class HeldCloth:
    """What holds N vertices of an outfit.

    firmness  (N,) float32: how much the skin below holds a vertex, 1 at a tight rim and 0 far below
    held      (N,) float32: 1 for all of a garment that its rim holds, 0 for all others
    skin      (N, 24) float32 blend weights of the nearest skin
    """

    firmness: NDArray[np.float32]
    held: NDArray[np.float32]
    skin: NDArray[np.float32]

    @property
    def features(self) -> NDArray[np.float32]:
        """(N, 2) firmness and held, as networks see them."""
        return np.column_stack([self.firmness, self.held])


def held_cloth(
    vertices: NDArray[Any], edges: NDArray[Any], body: BodyModel, betas: NDArray[Any] | None = None
) -> HeldCloth:
    """Find out what holds an outfit, with `vertices` (N, 3) and `edges` (E, 2), at rest on the body of shape `betas`.

    A garment is what edges join. Its rim holds it where it ends below the shoulders and goes round a part of the body.
    """
    vertices = np.asarray(vertices, np.float64)
    shaped = body.shaped(betas)
    skin = surface_body_weights(vertices, shaped, body).astype(np.float32)
    shoulders = body.joints(betas)[_SHOULDERS, 1].min()
    depth = np.full(len(vertices), np.inf)
    for rows in garments_of(edges, len(vertices)):
        below_shoulders = vertices[rows, 1].max() < shoulders - _BELOW_SHOULDERS
        on_an_arm = skin[rows][:, _ARMS].sum(axis=1).mean() > 0.5
        if below_shoulders and not on_an_arm and _goes_round(vertices[rows], shaped, body.faces):
            depth[rows] = _depth_below_rim(vertices[rows])
    firmness = np.exp(-((np.minimum(depth, 1) / _REACH) ** 2))
    return HeldCloth(firmness.astype(np.float32), np.isfinite(depth).astype(np.float32), skin)


def hold_beneath(rig: Rig, cloth: HeldCloth, body: BodyModel, betas: NDArray[Any] | None = None) -> Rig:
    """The rig with what lies between the skin and held cloth held alike: a shirt goes with the waistband round it.

    Networks learn nothing of layers, so this is done to what they make. How its tails move is left to `keep_tucked`.
    """
    from scipy.spatial import cKDTree

    held, others = np.flatnonzero(cloth.firmness > _FIRM), np.flatnonzero(cloth.held == 0)
    if not len(held) or not len(others):
        return rig
    apart, nearest = cKDTree(rig.template[held]).query(rig.template[others], distance_upper_bound=_BENEATH)
    others, above = others[np.isfinite(apart)], held[nearest[np.isfinite(apart)]]
    shaped = body.shaped(betas)
    inner, outer = (closest_on_surface(rig.template[rows], shaped, body.faces).distance for rows in (others, above))
    rows, firmness = others[inner < outer], cloth.firmness[above[inner < outer]][:, None]
    if not len(rows):
        return rig
    weights, shapes = rig.weights.copy(), rig.blend_shapes.copy()
    weights[rows] = firmness * cloth.skin[rows] + (1 - firmness) * weights[rows]
    shapes[:, rows] *= 1 - firmness
    return replace(rig, weights=weights, blend_shapes=shapes)


def garments_of(edges: NDArray[Any], count: int) -> list[NDArray[np.intp]]:
    """The vertices of each connected part of an outfit."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    joined = csr_matrix((np.ones(len(edges), np.int8), (edges[:, 0], edges[:, 1])), shape=(count, count))
    garment = connected_components(joined, directed=False)[1]
    order = np.argsort(garment, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(garment[order])) + 1) if count else []


def _upper_end(vertices: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The middle (3,) of the upper end of a garment's `vertices` (n, 3), and which of them are in it."""
    upper = vertices[:, 1] > vertices[:, 1].max() - _BAND
    middle: NDArray[np.float64] = (vertices[upper].min(axis=0) + vertices[upper].max(axis=0)) / 2
    return middle, upper


def _directions(vertices: NDArray[np.float64], middle: NDArray[np.float64]) -> NDArray[np.float64]:
    """In which direction, 0 to 2 pi, vertices (n, 3) are from the vertical through `middle` (3,); (n,)."""
    directions: NDArray[np.float64] = np.arctan2(vertices[:, 0] - middle[0], vertices[:, 2] - middle[2]) % (2 * np.pi)
    return directions


def _goes_round(vertices: NDArray[np.float64], skin: NDArray[Any], faces: NDArray[Any]) -> bool:
    """Whether the upper end of a garment surrounds a part of the body: a button or a patch does not."""
    import igl

    middle, upper = _upper_end(vertices)
    shell = np.ascontiguousarray(skin, np.float64), np.ascontiguousarray(faces, np.int64)
    if igl.fast_winding_number(*shell, middle[None])[0] < 0.5:
        return False
    around = np.sort(_directions(vertices[upper], middle))
    gaps = np.diff(around, append=around[0] + 2 * np.pi)
    return bool(gaps.max() < _WIDEST_GAP)


def _depth_below_rim(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far vertices (n, 3) of a garment are below its upper rim, metres, (n,).

    The rim is as high as the highest vertex in about the same direction from the middle: waistbands are higher behind.
    """
    place = _directions(vertices, _upper_end(vertices)[0]) / (2 * np.pi) * _SECTORS
    highest = np.full(_SECTORS, -np.inf)
    np.maximum.at(highest, place.astype(np.intp) % _SECTORS, vertices[:, 1])
    widened = _with_neighbours(highest)  # coarse rims do not have a vertex everywhere
    while np.isneginf(widened).any():
        widened = _with_neighbours(widened)
    before = np.floor(place - 0.5).astype(np.intp)
    share = place - 0.5 - before
    rim = (1 - share) * widened[before % _SECTORS] + share * widened[(before + 1) % _SECTORS]
    depth: NDArray[np.float64] = np.maximum(rim - vertices[:, 1], 0)
    return depth


def _with_neighbours(highest: NDArray[np.float64]) -> NDArray[np.float64]:
    """The largest of each sector (S,) and the two beside it; they form a circle."""
    largest: NDArray[np.float64] = np.maximum(highest, np.maximum(np.roll(highest, 1), np.roll(highest, -1)))
    return largest
