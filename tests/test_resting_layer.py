"""The last layer of a pose-key network, in exact arithmetic."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from garmentc.resting_layer import resting_layer


@pytest.mark.parametrize("size", [1.0, 300.0])
def test_nothing_is_left_at_rest_and_the_weights_stay_what_they_were(size: float) -> None:
    rng = np.random.default_rng(0)
    weight = size * rng.normal(size=(20, 40))
    weight[0] = np.eye(40)[3]  # a row that only picks one
    at_rest = np.maximum(rng.normal(0.02, 0.01, 40), 0)
    layer = resting_layer(weight, at_rest)

    def left(bias: np.ndarray, rows: np.ndarray) -> float:
        sums = [sum(Fraction(float(w)) * Fraction(float(x)) for w, x in zip(row, at_rest, strict=True)) for row in rows]
        return float(max(abs(total + Fraction(float(b))) for total, b in zip(sums, bias, strict=True)))

    rounded = weight.astype(np.float32)
    plain = left(-(rounded.astype(np.float64) @ at_rest).astype(np.float32), rounded)
    assert left(layer.bias, layer.weight) < 0.05 * plain
    np.testing.assert_allclose(layer.weight, weight, rtol=1e-5, atol=1e-5 * size)
    assert layer.activation == "linear"


def test_inputs_that_are_nought_at_rest_need_nothing() -> None:
    layer = resting_layer(np.eye(3), np.zeros(3))
    np.testing.assert_array_equal(layer.weight, np.eye(3))
    np.testing.assert_array_equal(layer.bias, np.zeros(3))
