"""Where cloth leaves the body: the lofts of each kind of garment."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from garmentc.simulation.body_field import Loft, RestBody, loft
from garmentc.simulation.landmarks import hat_height, leg_height, top_hem_height, waist_height
from garmentc.simulation.outfit_parameters import GarmentParameters

_ARMS = (16, 17, 18, 19, 20, 21, 22, 23)


def _trunk_loft(body: RestBody, garment: GarmentParameters, end: float, slope: float) -> Loft:
    part = body.share(_ARMS) < 0.3
    axis = body.joints[[9, 6, 3, 0]].copy()
    axis[:, 0] = 0
    axis = np.stack([*axis, axis[-1] - [0, 1.5, 0]])
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
    hem = top_hem_height(body, garment)
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
    end = -leg_height(body, garment.length) + 0.06
    return loft(body, part, axis, 1, -1.0, -start, end, garment.clearance + garment.ease, garment.flare)


def _hat_lofts(body: RestBody, garment: GarmentParameters) -> list[Loft]:
    """The crown: widest at the rim, so that a brim starts clear of it."""
    part = body.share((15,)) > 0.5
    rim = hat_height(body, garment)
    head = body.vertices[part]
    part = part & (body.vertices[:, 1] > rim - 0.005)
    middle = head[:, 2].mean()
    axis = np.array([[0, 1, middle], [0, -1, middle]])
    start, end = -float(head[:, 1].max() - 0.05), -rim + 0.06
    return [loft(body, part, axis, 1, -1.0, start, end, garment.clearance, 0.0)] if end > start + 0.07 else []


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


LOFTS: dict[str, Callable[[RestBody, GarmentParameters], list[Loft]]] = {
    "top": _top_lofts,
    "trousers": _leg_lofts,
    "skirt": lambda body, garment: [_skirt_loft(body, garment, waist_height(body, garment.rise) + 0.05)],
    "dress": lambda body, garment: [
        *_sleeve_lofts(body, garment),
        *([] if garment.hang is None else [_trunk_loft(body, garment, waist_height(body, garment.rise), garment.hang)]),
        _skirt_loft(body, garment, waist_height(body, garment.rise)),
    ],
    "jumpsuit": lambda body, garment: [*_sleeve_lofts(body, garment), *_leg_lofts(body, garment)],
    "hat": _hat_lofts,
    "feet": _feet_lofts,
    "mittens": _mitten_lofts,
}
