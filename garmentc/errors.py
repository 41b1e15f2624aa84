"""What a user sees when something is wrong.

Every failure that a user can cause or mend is a `GarmentcError`: one line that says where, what and what to do.
The command line prints it and exits with code 2; anything else that escapes is a bug.
A `Diagnostic` is the milder form: a repair or a surprise that did not stop the work; it ends up in the report.
"""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike


def _located(message: str, file: str | PathLike[str] | None, line: int | None) -> str:
    place = "" if file is None else f"{file}:{line}: " if line is not None else f"{file}: "
    return place + " ".join(message.split())


class GarmentcError(Exception):
    """A failure the user can act on.

    `message` says what is wrong and what to do about it, `file` and `line` (1-based) say where.
    """

    def __init__(self, message: str, file: str | PathLike[str] | None = None, line: int | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.file = file
        self.line = line

    def __str__(self) -> str:
        return _located(self.message, self.file, self.line)


@dataclass(frozen=True)
class Diagnostic:
    """A warning: something was repaired, ignored or assumed. `code` is stable and meant for machines."""

    code: str
    message: str
    file: str | None = None
    line: int | None = None

    def __str__(self) -> str:
        return _located(self.message, self.file, self.line)
