"""Sewing patterns as functions: a garment is the part of an implicit solid's surface where a cut function is positive.

Each maker takes a body at rest and a garment's parameters and returns a `Pattern`. The solid is the body offset by the
clearance, joined with lofts where cloth hangs free; the cut function is the smallest of the distances to all hems.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from garmentc.simulation.body_field import Array, Loft, RestBody, loft, smooth_union
from garmentc.simulation.outfit_parameters import GarmentParameters

Field = Callable[[Array], Array]
Solid = Callable[[Array, Array], Array]

_ARMS = (16, 17, 18, 19, 20, 21, 22, 23)
_FILLET = 0.008
_SLIT = 0.0015


@dataclass(frozen=True)
class Pattern:
    """A garment on one body.

    solid   points (P, 3) and their distances to the body (P,) to a field (P,), negative inside the cloth's solid
    keep    points (P, 3) to (P,), positive where there is cloth
    bounds  (2, 3) box of the cloth with a margin beyond its hems
    split   height below which the left and the right leg are apart, or None
    """

    name: str
    solid: Solid
    keep: Field
    bounds: Array
    split: float | None = None


def make_pattern(body: RestBody, garment: GarmentParameters) -> Pattern:
    """The pattern of one garment on one body."""
    cuts = _CUTS[garment.kind](body, garment)
    lofts = _LOFTS.get(garment.kind, _no_lofts)(body, garment)
    wrinkle = _wrinkles(garment)
    split = body.crotch if garment.kind in ("trousers", "jumpsuit") else None

    def keep(points: Array) -> Array:
        return np.minimum.reduce([cut(points) for cut in cuts])

    def solid(points: Array, distance: Array) -> Array:
        wrinkled = wrinkle(points)
        value = distance - garment.clearance - wrinkled
        for tube in lofts:
            value = smooth_union(value, tube.field(points) - _fold(garment, points) - wrinkled, _FILLET)
        if split is not None:
            # The legs stay two tubes however wide they are: a slit on the mid-plane below the crotch.
            value = np.maximum(value, np.where(points[:, 1] < split, _SLIT - np.abs(points[:, 0]), -1.0))
        return value

    return Pattern(garment.kind, solid, keep, _bounds(body, garment, keep, lofts), split)


def _bounds(body: RestBody, garment: GarmentParameters, keep: Field, lofts: list[Loft]) -> Array:
    """Box (2, 3) that holds the kept surface and a margin beyond its hems."""
    vertices = body.vertices[keep(body.vertices) > -0.03]
    reach = garment.clearance + garment.roughness + 0.02
    low, high = vertices.min(0) - reach, vertices.max(0) + reach
    for tube in lofts:
        inside = tube.centres[keep(tube.centres) > -0.05]
        if len(inside):
            reach = float(tube.support.max()) + garment.fold_depth + 0.02
            across = [k for k in range(3) if k != tube.along]
            low[across] = np.minimum(low[across], inside[:, across].min(0) - reach)
            high[across] = np.maximum(high[across], inside[:, across].max(0) + reach)
    return np.stack([low, high])


def _wrinkles(garment: GarmentParameters) -> Field:
    """A smooth random variation of the clearance, metres, at least -roughness / 2 and at most roughness."""
    rng = np.random.default_rng(garment.seed)
    waves = rng.normal(size=(8, 3))
    waves *= (2 * np.pi / rng.uniform(0.07, 0.25, 8) / np.linalg.norm(waves, axis=1))[:, None]
    phase = rng.uniform(0, 2 * np.pi, 8)

    def wrinkle(points: Array) -> Array:
        if garment.roughness == 0:
            return np.zeros(len(points))
        wave = np.sin(points @ waves.T + phase).mean(1)
        return garment.roughness * np.clip(1.5 * wave, -0.5, 1.0)

    return wrinkle


def _fold(garment: GarmentParameters, points: Array) -> Array:
    """Folds of a skirt that deepen towards the hem, metres."""
    if garment.fold_depth == 0:
        return np.zeros(len(points))
    rng = np.random.default_rng(garment.seed + 1)
    angle = np.arctan2(points[:, 0], points[:, 2])
    depth = np.clip(-points[:, 1] / 0.6, 0, 1)
    twist = rng.uniform(-1, 1) * points[:, 1]
    wave = np.cos(garment.fold_count * (angle + twist) + rng.uniform(0, 6.28) + 0.7 * np.sin(2 * angle))
    return garment.fold_depth * depth * (wave - 0.2)


# --- landmarks -------------------------------------------------------------------------------------------------------


def _waist(body: RestBody, rise: float) -> float:
    """Height of a waistband: rise 0 sits on the hips, 1 at the navel."""
    hip, spine = body.joints[1, 1], body.joints[3, 1]
    return float(hip + 0.07 + rise * (spine + 0.05 - hip - 0.07))


def _leg_height(body: RestBody, length: float) -> float:
    """Height of a hem on the legs: 0 just below the crotch, 1 at the ankle."""
    return float(body.crotch - 0.04 + length * (body.joints[7, 1] + 0.01 - body.crotch + 0.04))


def _shoulder_height(body: RestBody, x: float) -> float:
    """Height of the body's upper side at distance x from the mid-plane, without the head."""
    vertices = body.vertices[(np.abs(np.abs(body.vertices[:, 0]) - x) < 0.012) & (body.share((15,)) < 0.3)]
    return float(vertices[:, 1].max())


