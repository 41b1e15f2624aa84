"""Reading Wavefront MTL: what the statements say, not yet what they mean for a glTF material.

Sources: the MTL specification (Alias|Wavefront, 1995) and the PBR keys that Clara.io added (Pr, Pm, map_Pr, map_Pm,
norm). Reflection, displacement and ambient maps are parsed and left to the caller.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field, replace
from pathlib import Path

from garmentc.errors import Diagnostic
from garmentc.outfit.obj_text import ObjText, decode, read_text

_MAP_KEYS = {
    "map_kd": "map_Kd",
    "map_ka": "map_Ka",
    "map_ks": "map_Ks",
    "map_ns": "map_Ns",
    "map_ke": "map_Ke",
    "map_d": "map_d",
    "map_pr": "map_Pr",
    "map_pm": "map_Pm",
    "map_ps": "map_Ps",
    "map_bump": "map_Bump",
    "bump": "map_Bump",
    "norm": "norm",
    "map_kn": "norm",
    "disp": "disp",
    "decal": "decal",
    "refl": "refl",
}
_COLORS = ("Kd", "Ks", "Ke")
_SCALARS = ("Ns", "d", "Tr", "Pr", "Pm")
_OPTION_ARGUMENTS = {
    "-blendu": 1,
    "-blendv": 1,
    "-boost": 1,
    "-mm": 2,
    "-o": 3,
    "-s": 3,
    "-t": 3,
    "-texres": 1,
    "-clamp": 1,
    "-bm": 1,
    "-imfchan": 1,
    "-type": 1,
    "-colorspace": 1,
    "-cc": 1,
}
"""The most arguments each option takes; those that take three may have one or two."""

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")


@dataclass(frozen=True)
class MapReference:
    """A `map_...` statement: the file's name as written, its options, and the line."""

    name: str
    line: int
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    clamp: bool = False
    bump: float = 1.0
    channel: str | None = None


@dataclass(frozen=True)
class MtlMaterial:
    """One `newmtl`: colours, scalars and maps by their keys ("Kd", "Ns", "map_Kd"), each only where the file has it."""

    name: str
    path: Path
    line: int
    colors: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    scalars: dict[str, float] = field(default_factory=dict)
    maps: dict[str, MapReference] = field(default_factory=dict)


def read_mtl(path: Path) -> tuple[dict[str, MtlMaterial], tuple[Diagnostic, ...]]:
    """The materials of a library by name; the last of several with one name counts, with a warning.

    What is not there (the file's content, as elsewhere the file itself, a material or a texture) is a warning and
    something plain takes its place: outfits travel without their materials. What is there and cannot be understood is
    an error: a guess would look like what the artist made.

    Raises GarmentcError for an unreadable file and, with the line, for malformed numbers and maps without a name.
    """
    if not path.stat().st_size:
        return {}, (Diagnostic("mtl.empty", "is empty and defines no material; export it again", str(path)),)
    text = read_text(path)
    materials: dict[str, MtlMaterial] = {}
    warnings: list[Diagnostic] = []
    current: MtlMaterial | None = None
    offset = 0
    for raw in text.data.split(b"\n"):
        keyword, _, argument = decode(raw).partition(" ")
        if keyword == "newmtl":
            current = MtlMaterial(argument.strip(), path, text.line_of(offset))
            if current.name in materials:
                message = f"material '{current.name}' is defined twice; the last definition counts"
                warnings.append(Diagnostic("mtl.duplicate", message, str(path), current.line))
            materials[current.name] = current
        elif current is not None and keyword and not keyword.startswith("#"):
            _add_statement(text, current, keyword, argument.strip(), offset)
        offset += len(raw) + 1
    return materials, tuple(warnings)


