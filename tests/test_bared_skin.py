"""Skin that comes through cloth, on a ball beneath half a ball."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from garmentc.evaluation.bared_skin import CoveredSkin
from tests.cloth_samples import ball

SKIN, FACES = ball(0.1)
UPPER = FACES[SKIN[FACES].mean(axis=1)[:, 1] > 0]
CLOTH = 1.1 * SKIN
COVERED = CoveredSkin.of(CLOTH, UPPER, SKIN, FACES)


def test_what_is_beneath_the_cloth_is_covered() -> None:
    upper, lower = (set(np.flatnonzero(sign * SKIN[:, 1] > 0.02)) for sign in (1, -1))
    assert upper <= set(COVERED.rows)
    assert not lower & set(COVERED.rows)
    half = 2 * np.pi * 0.1**2 * 2 * 3  # twice the area of each triangle goes to each of its corners
    assert COVERED.areas.sum() == pytest.approx(half, rel=0.1)


@pytest.mark.parametrize("turn", [np.eye(3), np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])], ids=["upright", "turned"])
def test_nothing_is_bared_where_cloth_and_skin_move_together(turn: NDArray[np.float64]) -> None:
    assert COVERED.bared(CLOTH @ turn.T + 1, SKIN @ turn.T + 1) == 0


def test_all_is_bared_where_the_cloth_sinks_in() -> None:
    assert COVERED.bared(0.95 * SKIN, SKIN) > 0.85  # but for the row of skin next to the rim


def test_the_part_that_comes_through_is_bared() -> None:
    """The ball moves aside by three times the gap, and comes through on that side."""
    shift = np.array([0.03, 0, 0])
    side = SKIN[COVERED.rows] @ shift > 0.03 * 0.05  # it sticks out where the gap along the normal is below the shift
    expected = COVERED.areas[side].sum() / COVERED.areas.sum()
    assert COVERED.bared(CLOTH, SKIN + shift) == pytest.approx(expected, abs=0.12)


def test_skin_beyond_a_hem_that_has_risen_is_not_bared() -> None:
    risen = CLOTH.copy()
    risen[:, 1] = 0.06 + (risen[:, 1] / 0.11) * 0.05
    risen[:, [0, 2]] *= 0.85
    assert COVERED.bared(risen, SKIN) < 0.02


def test_no_cloth_near_the_skin_covers_none() -> None:
    far = CoveredSkin.of(CLOTH + 5, UPPER, SKIN, FACES)
    assert not len(far.rows)
    assert far.bared(CLOTH, SKIN) == 0
