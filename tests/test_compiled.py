"""Functions as machine code: kept on disk where that is possible, and the same where it is not."""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np
import pytest

from garmentc.compiled import compiled


def total(values: np.ndarray) -> float:
    result = 0.0
    for value in values:
        result += value
    return result


def test_where_nothing_can_be_kept_code_is_made_anew() -> None:
    """A function that comes from no file has no folder beside it."""
    names: dict[str, Callable[..., float]] = {}
    exec("def twice(value):\n    return 2 * value", names)
    with pytest.raises(RuntimeError, match="cannot cache"):
        numba.njit(cache=True)(names["twice"])
    assert compiled(names["twice"])(21.0) == 42


def test_sums_are_added_up_in_order() -> None:
    """Float sums depend on it, and so would the bytes of an asset."""
    values = np.random.default_rng(0).standard_normal(10_001)
    assert compiled(total)(values) == sum(values.tolist())
