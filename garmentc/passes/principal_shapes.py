"""The blend shapes of a rig sorted by the movement that they explain, as sliders an artist can drag."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.key_reach import key_reach
from garmentc.passes.mixed_shapes import gram, mixed_keys, mixed_shapes
from garmentc.passes.pose_set import PoseSet, keys_to_fit
from garmentc.passes.posed_error import posed_error
from garmentc.passes.report import PassReport
from garmentc.rig import Rig

_RIDGE = 1e-6


@dataclass(frozen=True)
class PrincipalShapes:
    """shapes = mix @ old shapes, keys = unmix @ old keys, most important first; `unmix.T @ mix` is the identity.

    mix, unmix  (M, M)
    energy      (M,) mean squared movement of each, summed over vertices

    With C the second moment of the keys f over the poses (not centred: keys are 0 at rest and must stay so), the
    displacements f D have the same singular vectors as C^(1/2) D. With U the left ones,

        D' = U^T C^(1/2) D        f' = U^T C^(-1/2) f

    and the first r of them are the r shapes that minimise the mean of ||f D - f' D'||^2 over the poses.
    """

    mix: NDArray[np.float64]
    unmix: NDArray[np.float64]
    energy: NDArray[np.float64]

    @classmethod
    def of(cls, rig: Rig, keys: NDArray[np.float64]) -> PrincipalShapes:
        """Those of `rig`, whose keys in many poses are `keys` (P, M)."""
        moment = keys.T @ keys / len(keys)
        # A combination of keys that no pose of the set uses costs nothing; this keeps it from being divided by zero.
        moment += _RIDGE * max(float(np.trace(moment)), np.finfo(float).tiny) / len(moment) * np.eye(len(moment))
        values, vectors = np.linalg.eigh(moment)
        root = (vectors * np.sqrt(values)) @ vectors.T
        inverse = (vectors / np.sqrt(values)) @ vectors.T
        energy, directions = np.linalg.eigh(root @ gram(rig.blend_shapes) @ root)
        directions = directions[:, ::-1]
        return cls(directions.T @ root, directions.T @ inverse, np.maximum(energy[::-1], 0))

    def explained(self, count: int) -> float:
        """The share of the squared movement that the first `count` make."""
        total = float(self.energy.sum())
        return float(self.energy[:count].sum()) / total if total > 0 else 1.0

    def first(self, count: int, rig: Rig, keys: NDArray[np.float64]) -> Rig:
        """`rig` with the first `count` shapes, their keys folded into the key network's last linear layer.

        Each is scaled so that 1 is the reach of its key (see `key_reach`) over `keys` (P, M), and signed so that its
        key is positive on average: a slider from 0 to 1 shows what it typically does, and little is left for
        `nonnegative_weights` to do.
        """
        assert rig.keys is not None
        if count == 0:
            return replace(rig, blend_shapes=rig.blend_shapes[:0], keys=None, blend_normals=None)
        new_keys = keys @ self.unmix[:count].T
        scale = key_reach(new_keys) * np.where(new_keys.sum(axis=0) < 0, -1, 1)
        mix, unmix = self.mix[:count] * scale[:, None], self.unmix[:count] / scale[:, None]
        return replace(
            rig,
            blend_shapes=mixed_shapes(mix, rig.blend_shapes),
            keys=mixed_keys(rig.keys, unmix),
            blend_normals=None,
        )


def principal_shapes(rig: Rig, poses: PoseSet) -> tuple[Rig, PassReport]:
    """Sort the blend shapes anew, where passes have bent them since. The outfit moves as before.

    No two then move the same vertices alike: amounts stay small, and so do the errors of engines that do not add up
    normals as they are.
    """
    if rig.keys is None:
        return rig, PassReport("principal shapes", "no blend shapes, so none")
    with single_threaded_blas():
        keys = keys_to_fit(rig.keys, poses)
        basis = PrincipalShapes.of(rig, keys)
        sorted_rig = basis.first(rig.morph_count, rig, keys)
    detail = f"the first of {rig.morph_count} makes {100 * basis.explained(1):.0f} % of the squared movement"
    return sorted_rig, PassReport("principal shapes", detail, posed_error(rig, sorted_rig, poses.check))
