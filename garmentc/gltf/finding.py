"""What a check found."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """Something wrong ("error") or doubtful ("warning") at a place in a file.

    code   stable, for machines
    where  a place in the document, as "meshes/0/primitives/1"
    """

    severity: str
    code: str
    where: str
    message: str

    def __str__(self) -> str:
        return f"{self.severity}: {self.where}: {self.message} [{self.code}]"


def error(code: str, where: str, message: str) -> Finding:
    return Finding("error", code, where, message)


def warning(code: str, where: str, message: str) -> Finding:
    return Finding("warning", code, where, message)
