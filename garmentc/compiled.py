"""Loops over vertices, compiled to machine code when first called, and kept on disk."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

_Function = TypeVar("_Function", bound=Callable[..., object])


def compiled(function: _Function) -> _Function:
    """`function`, which takes numpy arrays and numbers only, as machine code.

    Sums are added up in the order in which they are written, and products stay products, so results do not depend on
    the width of a processor's registers. Machine code is kept beside the package, or else among the user's cached
    files; where nothing can be written, it is made anew in every process, which takes some seconds.

    Among compiled functions it may call those of its own file only: what is kept holds them too, and is thrown away
    when that file changes, but not when another does.
    """
    from numba import njit

    # As numpy divides: by 0 without an exception, which loops could not run along registers with.
    try:
        return cast(_Function, njit(cache=True, nogil=True, error_model="numpy")(function))
    except RuntimeError:  # no folder to keep it in
        return cast(_Function, njit(nogil=True, error_model="numpy")(function))
