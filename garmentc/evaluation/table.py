"""The benchmark table: outfits and methods down, metrics across."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass

from garmentc.evaluation.evaluate import FrameScores, Summary, summarise

_HEADER = ("outfit", "method", "frames", "collided %", "> 1 mm %", "bared %", "edge mm", "bend")


@dataclass(frozen=True)
class Row:
    """One outfit with one method: its means over clean frames and over all frames."""

    outfit: str
    method: str
    clean: Summary
    all: Summary


def table_row(outfit: str, method: str, scores: Sequence[FrameScores]) -> Row:
    """From the scores of several motions."""
    return Row(outfit, method, summarise(scores, clean_only=True), summarise(scores, clean_only=False))


def markdown(rows: Sequence[Row]) -> str:
    """Two Markdown tables: clean frames first, then all frames."""
    parts = []
    for title, name in (("Clean frames", "clean"), ("All frames", "all")):
        lines = [" | ".join(_HEADER), " | ".join(["---", "---"] + ["---:"] * 6)]
        lines += [" | ".join((row.outfit, row.method, *_cells(getattr(row, name)))) for row in rows]
        parts.append(f"{title}\n\n" + "\n".join(f"| {line} |" for line in lines))
    return "\n\n".join(parts) + "\n"


def to_json(rows: Sequence[Row]) -> str:
    """The same as JSON: shares in [0, 1], null where there are no frames."""
    return json.dumps([asdict(row) for row in rows], indent=2) + "\n"


def _cells(summary: Summary) -> tuple[str, ...]:
    shares = (None if share is None else 100 * share for share in (summary.collision, summary.deep, summary.bared))
    values = zip((*shares, summary.edge_mm, summary.bend), (2, 2, 2, 2, 3), strict=True)
    return (str(summary.frames), *("–" if value is None else f"{value:.{digits}f}" for value, digits in values))
