"""The corners of `f` statements, a block at a time."""

from __future__ import annotations

import re
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.obj_numbers import BLANK, BadToken, Block, parse_integers
from garmentc.outfit.obj_text import decode

ABSENT = np.iinfo(np.int64).min
"""In a corner table as parsed: the corner gives no such index."""

_SLASH = ord("/")
_CORNER = re.compile(rb"[+-]?\d+(?:/(?:[+-]?\d+)?){0,2}")
_FLOAT_INDEX = re.compile(rb"[-+\d/]*\.[-+\d/.]*")


def parse_corners(block: Block, starts: NDArray[np.int64]) -> NDArray[np.int64]:
    """(K, 3) v/vt/vn of the corners that start at `starts`, as written (1-based or negative), ABSENT where left out.

    Raises BadToken for anything but v, v/vt, v//vn and v/vt/vn; an empty field after a slash is allowed.
    """
    text = block.text
    filled = block.filled()
    slash = text == _SLASH
    begins = slash.copy()
    begins[starts] = True
    fields = np.flatnonzero(begins)  # one per field, empty ones too: at a corner's start and at every slash
    at_slash = slash[fields]
    after = np.minimum(fields + 1, len(text) - 1)
    given = ~at_slash | (filled[after] & ~slash[after])
    first = np.flatnonzero(~at_slash)
    if len(first) != len(starts):
        _blame(block)

    corner = np.cumsum(~at_slash) - 1
    field = np.arange(len(fields)) - first[corner]
    values = parse_integers(np.where(slash, np.uint8(BLANK), text).tobytes())
    if values is None or len(values) != int(given.sum()) or int(field.max(initial=0)) > 2:
        _blame(block)
    if len(values) == 3 * len(starts):
        corners = values.reshape(-1, 3)  # at most three fields each, so exactly three
    else:
        corners = np.full((len(starts), 3), ABSENT)
        corners[corner[given], field[given]] = values
    if (corners == 0).any():
        raise BadToken("index 0: OBJ counts from 1; export again or add 1", int(np.argmax((corners == 0).any(axis=1))))
    return corners


def _blame(block: Block) -> NoReturn:
    """Raise BadToken for the first corner that is none."""
    for index, token in enumerate(block.tokens()):
        if _CORNER.fullmatch(token):
            continue
        shown = f"'{decode(token[:40])}'"
        if _FLOAT_INDEX.fullmatch(token):
            raise BadToken(f"face corner {shown}: an index must be a whole number", index)
        raise BadToken(f"face corner {shown}: expected v, v/vt, v//vn or v/vt/vn", index)
    raise BadToken("face corners cannot be read", 0)