# --- cut functions: positive where cloth stays -----------------------------------------------------------------------


def _above(height: float, curve: float = 0.0) -> Field:
    return lambda p: p[:, 1] - height - curve * (p[:, 0] / 0.15) ** 2


def _below(height: float, tilt: float = 0.0) -> Field:
    return lambda p: height + tilt * p[:, 2] - p[:, 1]


def _neckline(body: RestBody, garment: GarmentParameters) -> Field:
    neck = body.joints[12]
    if garment.neckline == "turtle":
        height = neck[1] + 0.045 * (body.joints[15, 1] - neck[1]) / 0.1
        return _below(height, -0.35)
    if garment.neckline == "strapless":
        return _below(body.armpit - 0.015 + 0.1 * garment.neck_depth, 0.1)
    width = garment.neck_width
    top = _shoulder_height(body, width)
    front = max(garment.neck_depth, 0.03)
    back = 0.015 + 0.15 * garment.neck_depth

    def cut(p: Array) -> Array:
        forward = np.clip((p[:, 2] - neck[2]) / 0.08 + 0.5, 0, 1)
        depth = back + (front - back) * forward
        across, down = np.abs(p[:, 0]) / width, np.maximum(top - p[:, 1], 0) / depth
        # A superellipse: round at the back, straight-sided in front for a V.
        power = 2 - forward if garment.neckline == "v" else np.full(len(p), 2.0)
        return ((across**power + down**power) ** (1 / power) - 1) * np.minimum(width, depth)

    return cut


def _sleeve(body: RestBody, garment: GarmentParameters) -> Field:
    shoulder, wrist = body.joints[16], body.joints[20]
    if garment.sleeve > 0:
        # A sleeve's hem always lies outside the armpit.
        first = shoulder[0] + 0.055
        end = first + garment.sleeve * (wrist[0] - 0.01 - first)
        return lambda p: end - np.abs(p[:, 0])
    strap, low = shoulder[0] * garment.strap, body.armpit

    def armhole(p: Array) -> Array:
        down = np.clip((shoulder[1] + 0.02 - p[:, 1]) / (shoulder[1] + 0.02 - low + 0.015), 0, None)
        edge = strap + (shoulder[0] + 0.03 - strap) * down**2
        return edge - np.abs(p[:, 0])

    return armhole


