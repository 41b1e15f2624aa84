"""garmentc: an asset compiler for clothing.

    import garmentc
    report = garmentc.compile_outfit("outfit.obj", "outfit.glb", motion="walk.npz", profile="web")

Importing this package imports nothing heavy; the names below load on first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from garmentc.errors import Diagnostic, GarmentcError
    from garmentc.options import CompileOptions
    from garmentc.pipeline import compile_outfit
    from garmentc.report import CompileReport

__version__ = "0.1.0"

__all__ = ["CompileOptions", "CompileReport", "Diagnostic", "GarmentcError", "__version__", "compile_outfit"]

_HOMES = {
    "CompileOptions": "garmentc.options",
    "CompileReport": "garmentc.report",
    "Diagnostic": "garmentc.errors",
    "GarmentcError": "garmentc.errors",
    "compile_outfit": "garmentc.pipeline",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
