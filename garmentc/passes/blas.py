"""Matrix products whose bytes do not depend on how many threads the machine has."""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache
from typing import Any


def single_threaded_blas() -> AbstractContextManager[object]:
    """A context in which numpy's BLAS runs in one thread.

    OpenBLAS splits a product differently for each number of threads, so the last bits of the result change with it,
    and with them the bytes of the asset. Nothing here is large enough for that to cost more than a second.
    """
    context: AbstractContextManager[object] = _controller().limit(limits=1, user_api="blas")
    return context


@cache
def _controller() -> Any:
    """Finding the loaded libraries takes milliseconds, so they are found once."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