def _opening(body: RestBody, garment: GarmentParameters) -> list[Field]:
    if garment.opening == 0:
        return []
    middle, top, hem = body.joints[12, 2] + 0.02, body.joints[12, 1], body.joints[1, 1]

    def cut(p: Array) -> Array:
        down = np.clip((top - p[:, 1]) / (top - hem), 0, 1.5)
        return np.maximum(np.abs(p[:, 0]) - garment.opening * (0.6 + 0.6 * down), middle - p[:, 2])

    return [cut]


def _top_hem(body: RestBody, garment: GarmentParameters) -> float:
    """Hem of a top: length 0 below the chest, 0.5 at the hips, 1 at mid-thigh."""
    high = body.joints[6, 1] + 0.02
    low = 0.5 * (body.joints[1, 1] + body.joints[4, 1])
    height = high + garment.length * (low - high)
    crotch = body.crotch
    if crotch - 0.02 < height < crotch + 0.05:
        height = crotch + 0.05
    return float(height)


def _top_cuts(body: RestBody, garment: GarmentParameters) -> list[Field]:
    return [
        _neckline(body, garment),
        _sleeve(body, garment),
        _above(_top_hem(body, garment), garment.hem_curve),
        *_opening(body, garment),
    ]


def _trousers_cuts(body: RestBody, garment: GarmentParameters) -> list[Field]:
    return [_below(_waist(body, garment.rise), -0.08), _above(_leg_height(body, garment.length))]


def _skirt_cuts(body: RestBody, garment: GarmentParameters) -> list[Field]:
    return [_below(_waist(body, garment.rise)), _above(_leg_height(body, garment.length), garment.hem_curve)]


def _dress_cuts(body: RestBody, garment: GarmentParameters) -> list[Field]:
    return [
        _neckline(body, garment),
        _sleeve(body, garment),
        _above(_leg_height(body, garment.length), garment.hem_curve),
        *_opening(body, garment),
    ]


def _feet_cuts(body: RestBody, garment: GarmentParameters) -> list[Field]:
    """Shoes and socks: length 0 is a pump, 0.2 an ankle sock, 1 reaches the knee."""
    ankle, knee = body.joints[7], body.joints[4]
    if garment.length > 0:
        return [_below(float(ankle[1] + 0.02 + garment.length * (knee[1] - ankle[1] - 0.05)))]
    # A low shoe is open over the instep as far as the toes.
    toes = body.joints[10, 2] - 0.01

    def instep(p: Array) -> Array:
        opening = np.hypot((np.abs(p[:, 0]) - ankle[0]) / 0.035, (p[:, 2] - ankle[2] - 0.02) / (toes - ankle[2] - 0.02))
        return np.maximum((opening - 1) * 0.035, ankle[1] - 0.035 - p[:, 1])

    return [instep, _below(float(ankle[1] - 0.005), 0.1)]


def _hat_cuts(body: RestBody, garment: GarmentParameters) -> list[Field]:
    head = body.vertices[body.share((15,)) > 0.5]
    height = body.joints[15, 1] + (head[:, 1].max() - body.joints[15, 1]) * (0.35 + 0.3 * garment.rise)
    middle = head[:, 2].mean()
    return [lambda p: p[:, 1] - height - 0.25 * (p[:, 2] - middle)]


def _hood_cuts(body: RestBody, garment: GarmentParameters) -> list[Field]:
    neck, head = body.joints[12], body.joints[15]
    skull = body.vertices[body.share((15,)) > 0.5]
    top, front = skull[:, 1].max(), skull[:, 2].max()
    centre = head[1] + 0.3 * (top - head[1])
    half = 0.42 * (top - head[1])

    def face(p: Array) -> Array:
        ellipse = np.sqrt((p[:, 0] / 0.062) ** 2 + ((p[:, 1] - centre) / half) ** 2) - 1
        return np.maximum(ellipse * 0.06, head[2] + 0.3 * (front - head[2]) - p[:, 2])

    return [face, _above(float(neck[1] - 0.02 * garment.length)), lambda p: 0.13 - np.abs(p[:, 0])]


