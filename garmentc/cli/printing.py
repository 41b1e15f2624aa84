"""What the commands print: results on stdout, everything else on stderr."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import click

from garmentc.errors import Diagnostic


def print_error(message: str) -> None:
    """One line on stderr."""
    click.echo("garmentc: error: " + " ".join(message.split()), err=True)


def print_warnings(warnings: Iterable[Diagnostic]) -> None:
    """One line each on stderr."""
    for warning in warnings:
        click.echo(f"garmentc: warning: {warning}", err=True)


def print_json(document: Any) -> None:
    """The machine-readable result on stdout."""
    json.dump(document, sys.stdout, indent=2, allow_nan=False)
    sys.stdout.write("\n")


@contextmanager
def progress(steps: Sequence[str], quiet: bool) -> Iterator[Callable[[str, float], None]]:
    """A progress bar on stderr where that is a terminal; call what it yields with a step and how much of it is done."""
    if quiet or not sys.stderr.isatty():
        yield lambda step, done: None
        return
    from tqdm import tqdm

    with tqdm(total=len(steps), bar_format="{bar:30} {desc} {elapsed}", leave=False) as bar:

        def show(step: str, done: float) -> None:
            bar.n = steps.index(step) + done
            bar.set_description_str(step)

        yield show


def table(rows: Sequence[Sequence[Any]], header: Sequence[str] = ()) -> str:
    """Columns as wide as they need to be, numbers to the right; nothing where there are no rows."""
    if not rows:
        return ""
    shown = [[str(cell) for cell in row] for row in ([header, *rows] if header else rows)]
    widths = [max(map(len, column)) for column in zip(*shown, strict=True)]
    right = [all(isinstance(cell, (int, float)) for cell in column) for column in zip(*rows, strict=True)]
    lines = [
        "  ".join(cell.rjust(w) if r else cell.ljust(w) for cell, w, r in zip(row, widths, right, strict=True)).rstrip()
        for row in shown
    ]
    return "\n".join(lines)


def file_size(count: int) -> str:
    """A number of bytes as people read it."""
    size = float(count)
    for unit in ("B", "KiB", "MiB"):
        if size < 1024:
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
        size /= 1024
    return f"{size:.2f} GiB"
