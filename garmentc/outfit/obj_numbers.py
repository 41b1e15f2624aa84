"""Many numbers of an OBJ file at once: whole blocks of text to arrays, and the search for the one that is wrong."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.obj_text import decode

BLANK, NEWLINE = ord(" "), ord("\n")
"""What separates tokens: the text has no other white space."""

LARGEST_NUMBER = 1e15
"""Larger values are refused: their squares would overflow single precision, and no unit makes a garment so large."""

_FLOAT = re.compile(rb"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_NOT_FINITE = re.compile(rb"[+-]?(?:nan|inf|infinity|\d\.?#\w+)(?:\(\w*\))?", re.IGNORECASE)


class BadToken(Exception):
    """Token number `token` of a block is wrong; `message` says why."""

    def __init__(self, message: str, token: int) -> None:
        super().__init__(message)
        self.message = message
        self.token = token


@dataclass(frozen=True)
class Block:
    """The arguments of all lines of one kind in a stretch of the file.

    text    (B,) uint8: the lines, keywords and comments blanked; text[0] is blank
    lines   (L + 1,) start of each line in `text`, and the end
    origin  (L,) offset in the file of each line's start
    """

    text: NDArray[np.uint8]
    lines: NDArray[np.int64]
    origin: NDArray[np.int64]

    def filled(self) -> NDArray[np.bool_]:
        """(B,) which bytes belong to tokens."""
        filled: NDArray[np.bool_] = (self.text != BLANK) & (self.text != NEWLINE)
        return filled

    def token_starts(self) -> NDArray[np.int64]:
        """(K,) where tokens start in `text`."""
        filled = self.filled()
        return np.flatnonzero(filled[1:] & ~filled[:-1]) + 1

    def counts(self, starts: NDArray[np.int64]) -> NDArray[np.int64]:
        """(L,) tokens in each line, given `token_starts`."""
        return np.diff(np.searchsorted(starts, self.lines))

    def offset(self, position: int) -> int:
        """The offset in the file of a position in `text`."""
        line = int(np.searchsorted(self.lines, position, side="right")) - 1
        return int(self.origin[line]) + position - int(self.lines[line])

    def tokens(self) -> list[bytes]:
        """All tokens; slow, for finding what is wrong."""
        return self.text.tobytes().split()


def parse_floats(block: Block, count: int) -> NDArray[np.float64]:
    """The `count` tokens of a block as float64, correctly rounded; raises BadToken."""
    values = _from_text(block.text.tobytes(), np.float64)
    if values is None or len(values) != count:
        values = _one_by_one(block, _float)
    if count and not float(np.abs(values).max()) <= LARGEST_NUMBER:
        wrong = int(np.argmin(np.abs(values) <= LARGEST_NUMBER))
        raise BadToken(_not_usable(block.tokens()[wrong]), wrong)
    return values


def parse_integers(text: bytes) -> NDArray[np.int64] | None:
    """Blank-separated whole numbers; None where `text` holds anything else. Too large ones saturate within 2^62."""
    values = _from_text(text, np.int64)
    return None if values is None else np.maximum(values, -(1 << 62))


def _from_text(text: bytes, dtype: type[np.generic]) -> NDArray[Any] | None:
    """numpy's own text reader; None where it stops at something that is no number.

    It may split one token into two numbers ("1-2"), never join two, so a count equal to the number of tokens
    proves that every token is one number.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, dtype=dtype, sep=" ")
        except (DeprecationWarning, ValueError):
            return None


def _one_by_one(block: Block, parse: Callable[[bytes, int], float]) -> NDArray[np.float64]:
    return np.array([parse(token, index) for index, token in enumerate(block.tokens())], dtype=np.float64)


def _float(token: bytes, index: int) -> float:
    if not _FLOAT.fullmatch(token):
        raise BadToken(_not_usable(token), index)
    return float(token)


def _not_usable(token: bytes) -> str:
    shown = f"'{decode(token[:40])}'"
    if _NOT_FINITE.fullmatch(token):
        return f"{shown} is not a finite number; repair the mesh and export it again"
    if _FLOAT.fullmatch(token):
        return f"{shown} is too large; check the units of the export"
    if _FLOAT.fullmatch(token.replace(b",", b".")):
        return f"{shown} has a decimal comma; export with decimal points"
    return f"{shown} is not a number; repair the line or export again"