def _mitten_cuts(body: RestBody, garment: GarmentParameters) -> list[Field]:
    start = body.joints[20, 0] - 0.02 - 0.12 * garment.length
    return [lambda p: np.abs(p[:, 0]) - start]


def _band_cuts(body: RestBody, garment: GarmentParameters) -> list[Field]:
    """A strip around one body part: belt, bandeau, scarf, arm, wrist, thigh and calf bands."""
    j, half = body.joints, 0.5 * garment.length
    place = garment.place
    if place in ("wrist", "arm"):
        at = j[20, 0] - 0.03 - half if place == "wrist" else j[18, 0] - 0.02 - half
        return [lambda p: half - np.abs(np.abs(p[:, 0]) - at)]
    shoulder = j[16, 0] - 0.02
    height = {
        "waist": _waist(body, garment.rise),
        "chest": body.armpit - 0.03 - half,
        "neck": j[12, 1] + 0.03,
        "thigh": 0.5 * (body.crotch + j[4, 1]),
        "calf": 0.5 * (j[4, 1] + j[7, 1]),
        "head": j[15, 1] + 0.11,
    }[place]
    cuts: list[Field] = [lambda p: half - np.abs(p[:, 1] - height)]
    if place == "neck":
        cuts = [
            lambda p: half - np.abs(p[:, 1] - height + 0.3 * (p[:, 2] - j[12, 2])),
            lambda p: shoulder - 0.03 - np.abs(p[:, 0]),
        ]
    return cuts


_CUTS: dict[str, Callable[[RestBody, GarmentParameters], list[Field]]] = {
    "top": _top_cuts,
    "trousers": _trousers_cuts,
    "skirt": _skirt_cuts,
    "dress": _dress_cuts,
    "jumpsuit": lambda body, garment: [
        _neckline(body, garment),
        _sleeve(body, garment),
        _above(_leg_height(body, garment.length)),
    ],
    "feet": _feet_cuts,
    "hat": _hat_cuts,
    "hood": _hood_cuts,
    "mittens": _mitten_cuts,
    "band": _band_cuts,
}


# --- lofts: where cloth leaves the body ------------------------------------------------------------------------------


def _no_lofts(body: RestBody, garment: GarmentParameters) -> list[Loft]:
    return []


def _trunk_loft(body: RestBody, garment: GarmentParameters, end: float, slope: float) -> Loft:
    part = body.share(_ARMS) < 0.3
    axis = body.joints[[9, 6, 3, 0]].copy()
    axis[:, 0] = 0
    axis = np.concatenate([axis, axis[-1:] + [[0, -1.5, 0]]])
    start = -(body.armpit + 0.015)
    return loft(body, part, axis, 1, -1.0, start, -end + 0.06, garment.clearance + garment.ease, slope)


def _sleeve_lofts(body: RestBody, garment: GarmentParameters) -> list[Loft]:
    if garment.sleeve == 0 or garment.sleeve_slope is None:
        return []
    lofts = []
    for shoulder, elbow, wrist, sign in ((16, 18, 20, 1.0), (17, 19, 21, -1.0)):
        part = body.share((shoulder, elbow, wrist)) > 0.5
        axis = body.joints[[shoulder, elbow, wrist]]
        start = abs(axis[0, 0]) + 0.045
        end = abs(axis[2, 0]) + 0.02
        clearance = garment.clearance + 0.5 * garment.ease
        lofts.append(loft(body, part, axis, 0, sign, start, end, clearance, garment.sleeve_slope))
    return lofts


