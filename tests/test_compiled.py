"""Functions as machine code: kept on disk where that is possible, and the same where it is not."""

from __future__ import annotations

import importlib
from collections.abc import Callable

import numba
import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

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


@pytest.mark.parametrize("name", ["springs", "overlaps", "posed_cloth", "cloth_dynamics"])
def test_compiled_functions_call_none_of_other_files(name: str) -> None:
    """What is kept on disk would go on with what those were."""
    module = importlib.import_module(f"garmentc.passes.{name}")
    own = [value for value in vars(module).values() if isinstance(value, Dispatcher)]
    own = [function.py_func for function in own if function.py_func.__module__ == module.__name__]
    assert own
    for function in own:
        used = [vars(module).get(used) for used in function.__code__.co_names]
        assert {each.py_func.__module__ for each in used if isinstance(each, Dispatcher)} <= {module.__name__}
