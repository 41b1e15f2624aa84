"""Work on many poses, a block of them at a time, in threads."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from numpy.typing import NDArray

T = TypeVar("T")


def over_blocks(work: Callable[[NDArray[Any]], T], poses: NDArray[Any], size: int) -> list[T]:
    """What `work` makes of each block of at most `size` of the `poses` (P, ...), in their order.

    Blocks depend on `size` alone, so the result does not depend on how many threads there are.
    """
    blocks = [poses[start : start + size] for start in range(0, len(poses), size)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(work, blocks))
