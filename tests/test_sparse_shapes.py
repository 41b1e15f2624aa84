"""Movements of many frames, mixed of few shapes: sparsely, in amounts from 0 to 1, and nearly as well as can be."""

from __future__ import annotations

import numpy as np
import pytest

from garmentc.passes.sparse_shapes import SparseShapes


def swinging(frames: int = 200, vertices: int = 80, ways: int = 12) -> np.ndarray:
    """(T, 3n) of `ways` that come and go at rates of their own, each half as far as the one before; metres."""
    rng = np.random.default_rng(0)
    shapes = np.linalg.qr(rng.standard_normal((3 * vertices, ways)))[0].T * np.sqrt(vertices)
    time = np.linspace(0, 1, frames)[:, None]
    rates, phases = rng.uniform(1, 5, ways), rng.uniform(0, 6, ways)
    amounts = np.sin(2 * np.pi * rates * time + phases) * 0.02 * 0.5 ** np.arange(ways)
    return (amounts @ shapes).astype(np.float32)


def rms(movement: np.ndarray) -> float:
    return float(np.sqrt(np.square(movement, dtype=np.float64).sum() / (movement.size / 3)))


@pytest.mark.parametrize("count", [3, 6, 10])
def test_amounts_are_between_0_and_1_and_one_shape_more_makes_up_for_it(count: int) -> None:
    movement = swinging()
    found = SparseShapes.of(movement, count, 0.0)
    assert found.shapes.shape == (count, movement.shape[1])
    assert found.amounts.min() >= 0
    assert found.amounts.max() == pytest.approx(0.999)
    left = rms(movement - found.amounts @ found.shapes)
    singular = np.linalg.svd(movement, compute_uv=False)
    best = float(np.sqrt(np.square(singular[count - 1 :]).sum() / (movement.size / 3)))  # of one shape less, any sign
    assert left < best + 2e-4
    assert (found.moved, found.left) == pytest.approx((rms(movement), left), rel=1e-3)


def test_most_frames_need_some_of_the_shapes_only() -> None:
    found = SparseShapes.of(swinging(), 13, 0.0)
    assert (found.amounts > 0).mean() < 0.7
    assert found.amounts.sum(axis=1).mean() < 4


def test_as_few_shapes_as_the_tolerance_allows() -> None:
    movement = swinging()
    for tolerance in (5e-3, 5e-4):
        found = SparseShapes.of(movement, 64, tolerance)
        assert found.left < 1.3 * tolerance
        fewer = SparseShapes.of(movement, len(found.shapes) - 2, 0.0)
        assert fewer.left > tolerance


def test_what_does_not_move_has_no_shapes() -> None:
    still = SparseShapes.of(np.zeros((5, 30), np.float32), 8, 5e-4)
    assert still.shapes.shape == (0, 30)
    assert still.amounts.shape == (5, 0)
    assert (still.moved, still.left) == (0, 0)


def test_a_single_frame_is_its_own_shape() -> None:
    movement = swinging()[:1]
    found = SparseShapes.of(movement, 8, 5e-4)
    assert len(found.shapes) == 1
    assert rms(found.amounts @ found.shapes - movement) < 2e-4