def _add_statement(text: ObjText, material: MtlMaterial, keyword: str, argument: str, offset: int) -> None:
    """Enter a statement into the material's tables; unknown ones are other programs' business."""
    if keyword in _COLORS:
        words = _words(argument)
        if words[:1] not in (["spectral"], ["xyz"]):  # measured spectra and CIE colours: no exporter of clothing writes
            material.colors[keyword] = _color(text, keyword, words, offset)
    elif keyword in _SCALARS:
        words = [word for word in _words(argument) if word != "-halo"]
        if words[:1] != []:
            material.scalars[keyword] = _number(text, keyword, words[0], offset)
    elif keyword.lower() in _MAP_KEYS:
        reference = _map_reference(text, keyword, argument, offset)
        if reference is not None:
            material.maps[_MAP_KEYS[keyword.lower()]] = reference


def _words(argument: str) -> list[str]:
    return argument.split("#")[0].split()


def _color(text: ObjText, keyword: str, words: list[str], offset: int) -> tuple[float, float, float]:
    values = [_number(text, keyword, word, offset) for word in words[:3]]
    if len(values) not in (1, 3):
        raise text.error(f"'{keyword}' has {len(values)} numbers; expected 1 or 3", offset)
    return (values[0], values[-2], values[-1]) if len(values) == 3 else (values[0], values[0], values[0])


def _number(text: ObjText, keyword: str, word: str, offset: int) -> float:
    if not _NUMBER.fullmatch(word) or not math.isfinite(float(word)):
        raise text.error(f"'{keyword}': '{word[:40]}' is not a number", offset)
    return float(word)


def _map_reference(text: ObjText, keyword: str, argument: str, offset: int) -> MapReference | None:
    """Options may stand before the name (the specification) or after it (some exporters); the name may have blanks.

    A statement without any argument names no map; some exporters write them.
    """
    if not argument:
        return None
    reference = MapReference("", text.line_of(offset))
    rest = argument
    while rest.startswith("-"):
        taken = _take_option(rest)
        if taken is None:
            break
        option, values, rest = taken
        reference = _with_option(text, reference, option, values, offset)
    name, trailing = _split_trailing(rest)
    for option, values in trailing:
        reference = _with_option(text, reference, option, values, offset)
    if not name:
        raise text.error(f"'{keyword}' names no file", offset)
    return replace(reference, name=name)


def _take_option(rest: str) -> tuple[str, list[str], str] | None:
    """The option that `rest` starts with, its arguments, and what follows; None where it is no option."""
    option, _, rest = rest.partition(" ")
    most = _OPTION_ARGUMENTS.get(option)
    if most is None:
        return None
    values: list[str] = []
    rest = rest.lstrip()
    while len(values) < most and rest:
        word, _, after = rest.partition(" ")
        if most > 1 and not _NUMBER.fullmatch(word):
            break
        values.append(word)
        rest = after.lstrip()
    return option, values, rest


def _split_trailing(rest: str) -> tuple[str, list[tuple[str, list[str]]]]:
    """A name and the options after it; a name that merely contains " -s " stays whole."""
    for found in re.finditer(r" (?=-[a-z]+ )", rest):
        tail = rest[found.end() :]
        options = []
        while tail.startswith("-"):
            taken = _take_option(tail)
            if taken is None or not taken[1]:
                break
            options.append(taken[:2])
            tail = taken[2]
        if not tail:
            return rest[: found.start()].strip(), options
    return rest.strip(), []


def _with_option(text: ObjText, reference: MapReference, option: str, values: list[str], offset: int) -> MapReference:
    if option in ("-o", "-s", "-bm"):
        if not values:
            raise text.error(f"map option '{option}' has no number", offset)
        numbers = [_number(text, option, value, offset) for value in values]
        if option == "-bm":
            return replace(reference, bump=numbers[0])
        default = 0.0 if option == "-o" else 1.0
        pair = (numbers[0], numbers[1] if len(numbers) > 1 else default)
        return replace(reference, offset=pair) if option == "-o" else replace(reference, scale=pair)
    if option == "-clamp":
        return replace(reference, clamp=values[:1] == ["on"])
    if option == "-imfchan":
        return replace(reference, channel=values[0].lower() if values else None)
    return reference
