"""Hems as functions of place: positive where cloth stays, zero on the hem, about metres near it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from garmentc.simulation.body_field import Array, Field, RestBody
from garmentc.simulation.landmarks import hat_height, leg_height, shoulder_height, top_hem_height, waist_height
from garmentc.simulation.outfit_parameters import GarmentParameters


def _above(height: float, curve: float = 0.0) -> Field:
    return lambda p: p[:, 1] - height - curve * np.minimum(np.abs(p[:, 0]) / 0.15, 1.2) ** 2


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
    top = shoulder_height(body, width)
    front = max(garment.neck_depth, 0.03)
    back = 0.015 + 0.15 * garment.neck_depth

    def cut(p: Array) -> Array:
        forward = np.clip((p[:, 2] - neck[2]) / 0.08 + 0.5, 0, 1)
        depth = back + (front - back) * forward
        across, down = np.abs(p[:, 0]) / width, np.maximum(top - p[:, 1], 0) / depth
        # A superellipse: round at the back, straight-sided in front for a V.
        power = 2 - forward if garment.neckline == "v" else np.full(len(p), 2.0)
        return np.asarray(((across**power + down**power) ** (1 / power) - 1) * np.minimum(width, depth))

    return cut


def _sleeve(body: RestBody, garment: GarmentParameters) -> Field:
    shoulder, wrist = body.joints[16], body.joints[20]
    if garment.sleeve > 0:
        # A sleeve's hem always lies outside the armpit.
        first = shoulder[0] + 0.055
        end = first + garment.sleeve * (wrist[0] - 0.01 - first)
        below = body.armpit - 0.12
        return lambda p: end - np.abs(p[:, 0]) + 3 * np.maximum(below - p[:, 1], 0)  # a wide skirt is no sleeve
    strap, low = shoulder[0] * garment.strap, body.armpit

    def armhole(p: Array) -> Array:
        down = np.clip((shoulder[1] + 0.02 - p[:, 1]) / (shoulder[1] + 0.02 - low + 0.015), 0, None)
        edge = strap + (shoulder[0] + 0.03 - strap) * down**2
        return np.asarray(edge - np.abs(p[:, 0]))

    return armhole


def _opening(body: RestBody, garment: GarmentParameters) -> list[Field]:
    if garment.opening == 0:
        return []
    middle, top, hem = body.joints[12, 2] + 0.02, body.joints[12, 1], body.joints[1, 1]

    def cut(p: Array) -> Array:
        down = np.clip((top - p[:, 1]) / (top - hem), 0, 1.5)
        return np.asarray(np.maximum(np.abs(p[:, 0]) - garment.opening * (0.6 + 0.6 * down), middle - p[:, 2]))

    return [cut]


def _top_cuts(body: RestBody, garment: GarmentParameters) -> list[Field]:
    return [
        _neckline(body, garment),
        _sleeve(body, garment),
        _above(top_hem_height(body, garment), garment.hem_curve),
        *_opening(body, garment),
    ]


def _trousers_cuts(body: RestBody, garment: GarmentParameters) -> list[Field]:
    return [_below(waist_height(body, garment.rise), -0.08), _above(leg_height(body, garment.length))]


def _skirt_cuts(body: RestBody, garment: GarmentParameters) -> list[Field]:
    return [_below(waist_height(body, garment.rise)), _above(leg_height(body, garment.length), garment.hem_curve)]


def _dress_cuts(body: RestBody, garment: GarmentParameters) -> list[Field]:
    return [
        _neckline(body, garment),
        _sleeve(body, garment),
        _above(leg_height(body, garment.length), garment.hem_curve),
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
        return np.asarray(np.maximum((opening - 1) * 0.035, ankle[1] - 0.035 - p[:, 1]))

    return [instep, _below(float(ankle[1] - 0.005), 0.1)]


def _hat_cuts(body: RestBody, garment: GarmentParameters) -> list[Field]:
    head = body.vertices[body.share((15,)) > 0.5]
    height = hat_height(body, garment)
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
        return np.asarray(np.maximum(ellipse * 0.06, head[2] + 0.3 * (front - head[2]) - p[:, 2]))

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
        "waist": waist_height(body, garment.rise),
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


CUTS: dict[str, Callable[[RestBody, GarmentParameters], list[Field]]] = {
    "top": _top_cuts,
    "trousers": _trousers_cuts,
    "skirt": _skirt_cuts,
    "dress": _dress_cuts,
    "jumpsuit": lambda body, garment: [
        _neckline(body, garment),
        _sleeve(body, garment),
        _above(leg_height(body, garment.length)),
    ],
    "feet": _feet_cuts,
    "hat": _hat_cuts,
    "hood": _hood_cuts,
    "mittens": _mitten_cuts,
    "band": _band_cuts,
}
