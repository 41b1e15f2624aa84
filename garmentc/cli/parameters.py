"""Types of command line values."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import click


class FilePath(click.Path):
    """A path as typed; whether it can be read or written is for the code that does it to say."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if not str(value):
            self.fail("is empty; name a file", param, ctx)
        if str(value) == "-":
            self.fail("'-' is no file; name one ('./-' where it is called so)", param, ctx)
        return super().convert(value, param, ctx)


PATH = FilePath(path_type=Path)

_METRES = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}


class Number(click.FloatRange):
    """A number within bounds; NaN, which is within all, is none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        number = float(super().convert(value, param, ctx))
        if math.isnan(number):
            self.fail(f"'{value}' is no number", param, ctx)
        return number


class Length(click.ParamType[float]):
    """A length with its unit, such as 0.5mm; metres."""

    name = "length"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        match = re.fullmatch(r"\s*((?:\d+\.?\d*|\.\d+)(?:e-?\d{1,2})?)\s*(mm|cm|m)\s*", str(value))
        if match is None:
            self.fail(f"'{value}' is no length; write a number and mm, cm or m, such as 0.5mm", param, ctx)
        return float(match[1]) * _METRES[match[2]]


class Numbers(click.ParamType[tuple[float, ...]]):
    """Numbers with commas between them, such as 0.5,-1.2."""

    name = "numbers"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[float, ...]:
        try:
            return tuple(float(part) for part in str(value).split(",") if part.strip())
        except ValueError:
            self.fail(f"'{value}' is no list of numbers; write them with commas between, such as 0.5,-1.2", param, ctx)


class Tolerance(click.ParamType[tuple[str, float]]):
    """A name and a number, such as position=1e-4."""

    name = "tolerance"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> tuple[str, float]:
        name, _, number = str(value).partition("=")
        try:
            return name, float(number)
        except ValueError:
            self.fail(f"'{value}' is no tolerance; write it as position=1e-4", param, ctx)
