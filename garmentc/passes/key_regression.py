"""What of a movement in many poses the keys of a rig can express, and with which shapes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.anchors import Anchors
from garmentc.rig import Rig

_NEGLIGIBLE = 0.01
"""Combinations of keys whose mean square is below this share of the ridge get less than a hundredth of the movement."""


@dataclass(frozen=True)
class KeyRegression:
    """Ridge least squares on the r principal combinations of M keys in P poses. One matrix does it for all vertices.

    axes     (M, r) float32 the combinations, of unit length
    amounts  (P, r) float32 how much of each is in a pose
    weights  (P, r) float32: displacements (n, P) times these are the shapes (n, r) to add
    kept     (r,) float32 how much of a movement the ridge leaves
    """

    axes: NDArray[np.float32]
    amounts: NDArray[np.float32]
    weights: NDArray[np.float32]
    kept: NDArray[np.float32]

    @classmethod
    def of(cls, rig: Rig, poses: NDArray[np.float64], ridge: float, most: int | None = None) -> KeyRegression | None:
        """On the keys that `rig` has in `poses` (P, 24, 3), see `on`; None where it has none that move, as a bundle of
        blend weights alone has."""
        keys = rig.pose_keys(poses)
        return cls.on(keys, ridge, most) if keys.any() else None

    @classmethod
    def on(cls, keys: NDArray[np.float64], ridge: float, most: int | None = None) -> KeyRegression:
        """On `keys` (P, M).

        ridge  how much movement must be worth it, relative to the keys' mean square; with too little of it shapes grow
               so large that single precision shows at rest
        most   combinations, at most: the largest
        """
        moment, axes = np.linalg.eigh(keys.T @ keys / len(keys))
        ridge = ridge * moment.mean()
        principal = moment > _NEGLIGIBLE * ridge
        principal[: 0 if most is None else -most] = False
        axes, moment = axes[:, principal], moment[principal]
        amounts, kept = keys @ axes, moment / (moment + ridge)
        weights = amounts * kept / moment / len(keys)
        return cls(*(array.astype(np.float32) for array in (axes, amounts, weights, kept)))

    def added(self, rig: Rig, anchors: Anchors, shapes: NDArray[np.float32]) -> Rig:
        """The rig plus the `shapes` (3, n, r) of its `anchors`, carried over to all vertices."""
        result = np.array(rig.blend_shapes, dtype=np.float32)
        for rows, some in anchors.carried(shapes.T):
            result[:, rows] += (self.axes @ some.reshape(len(some), -1)).reshape(len(result), -1, 3)
        return replace(rig, blend_shapes=result, blend_normals=None)
