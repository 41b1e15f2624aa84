"""The lines of an OBJ file, a few megabytes at a time, as numpy arrays of bytes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.obj_numbers import BLANK, NEWLINE, Block

HASH = ord("#")
_STRETCH = 1 << 22
"""Bytes read at a time, and the rest of a line; bounds the memory of the temporary arrays."""


@dataclass(frozen=True)
class Stretch:
    """Whole lines of the file.

    offset  of the first one in the file
    text    (B,) uint8, a copy: what is parsed is blanked bit by bit
    starts  (L,) where each line starts in `text`
    ends    (L,) where its newline is
    """

    offset: int
    text: NDArray[np.uint8]
    starts: NDArray[np.int64]
    ends: NDArray[np.int64]

    def block(self, chosen: NDArray[np.bool_]) -> Block:
        """The chosen lines, whose keywords and comments have been blanked."""
        lengths = self.ends + 1 - self.starts
        text = self.text if chosen.all() else self.text[np.repeat(chosen, lengths)]
        lines = np.concatenate([[0], np.cumsum(lengths[chosen])])
        return Block(text, lines, self.starts[chosen] + self.offset)


def stretches(data: bytes) -> Iterator[Stretch]:
    """All of `data`, which ends with a newline, in order."""
    start = 0
    while start < len(data):
        end = data.find(b"\n", min(start + _STRETCH, len(data) - 1)) + 1
        text = np.frombuffer(data, np.uint8, end - start, start).copy()
        ends = np.flatnonzero(text == NEWLINE)
        yield Stretch(start, text, np.concatenate([[0], ends[:-1] + 1]), ends)
        start = end


def first_filled(stretch: Stretch) -> NDArray[np.int64]:
    """(L,) position of each line's first byte that is not blank (its newline, where the line is empty)."""
    first = stretch.starts.copy()
    indented = stretch.text[first] == BLANK
    if indented.any():
        filled = np.flatnonzero(stretch.text != BLANK)
        first[indented] = filled[np.searchsorted(filled, first[indented])]
    return first


def blank_comments(stretch: Stretch, chosen: NDArray[np.bool_]) -> None:
    """Blank everything from '#' to the line's end in the chosen lines; the '#' of "1.#IND" starts no comment."""
    hashes = np.flatnonzero(stretch.text == HASH)
    hashes = hashes[stretch.text[np.maximum(hashes - 1, 0)] != ord(".")]
    if not len(hashes):
        return
    lines, first = np.unique(np.searchsorted(stretch.ends, hashes), return_index=True)
    wanted = chosen[lines]
    if not wanted.any():
        return
    step = np.zeros(len(stretch.text), np.int8)
    step[hashes[first[wanted]]] = 1
    step[stretch.ends[lines[wanted]]] = -1
    stretch.text[np.cumsum(step, dtype=np.int8).astype(bool)] = BLANK
