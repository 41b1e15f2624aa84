"""Heights on a body that hems refer to."""

from __future__ import annotations

import numpy as np

from garmentc.simulation.body_field import RestBody
from garmentc.simulation.outfit_parameters import GarmentParameters


def waist_height(body: RestBody, rise: float) -> float:
    """Height of a waistband: rise 0 sits on the hips, 1 at the navel."""
    hip, spine = body.joints[1, 1], body.joints[3, 1]
    return float(hip + 0.07 + rise * (spine + 0.05 - hip - 0.07))


def leg_height(body: RestBody, length: float) -> float:
    """Height of a hem on the legs: 0 just below the crotch, 1 at the ankle."""
    return float(body.crotch - 0.04 + length * (body.joints[7, 1] + 0.01 - body.crotch + 0.04))


def shoulder_height(body: RestBody, x: float) -> float:
    """Height of the body's upper side at distance x from the mid-plane, without the head."""
    vertices = body.vertices[(np.abs(np.abs(body.vertices[:, 0]) - x) < 0.012) & (body.share((15,)) < 0.3)]
    return float(vertices[:, 1].max())


def top_hem_height(body: RestBody, garment: GarmentParameters) -> float:
    """Hem of a top: length 0 below the chest, 0.5 at the hips, 1 at mid-thigh."""
    high = body.joints[6, 1] + 0.02
    low = 0.5 * (body.joints[1, 1] + body.joints[4, 1])
    height = high + garment.length * (low - high)
    crotch = body.crotch
    if crotch - 0.02 < height < crotch + 0.05:
        height = crotch + 0.05
    return float(height)


def hat_height(body: RestBody, garment: GarmentParameters) -> float:
    """Height of a hat's rim: rise 0 just above the ears, 1 halfway up the skull."""
    head = body.vertices[body.share((15,)) > 0.5]
    return float(body.joints[15, 1] + (head[:, 1].max() - body.joints[15, 1]) * (0.35 + 0.3 * garment.rise))
