"""Combinations of blend shapes, and of the keys that drive them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.resting_layer import resting_layer
from garmentc.rig import KeyNetwork
from garmentc.smpl.skeleton import JOINT_COUNT

_VALUES_AT_ONCE = 2_000_000


def mixed_shapes(matrix: NDArray[Any], shapes: NDArray[Any]) -> NDArray[np.float32]:
    """The blend shapes `matrix` (r, M) @ `shapes` (M, N, 3), added up in float64."""
    mixed = np.empty((len(matrix), *shapes.shape[1:]), dtype=np.float32)
    for rows in _blocks(shapes):
        mixed[:, rows] = np.tensordot(matrix, shapes[:, rows].astype(np.float64), axes=1)
    return mixed


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


def gram(shapes: NDArray[Any]) -> NDArray[np.float64]:
    """D D^T (M, M) of blend shapes (M, N, 3), in float64."""
    total = np.zeros((len(shapes), len(shapes)))
    for rows in _blocks(shapes):
        block = shapes[:, rows].reshape(len(shapes), -1).astype(np.float64)
        total += block @ block.T
    return total


def _blocks(shapes: NDArray[Any]) -> list[slice]:
    """Of vertices, so many that they fit into memory in float64, too."""
    size = max(1, _VALUES_AT_ONCE // (3 * len(shapes)))
    return [slice(start, start + size) for start in range(0, shapes.shape[1], size)]
