"""Typed, checked access to the JSON of a file from anywhere."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from typing import Any

from garmentc.errors import GarmentcError


@dataclass(frozen=True)
class Cursor:
    """A value in a JSON document and the place it was found at.

    Every accessor raises GarmentcError, naming the place, where the value is not what is asked for.
    """

    value: Any
    pointer: str
    file: str | PathLike[str]

    def error(self, message: str, remedy: str = "the file is damaged or no valid glTF") -> GarmentcError:
        return GarmentcError(f"{self.pointer or '/'} {message}; {remedy}", self.file)

    @property
    def given(self) -> bool:
        return self.value is not None

    def get(self, key: str) -> Cursor:
        """A property of an object; its value is None where the object has no such property, or is itself None."""
        if self.value is not None and not isinstance(self.value, dict):
            raise self.error("must be an object")
        return Cursor(None if self.value is None else self.value.get(key), f"{self.pointer}/{key}", self.file)

    def items(self) -> Iterator[tuple[str, Cursor]]:
        """Properties of an object; none where it is missing."""
        if self.value is not None and not isinstance(self.value, dict):
            raise self.error("must be an object")
        return ((key, self.get(key)) for key in self.value or {})

    def __iter__(self) -> Iterator[Cursor]:
        """Entries of an array; none where it is missing."""
        if self.value is not None and not isinstance(self.value, list):
            raise self.error("must be an array")
        return (Cursor(entry, f"{self.pointer}/{index}", self.file) for index, entry in enumerate(self.value or ()))

    def integer(self, default: int | None = None, low: int = 0, high: int = 2**53) -> int:
        """A whole number in [low, high]; `default` where it is missing."""
        value = default if self.value is None else self.value
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise self.error(f"must be a whole number from {low} to {high}, not {_shown(value)}")
        return value

    def index(self, count: int) -> int:
        """An index into an array of `count` entries."""
        if count == 0:
            raise self.error("points into an array that is empty")
        return self.integer(high=count - 1)

    def number(self, default: float | None = None) -> float:
        value = default if self.value is None else self.value
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise self.error(f"must be a number, not {_shown(value)}")
        return float(value)

    def numbers(self, count: int | None = None, default: tuple[float, ...] | None = None) -> tuple[float, ...]:
        """An array of `count` numbers; of any length where `count` is None."""
        if self.value is None and default is not None:
            return default
        numbers = tuple(entry.number() for entry in self)
        if count is not None and len(numbers) != count:
            raise self.error(f"must be {count} numbers")
        return numbers

    def text(self, default: str | None = None) -> str:
        value = default if self.value is None else self.value
        if not isinstance(value, str):
            raise self.error(f"must be a string, not {_shown(value)}")
        return value

    def flag(self, default: bool = False) -> bool:
        value = default if self.value is None else self.value
        if not isinstance(value, bool):
            raise self.error(f"must be true or false, not {_shown(value)}")
        return value


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
