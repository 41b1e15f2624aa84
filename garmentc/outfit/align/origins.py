"""The points of a body that files put at their origin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.align.skin import Skin
from garmentc.smpl.skeleton import JOINT_NAMES

BODY = "body"
FITTED = "fitted"

ORIGINS = (BODY, "pelvis", "floor", "floor under the pelvis", "floor between the feet")
"""The body model's own origin; its pelvis joint; the floor (the lowest vertex) under the origin and other points."""

_ANKLES = [JOINT_NAMES.index("left_ankle"), JOINT_NAMES.index("right_ankle")]


def origin_translation(origin: str, skin: Skin) -> NDArray[np.float64]:
    """Where the body model has the point `origin`, (3,) metres: what must be added to a file that has it at zero."""
    floor = skin.vertices[:, 1].min()
    if origin == BODY:
        return np.zeros(3)
    if origin == "pelvis":
        return np.array(skin.joints[0])
    x, z = {
        "floor": (0.0, 0.0),
        "floor under the pelvis": skin.joints[0, [0, 2]],
        "floor between the feet": skin.joints[_ANKLES].mean(axis=0)[[0, 2]],
    }[origin]
    return np.array([x, floor, z])


def known_origins(skin: Skin) -> dict[str, NDArray[np.float64]]:
    """The translations of `ORIGINS`, without those within a millimetre of an earlier one."""
    known: dict[str, NDArray[np.float64]] = {}
    for origin in ORIGINS:
        translation = origin_translation(origin, skin)
        if all(np.abs(translation - other).max() > 1e-3 for other in known.values()):
            known[origin] = translation
    return known
