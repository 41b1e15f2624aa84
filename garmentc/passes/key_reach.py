"""How far the keys of a rig go: the amount at which a blend shape is looked at."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.pose_set import PoseSet, keys_to_fit
from garmentc.rig import Rig

REACH_PERCENTILE = 99


def key_reach(keys: NDArray[Any]) -> NDArray[np.float64]:
    """(M,) 99th percentile of the size of each key over poses, from keys (P, M); 1 for a key that is always 0."""
    reach = np.percentile(np.abs(keys), REACH_PERCENTILE, axis=0)
    return np.where(reach > 0, reach, 1.0)


def shape_reach(rig: Rig, poses: PoseSet) -> NDArray[np.float64]:
    """(M,) `key_reach` of what is driven, over the poses to fit; 1 for what is left to animations."""
    reach = np.ones(rig.morph_count)
    if rig.keys is not None:
        reach[: rig.driven_count] = key_reach(keys_to_fit(rig.keys, poses))
    return reach