def _top_lofts(body: RestBody, garment: GarmentParameters) -> list[Loft]:
    lofts = _sleeve_lofts(body, garment)
    hem = _top_hem(body, garment)
    if garment.hang is not None or hem < body.crotch + 0.05:
        lofts.append(_trunk_loft(body, garment, hem, -0.3 if garment.hang is None else garment.hang))
    return lofts


def _leg_lofts(body: RestBody, garment: GarmentParameters) -> list[Loft]:
    if garment.leg_slope is None:
        return []
    lofts = []
    for hip, knee, ankle, foot, side in ((1, 4, 7, 10, 1.0), (2, 5, 8, 11, -1.0)):
        part = (body.share((hip, knee, ankle, foot)) > 0.5) & (body.vertices[:, 0] * side > 0)
        part &= body.vertices[:, 1] > body.joints[ankle, 1] - 0.01  # the foot does not widen the hem
        axis = body.joints[[hip, knee, ankle]]
        end = -float(axis[2, 1]) + 0.05
        clearance = garment.clearance + 0.5 * garment.ease
        lofts.append(loft(body, part, axis, 1, -1.0, -(body.crotch - 0.01), end, clearance, garment.leg_slope))
    return lofts


def _skirt_loft(body: RestBody, garment: GarmentParameters, start: float) -> Loft:
    part = (body.share(_ARMS) < 0.3) & (body.vertices[:, 1] > body.joints[7, 1] - 0.01)
    axis = np.array([[0, start + 0.5, body.joints[0, 2]], [0, -2.0, body.joints[0, 2]]])
    end = -_leg_height(body, garment.length) + 0.06
    return loft(body, part, axis, 1, -1.0, -start, end, garment.clearance + garment.ease, garment.flare)


def _feet_lofts(body: RestBody, garment: GarmentParameters) -> list[Loft]:
    """Over each forefoot, so that a shoe or sock bridges the toes."""
    lofts = []
    for ankle, foot, side in ((7, 10, 1.0), (8, 11, -1.0)):
        part = (body.share((ankle, foot)) > 0.5) & (body.vertices[:, 0] * side > 0)
        part &= body.vertices[:, 1] < body.joints[ankle, 1] + 0.01
        axis = np.stack([body.joints[foot], body.joints[foot]]) + np.array([[0, 0, -0.2], [0, 0, 0.2]])
        start = float(body.joints[ankle, 2] + 0.045)
        end = float(body.vertices[part, 2].max() + garment.clearance)
        lofts.append(loft(body, part, axis, 2, 1.0, start, end, garment.clearance, -9.0, capped=True))
    return lofts


def _mitten_lofts(body: RestBody, garment: GarmentParameters) -> list[Loft]:
    lofts = []
    for wrist, hand, sign in ((20, 22, 1.0), (21, 23, -1.0)):
        part = body.share((wrist, hand)) > 0.5
        axis = np.stack([body.joints[hand], body.joints[hand]]) + np.array([[-0.3], [0.3]]) * [1, 0, 0]
        start = abs(float(body.joints[wrist, 0])) + 0.015
        end = float((sign * body.vertices[part, 0]).max() + garment.clearance)
        lofts.append(loft(body, part, axis, 0, sign, start, end, garment.clearance, -9.0, capped=True))
    return lofts


_LOFTS: dict[str, Callable[[RestBody, GarmentParameters], list[Loft]]] = {
    "top": _top_lofts,
    "trousers": _leg_lofts,
    "skirt": lambda body, garment: [_skirt_loft(body, garment, _waist(body, garment.rise) + 0.05)],
    "dress": lambda body, garment: [
        *_sleeve_lofts(body, garment),
        *([] if garment.hang is None else [_trunk_loft(body, garment, _waist(body, garment.rise), garment.hang)]),
        _skirt_loft(body, garment, _waist(body, garment.rise)),
    ],
    "jumpsuit": lambda body, garment: [*_sleeve_lofts(body, garment), *_leg_lofts(body, garment)],
    "feet": _feet_lofts,
    "mittens": _mitten_lofts,
}
