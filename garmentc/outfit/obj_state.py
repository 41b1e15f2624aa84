"""What names the faces of an OBJ file: materials, objects and groups, smoothing groups, material libraries."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import Diagnostic
from garmentc.outfit.obj_scan import Statement, Tables
from garmentc.outfit.obj_text import ObjText, decode

DEFAULT_MATERIAL = "default"
"""The material of faces that stand before any `usemtl`."""

_FREE_FORM = """
    vp cstype deg bmat step curv curv2 surf parm trim hole scrv sp end con ctech stech bzp bsp cdc cdp res
""".split()  # noqa: SIM905
_RENDER_HINTS = "mg bevel c_interp d_interp lod shadow_obj trace_obj maplib usemap".split()  # noqa: SIM905
_PRIMITIVES = {"l": "line", "p": "point"}

T = TypeVar("T", bound=Hashable)


@dataclass(frozen=True)
class Library:
    """An `mtllib` statement: its whole argument, which may be one name with blanks or several names."""

    argument: str
    line: int


@dataclass(frozen=True)
class FaceState:
    """Names of the P faces: indices (P,) int32 into `material_names` and `groups`; smoothing group or None."""

    libraries: tuple[Library, ...]
    material_names: tuple[str, ...]
    material: NDArray[np.int32]
    groups: tuple[str, ...]
    group: NDArray[np.int32]
    smooth: NDArray[np.int32] | None
    warnings: tuple[Diagnostic, ...]


def read_state(text: ObjText, tables: Tables) -> FaceState:
    """Follow the statements through the file.

    Materials and groups are numbered by first use. A group is called after its object and group, "object/group" where
    the file gives both. Raises GarmentcError for a smoothing group that is none.
    """
    faces = len(tables.counts)
    statements = tables.statements
    material, material_names = _numbered(
        [(s.faces_before, decode(s.argument)) for s in statements if s.keyword == "usemtl"], DEFAULT_MATERIAL, faces
    )
    group, groups = _numbered(_group_changes(statements), "", faces)
    smooth_changes = [(s.faces_before, _smoothing_group(text, s)) for s in statements if s.keyword == "s"]
    smooth = None
    if smooth_changes:
        number, values = _numbered(smooth_changes, 0, faces)
        smooth = np.array(values, dtype=np.int32)[number]
    libraries = {decode(s.argument): s for s in reversed(statements) if s.keyword == "mtllib"}
    return FaceState(
        libraries=tuple(Library(name, text.line_of(s.offset)) for name, s in reversed(libraries.items())),
        material_names=material_names,
        material=material,
        groups=groups,
        group=group,
        smooth=smooth,
        warnings=tuple(_ignored(text, statements)),
    )


def _numbered(changes: Sequence[tuple[int, T]], initial: T, faces: int) -> tuple[NDArray[np.int32], tuple[T, ...]]:
    """(faces,) int32 numbers, by first use, of the values that hold at each face; and these values."""
    values = [initial, *(value for _, value in changes)]
    bounds = np.array([0, *(before for before, _ in changes), faces])
    numbers: dict[T, int] = {}
    for value, begin, end in zip(values, bounds, bounds[1:], strict=False):
        if end > begin:
            numbers.setdefault(value, len(numbers))
    runs = np.array([numbers.get(value, 0) for value in values], dtype=np.int32)
    return np.repeat(runs, np.diff(bounds)), tuple(numbers)


def _group_changes(statements: Sequence[Statement]) -> list[tuple[int, str]]:
    names = {"o": "", "g": ""}
    changes = []
    for statement in statements:
        if statement.keyword in names:
            names[statement.keyword] = decode(statement.argument.split(b" #")[0])
            changes.append((statement.faces_before, "/".join(filter(None, names.values()))))
    return changes


def _smoothing_group(text: ObjText, statement: Statement) -> int:
    """The number as int32 (3ds Max writes unsigned bit masks), 0 for "off"."""
    word = decode(statement.argument.split(b"#")[0]).lower()
    if word in ("off", "null", ""):
        return 0
    if word == "on":
        return 1
    if not (word.isascii() and word.isdigit() and int(word) < 2**32):
        raise text.error(f"smoothing group '{word[:40]}': expected a number or 'off'", statement.offset)
    return int(np.uint32(int(word)).astype(np.int32))


def _ignored(text: ObjText, statements: Sequence[Statement]) -> list[Diagnostic]:
    """One warning for each kind of statement that does not matter here."""
    seen: dict[tuple[str, str], list[Statement]] = {}
    for statement in statements:
        if statement.keyword not in ("usemtl", "mtllib", "o", "g", "s"):
            seen.setdefault(_kind(statement.keyword), []).append(statement)
    warnings = []
    for (code, what), found in seen.items():
        first = found[0].keyword.encode("ascii", "replace").decode()[:40]
        message = f"{what} ignored ({len(found)} line{'s' if len(found) > 1 else ''}, the first is '{first}')"
        warnings.append(Diagnostic(code, message, str(text.path), text.line_of(found[0].offset)))
    return warnings


def _kind(keyword: str) -> tuple[str, str]:
    """The diagnostic's code for an ignored statement, and what to call it."""
    if keyword in _PRIMITIVES:
        return "obj.primitive", f"{_PRIMITIVES[keyword]} elements"
    if keyword in _FREE_FORM:
        return "obj.free-form", "free-form geometry"
    if keyword in _RENDER_HINTS:
        return "obj.render-hint", "rendering hints"
    return "obj.unknown-statement", "unknown statements"
