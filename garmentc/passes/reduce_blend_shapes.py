"""Fewer blend shapes: the M that keep most of the movement, as sliders an artist can drag."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.passes.blas import single_threaded_blas
from garmentc.passes.key_reach import key_reach
from garmentc.passes.part_of_rig import spread_vertices
from garmentc.passes.pose_set import PoseSet, keys_to_fit
from garmentc.passes.posed_error import posed_error
from garmentc.passes.report import PassReport
from garmentc.resting_layer import resting_layer
from garmentc.rig import KeyNetwork, Rig
from garmentc.smpl.skeleton import JOINT_COUNT

_RIDGE = 1e-6
_VALUES_AT_ONCE = 2_000_000
_TOLERANCE_VERTICES = 4096


@dataclass(frozen=True)
class ReduceBlendShapes:
    """How many blend shapes to keep. With both None all of them are kept.

    count      keep this many
    tolerance  metres: keep the fewest whose 99th percentile of displacement error, over vertices and poses, is below
               it. Skinning never lengthens a displacement, so the posed error is below it too
    """

    count: int | None = None
    tolerance: float | None = None

    def __post_init__(self) -> None:
        if self.count is not None and self.tolerance is not None:
            raise GarmentcError("a number of blend shapes and a tolerance are both given; choose one")
        if self.count is not None and self.count < 0:
            raise GarmentcError(f"{self.count} blend shapes cannot be kept; choose 0 or more")
        if self.tolerance is not None and not self.tolerance > 0:
            raise GarmentcError(f"a tolerance of {self.tolerance} m cannot be kept; choose a length above zero")


def reduce_blend_shapes(rig: Rig, options: ReduceBlendShapes, poses: PoseSet) -> tuple[Rig, PassReport]:
    """Replace the M blend shapes D by r others that minimise the mean of ||f(pose) D - f'(pose) D'||^2 over poses.

    With C the second moment of the keys f over the poses (not centred: keys are 0 at rest and must stay so), the
    displacements f D have the same singular vectors as C^(1/2) D. With U the r largest left ones,

        D' = U^T C^(1/2) D        f' = U^T C^(-1/2) f

    f' is folded into the key network's last linear layer. Shapes come in order of the movement they explain. Each is
    scaled so that 1 is the key's reach (see `key_reach`), and signed so that its key is positive on average: a slider
    from 0 to 1 shows what it typically does, and little is left for `nonnegative_weights` to do.
    Where nothing is to be removed, shapes stay as they are.
    """
    if options.count is None and options.tolerance is None:
        return rig, PassReport("reduce blend shapes", f"all {rig.morph_count} kept")
    if rig.keys is None or rig.morph_count <= (options.count or 0):
        return rig, PassReport("reduce blend shapes", f"all {rig.morph_count} kept: there are no more")
    with single_threaded_blas():
        keys = keys_to_fit(rig.keys, poses)
        basis = _basis(keys, _gram(rig.blend_shapes))
        count = options.count
        if count is None:
            assert options.tolerance is not None
            count = _fewest(rig, basis, keys, options.tolerance)
        reduced = _in_basis(rig, basis, count, keys)
    kept = "no blend shape" if count == 0 else f"{count} of {rig.morph_count} blend shapes"
    detail = f"{kept} kept, {100 * basis.explained(count):.2f} % of the squared movement"
    return reduced, PassReport("reduce blend shapes", detail, posed_error(rig, reduced, poses.check))


@dataclass(frozen=True)
class _Basis:
    """shapes = mix @ old shapes, keys = unmix @ old keys, most important first; `unmix.T @ mix` is the identity.

    mix, unmix  (M, M)
    energy      (M,) mean squared movement of each, summed over vertices
    """

    mix: NDArray[np.float64]
    unmix: NDArray[np.float64]
    energy: NDArray[np.float64]

    def explained(self, count: int) -> float:
        total = float(self.energy.sum())
        return float(self.energy[:count].sum()) / total if total > 0 else 1.0


def _basis(keys: NDArray[np.float64], gram: NDArray[np.float64]) -> _Basis:
    """From keys (P, M) and the shapes' Gram matrix (M, M)."""
    moment = keys.T @ keys / len(keys)
    # A combination of keys that no pose of the set uses costs nothing; this keeps it from being divided by zero.
    moment += _RIDGE * max(float(np.trace(moment)), np.finfo(float).tiny) / len(moment) * np.eye(len(moment))
    values, vectors = np.linalg.eigh(moment)
    root = (vectors * np.sqrt(values)) @ vectors.T
    inverse = (vectors / np.sqrt(values)) @ vectors.T
    energy, directions = np.linalg.eigh(root @ gram @ root)
    directions = directions[:, ::-1]
    return _Basis(directions.T @ root, directions.T @ inverse, np.maximum(energy[::-1], 0))


