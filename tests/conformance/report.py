"""What was measured, as docs/engines.md."""

from __future__ import annotations

from collections.abc import Sequence

from engine_runs import Refused

from conformance.engines import Cell
from conformance.round_trips import Returned, Trip
from conformance.subject import Subject

MICROMETRES, MILLIMETRES = 1e6, 1e3

Column = tuple[str, Sequence[Cell]]
"""An engine's name, and what it made of each file."""


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def unit(engine: str) -> str:
    """Filament's pictures are measured in pixels, the others' vertices in micrometres."""
    return "px" if engine == "Filament" else "µm"


def length(error: float, unit: str) -> str:
    """Two digits, without the unit where it is micrometres."""
    return f"{error:.1f} px" if unit == "px" else f"{float(f'{error * MICROMETRES:.2g}'):g}"


def shown(cell: Cell, unit: str) -> str:
    """An error, in bold where it is more than is allowed; or why there is none."""
    if cell.error is None:
        return cell.reason
    return length(cell.error, unit) if cell.good else f"**{length(cell.error, unit)}**"


def issues(report: dict) -> str:
    """Of the Khronos validator."""
    found = report["issues"]
    return f"{found['numErrors']} / {found['numWarnings']}"


def matrix(
    subjects: Sequence[Subject], header: Sequence[str], khronos: Sequence[dict], engines: Sequence[Column]
) -> str:
    """A row for each file."""
    rows = []
    for number, subject in enumerate(subjects):
        cells = [shown(column[number], unit(name)) for name, column in engines]
        rows.append([*subject.labels, issues(khronos[number]), *cells])
    return table([*header, "errors / warnings", *(name for name, _ in engines)], rows)


def worst(column: Sequence[Cell], subjects: Sequence[Subject], quantized: bool, unit: str) -> str:
    """The largest error over the files, and how many files that are."""
    errors = [
        cell.error
        for cell, subject in zip(column, subjects, strict=True)
        if subject.quantized == quantized and cell.error is not None
    ]
    return f"{length(max(errors), unit)} ({len(errors)} files)" if errors else "–"


def round_trips(journeys: Sequence[tuple[Trip, Subject]], returned: Sequence[Returned]) -> str:
    """A row for each tool and file."""
    rows = []
    for (trip, subject), back in zip(journeys, returned, strict=True):
        driven = (
            f"no: {back.driven.reason.splitlines()[0]}"
            if isinstance(back.driven, Refused)
            else millimetres(back.driven)
        )
        rows.append([trip.name, subject.labels[0], driven, millimetres(back.clip), ", ".join(back.issues) or "none"])
    header = ["tool", "file", "driven by its network, mm", "its animation, mm", "validator's errors and warnings"]
    return table(header, rows)


def millimetres(metres: float) -> str:
    """Two digits."""
    return f"{metres * MILLIMETRES:.2g}" if metres >= 1e-5 else "< 0.01"
