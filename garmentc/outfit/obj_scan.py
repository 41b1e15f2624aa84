"""From the text of an OBJ file to its raw tables: numbers, corners as written, and where names change.

The file is read in stretches of a few megabytes. In each, lines are told apart by their first bytes with numpy, and all
lines of a kind are parsed in one go; only the rare other statements (names, groups) meet a Python loop.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.obj_faces import ABSENT, parse_corners
from garmentc.outfit.obj_lines import HASH, Stretch, blank_comments, first_filled, stretches
from garmentc.outfit.obj_numbers import BLANK, NEWLINE, BadToken, Block, parse_floats
from garmentc.outfit.obj_text import ObjText

_FLOAT_KEYWORDS = {"v": (3, 4, 6, 7), "vt": (1, 2, 3), "vn": (3,)}
_LARGEST_INDEX = np.iinfo(np.int32).max


class Statement(NamedTuple):
    """A statement other than v, vt, vn and f: its keyword, its argument, its place, and the faces before it."""

    keyword: str
    argument: bytes
    offset: int
    faces_before: int


@dataclass
class Tables:
    """What `scan` collects.

    v         (V, 3), vt (T, 2), vn (K, 3) float64
    colors    (V, 3) float64 as written, NaN where a vertex has none; None where no vertex has one
    corners   (C, 3) int32, 0-based v/vt/vn, -1 where absent; not yet checked against the tables' lengths
    counts    (P,) int32 corners of each face
    offsets   (P,) int64 where each face's line starts
    weighted  offset of the first `v` line with a w other than 1, or None
    """

    v: NDArray[np.float64]
    vt: NDArray[np.float64]
    vn: NDArray[np.float64]
    colors: NDArray[np.float64] | None
    corners: NDArray[np.int32]
    counts: NDArray[np.int32]
    offsets: NDArray[np.int64]
    statements: tuple[Statement, ...]
    weighted: int | None


@dataclass
class _Parts:
    """The growing tables."""

    rows: dict[str, list[NDArray[np.float64]]] = field(default_factory=lambda: {"v": [], "vt": [], "vn": []})
    colors: list[NDArray[np.float64]] = field(default_factory=list)
    corners: list[NDArray[np.int32]] = field(default_factory=list)
    counts: list[NDArray[np.int32]] = field(default_factory=list)
    offsets: list[NDArray[np.int64]] = field(default_factory=list)
    statements: list[Statement] = field(default_factory=list)
    lengths: dict[str, int] = field(default_factory=lambda: {"v": 0, "vt": 0, "vn": 0, "f": 0})
    any_color: bool = False
    weighted: int | None = None


def scan(text: ObjText) -> Tables:
    """Read all statements; raises GarmentcError with the line of the first that is malformed."""
    parts = _Parts()
    for stretch in stretches(text.data):
        _scan_stretch(text, stretch, parts)

    def joined(name: str, width: int) -> NDArray[np.float64]:
        return np.concatenate([np.zeros((0, width)), *parts.rows[name]])

    return Tables(
        v=joined("v", 3),
        vt=joined("vt", 2),
        vn=joined("vn", 3),
        colors=np.concatenate(parts.colors) if parts.any_color else None,
        corners=np.concatenate([np.zeros((0, 3), np.int32), *parts.corners]),
        counts=np.concatenate([np.zeros(0, np.int32), *parts.counts]),
        offsets=np.concatenate([np.zeros(0, np.int64), *parts.offsets]),
        statements=tuple(parts.statements),
        weighted=parts.weighted,
    )


def _scan_stretch(text: ObjText, stretch: Stretch, parts: _Parts) -> None:
    first = first_filled(stretch)
    last = len(stretch.text) - 1
    key = [stretch.text[np.minimum(first + i, last)] for i in range(3)]
    short = (key[0] != NEWLINE) & (key[1] <= BLANK)
    longer = (key[1] > BLANK) & (key[2] <= BLANK)
    kinds = {
        "v": short & (key[0] == ord("v")),
        "vt": longer & (key[0] == ord("v")) & (key[1] == ord("t")),
        "vn": longer & (key[0] == ord("v")) & (key[1] == ord("n")),
        "f": short & (key[0] == ord("f")),
    }
    numeric = kinds["v"] | kinds["vt"] | kinds["vn"] | kinds["f"]
    other = ~numeric & (key[0] != NEWLINE) & (key[0] != HASH)

    faces_before = parts.lengths["f"] + np.cumsum(kinds["f"])
    for i in np.flatnonzero(other).tolist():
        begin = stretch.offset + int(first[i])
        line = text.data[begin : stretch.offset + int(stretch.ends[i])]
        keyword, _, argument = line.partition(b" ")
        parts.statements.append(Statement(keyword.decode("latin-1"), argument, begin, int(faces_before[i])))

    blank_comments(stretch, numeric)
    before = {name: parts.lengths[name] + np.cumsum(kinds[name]) for name in ("v", "vt", "vn")}
    for name, chosen in kinds.items():
        if not chosen.any():
            continue
        for i in range(len(name)):
            stretch.text[first[chosen] + i] = BLANK
        block = stretch.block(chosen)
        if name == "f":
            _add_faces(text, block, {table: count[chosen] for table, count in before.items()}, parts)
        else:
            _add_rows(text, block, name, parts)
        parts.lengths[name] += int(chosen.sum())


def _add_rows(text: ObjText, block: Block, name: str, parts: _Parts) -> None:
    """Parse the lines of `v`, `vt` or `vn`."""
    starts = block.token_starts()
    counts = block.counts(starts)
    allowed = _FLOAT_KEYWORDS[name]
    if not np.isin(counts, allowed).all():
        wrong = int(np.argmin(np.isin(counts, allowed)))
        wanted = ", ".join(map(str, allowed[:-1])) + f" or {allowed[-1]}" if allowed[1:] else str(allowed[0])
        raise text.error(
            f"'{name}' has {counts[wrong]} numbers; expected {wanted}; repair the line or export again",
            int(block.origin[wrong]),
        )
    try:
        values = parse_floats(block, len(starts))
    except BadToken as bad:
        raise text.error(f"'{name}': {bad.message}", block.offset(int(starts[bad.token]))) from None

    width = 2 if name == "vt" else 3
    if int(counts.min()) == int(counts.max()):
        table = values.reshape(len(counts), -1)
        rows = table[:, :width] if table.shape[1] >= width else np.pad(table, ((0, 0), (0, width - table.shape[1])))
    else:
        at = np.cumsum(counts) - counts
        columns = [np.where(counts > i, values[np.minimum(at + i, len(values) - 1)], 0.0) for i in range(width)]
        rows = np.stack(columns, axis=1)
    parts.rows[name].append(np.ascontiguousarray(rows))
    if name == "v":
        _add_colors(block, values, counts, parts)


def _add_colors(block: Block, values: NDArray[np.float64], counts: NDArray[np.int64], parts: _Parts) -> None:
    """Keep `v x y z r g b` (a seventh number, alpha, is dropped) and notice `v x y z w` with w other than 1."""
    at = np.cumsum(counts) - counts
    colors = np.broadcast_to(np.nan, (len(counts), 3))  # takes no memory
    colored = np.flatnonzero(counts >= 6)
    if len(colored):
        parts.any_color = True
        colors = np.full((len(counts), 3), np.nan)
        colors[colored] = values[at[colored, None] + np.arange(3, 6)]
    parts.colors.append(colors)
    with_w = np.flatnonzero(counts == 4)
    odd = with_w[values[at[with_w] + 3] != 1.0]
    if len(odd) and parts.weighted is None:
        parts.weighted = int(block.origin[odd[0]])


def _add_faces(text: ObjText, block: Block, before: dict[str, NDArray[np.int64]], parts: _Parts) -> None:
    """Parse the lines of `f`. `before` counts the rows of each table above each face: negative indices end there."""
    starts = block.token_starts()
    counts = block.counts(starts)
    if (counts < 3).any():
        wrong = int(np.argmax(counts < 3))
        corners_found = "1 corner" if counts[wrong] == 1 else f"{counts[wrong]} corners"
        raise text.error(
            f"a face with {corners_found}; it needs 3 or more; remove it or export again", int(block.origin[wrong])
        )
    try:
        corners = parse_corners(block, starts)
    except BadToken as bad:
        raise text.error(bad.message, block.offset(int(starts[bad.token]))) from None

    resolved = np.where(corners > 0, np.minimum(corners, _LARGEST_INDEX) - 1, corners)
    if (corners < 0).any():
        for column, name in enumerate(("v", "vt", "vn")):
            above = np.repeat(before[name], counts)
            relative = corners[:, column]
            back = (relative < 0) & (relative != ABSENT)
            low = back & (relative + above < 0)
            if low.any():
                corner = int(np.argmax(low))
                there = f"{above[corner]} stand above it; export it again"
                message = f"face index {relative[corner]} reaches before the first '{name}': {there}"
                raise text.error(message, block.offset(int(starts[corner])))
            resolved[back, column] = (relative + above)[back]
        resolved[corners == ABSENT] = -1
    parts.corners.append(resolved.astype(np.int32))
    parts.counts.append(counts.astype(np.int32))
    parts.offsets.append(block.origin)
