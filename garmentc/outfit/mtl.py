"""MTL material libraries (stand-in until the real one is in place)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from garmentc.errors import Diagnostic
from garmentc.outfit.obj_state import Library
from garmentc.outfit.outfit import Material


def load_materials(
    obj: Path, libraries: Sequence[Library], names: Sequence[str], *, allow_external_textures: bool = False
) -> tuple[tuple[Material, ...], tuple[Diagnostic, ...]]:
    return tuple(Material(name) for name in names), ()
