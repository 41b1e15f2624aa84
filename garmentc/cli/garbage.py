"""No search for garbage in commands that end soon."""

from __future__ import annotations

import atexit
import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """Within, and when the process ends, Python looks for no reference cycles.

    Looking through all that the imports bring, again and again, takes a twentieth of a small outfit's compile.
    """
    atexit.register(gc.freeze)  # what is frozen is not looked through at the end
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
