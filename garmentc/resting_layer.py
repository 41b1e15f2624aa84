"""The last layer of a pose-key network, made so that the rest pose has no keys."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.rig import DenseLayer


def resting_layer(weight: NDArray[Any], at_rest: NDArray[np.float64]) -> DenseLayer:
    """A linear layer that is 0 where its inputs are `at_rest` (M,), and `weight` (r, M) times what they change.

    A bias in single precision is off by its rounding, and keys of a trained network are small and their shapes large:
    micrometres at rest. So what is left over goes into one weight of each row, the one where it rounds best.
    """
    weight = weight.astype(np.float32)
    exact = weight.astype(np.float64)
    bias = -(exact @ at_rest).astype(np.float32)
    usable = np.flatnonzero(np.abs(at_rest) >= 0.5 * np.abs(at_rest).max(initial=0))
    if at_rest.any():
        column = usable[np.abs(exact[:, usable] * at_rest[usable]).argmin(axis=1)]
        row = np.arange(len(weight))
        left = exact @ at_rest + bias
        weight[row, column] = exact[row, column] - left / at_rest[column]
    return DenseLayer(weight, bias)
