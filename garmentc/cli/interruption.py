"""Ctrl-C and polite kills: how a command ends early, and what is said then."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interrupted(BaseException):
    """Ctrl-C or a polite kill: unwinds the stack, so that half-written files are removed."""

    def __init__(self, signal_number: int) -> None:
        super().__init__(signal_number)
        self.exit_code = 128 + signal_number
        self.message = "interrupted; no output file was changed"


@contextmanager
def interruptible() -> Iterator[None]:
    """Within, SIGINT and SIGTERM raise Interrupted, unless they are ignored."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise Interrupted(number)

    numbers = [n for n in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(n) != signal.SIG_IGN]
    former = [signal.signal(number, interrupt) for number in numbers]
    try:
        yield
    finally:
        for number, handler in zip(numbers, former, strict=True):
            signal.signal(number, handler)


@contextmanager
def resumable() -> Iterator[None]:
    """What is interrupted within goes on when the command is given again, and the user is told so."""
    try:
        yield
    except Interrupted as interruption:
        interruption.message = "interrupted; what is finished stays, and the same command goes on with the rest"
        raise