def _gram(shapes: NDArray[Any]) -> NDArray[np.float64]:
    """D D^T (M, M) of blend shapes (M, N, 3), in float64, a block of vertices at a time."""
    total = np.zeros((len(shapes), len(shapes)))
    for rows in _blocks(shapes):
        block = shapes[:, rows].reshape(len(shapes), -1).astype(np.float64)
        total += block @ block.T
    return total


def _blocks(shapes: NDArray[Any]) -> list[slice]:
    size = max(1, _VALUES_AT_ONCE // (3 * len(shapes)))
    return [slice(start, start + size) for start in range(0, shapes.shape[1], size)]


def _in_basis(rig: Rig, basis: _Basis, count: int, keys: NDArray[np.float64]) -> Rig:
    """The rig with the first `count` shapes of the basis, scaled and signed by their keys over the pose set."""
    assert rig.keys is not None
    if count == 0:
        return replace(rig, blend_shapes=rig.blend_shapes[:0], keys=None, blend_normals=None)
    new_keys = keys @ basis.unmix[:count].T
    scale = key_reach(new_keys) * np.where(new_keys.sum(axis=0) < 0, -1, 1)
    mix, unmix = basis.mix[:count] * scale[:, None], basis.unmix[:count] / scale[:, None]
    shapes = np.empty((count, *rig.blend_shapes.shape[1:]), dtype=np.float32)
    for rows in _blocks(rig.blend_shapes):
        block = rig.blend_shapes[:, rows].astype(np.float64)
        shapes[:, rows] = np.tensordot(mix, block, axes=1)
    return replace(rig, blend_shapes=shapes, keys=mixed_keys(rig.keys, unmix), blend_normals=None)


def mixed_keys(network: KeyNetwork, matrix: NDArray[Any]) -> KeyNetwork:
    """The network whose keys are `matrix` (r, M) @ the keys of `network`, and 0 at rest.

    The matrix is multiplied into the last layer where that is linear, and is a layer of its own where not.
    """
    last = network.layers[-1]
    linear = last.activation == "linear"
    hidden = network.layers[:-1] if linear else network.layers
    weight = matrix @ last.weight.astype(np.float64) if linear else matrix
    at_rest = replace(network, layers=hidden)(np.zeros((JOINT_COUNT, 3)))
    return replace(network, layers=(*hidden, resting_layer(weight, at_rest)))


def _fewest(rig: Rig, basis: _Basis, keys: NDArray[np.float64], tolerance: float) -> int:
    """The fewest shapes that keep the 99th percentile of the displacement error within `tolerance`, by bisection."""
    rows = spread_vertices(rig.vertex_count, _TOLERANCE_VERTICES)
    shapes = np.tensordot(basis.mix, rig.blend_shapes[:, rows].astype(np.float64), axes=1).reshape(rig.morph_count, -1)
    amounts = (keys @ basis.unmix.T)[:: max(1, len(keys) // 128)]

    def p99(count: int) -> float:
        lost = (amounts[:, count:] @ shapes[count:]).reshape(len(amounts), -1, 3)
        return float(np.percentile(np.linalg.norm(lost, axis=-1), 99))

    low, high = 0, rig.morph_count  # `high` shapes are always enough
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if p99(middle) <= tolerance else (middle + 1, high)
    return high
