"""The engines, and how each is asked where a file's vertices are."""

from __future__ import annotations

import json
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import engine_runs
import numpy as np
from engine_runs import ENGINES, Refused

from conformance.silhouette import drawn, pixels_apart, silhouette, view_of
from conformance.subject import Subject

PICTURED_FRAME = 2


@dataclass(frozen=True)
class Engine:
    """One that gives vertex positions.

    influences  how many joints per vertex it reads
    package     whose version the tables give, in npm or pip
    in_python   whether the program runs in the engines' own Python
    refuses     words in its error for files that it is known to refuse, and what to say instead
    """

    name: str
    program: str
    influences: int
    package: str
    in_python: bool = False
    refuses: tuple[str, str] | None = None


@dataclass(frozen=True)
class Cell:
    """What an engine made of a file: `error` is in metres, or in pixels of the picture; None where it gave nothing."""

    error: float | None
    allowed: float
    reason: str = ""
    known: bool = True

    @property
    def good(self) -> bool:
        """Within what is allowed, or a refusal that is known and documented."""
        return self.known if self.error is None else self.error <= self.allowed


GLTF_TRANSFORM = Engine("glTF-Transform", "gltf_transform.mjs", 8, "@gltf-transform/core")
THREE_CPU = Engine("three.js CPU", "three_cpu.mjs", 4, "three")
THREE_GPU = Engine("three.js GPU", "chromium.mjs", 4, "three")
BABYLON = Engine("Babylon.js", "babylon.mjs", 8, "@babylonjs/core")
BLENDER = Engine("Blender", "blender.py", 8, "bpy", True, ("EXT_meshopt_compression is not available", "no meshopt"))
FILAMENT = Engine("Filament", "filament.py", 4, "filly", in_python=True)
MEASURED = (GLTF_TRANSFORM, THREE_CPU, THREE_GPU, BABYLON, BLENDER)


def version(engine: Engine, python: Path) -> str:
    """Of the installed package."""
    if engine.in_python:
        command = [python, "-c", f"import importlib.metadata as m; print(m.version({engine.package!r}))"]
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip() or "–"
    return npm_version(engine.package)


def npm_version(package: str) -> str:
    """Of an installed npm package."""
    found: str = json.loads((ENGINES / "node_modules" / package / "package.json").read_text())["version"]
    return found


def missing(engine: Engine, python: Path) -> str | None:
    """Why the engine cannot be tried here, or None."""
    if engine.in_python and version(engine, python) == "–":
        return f"{engine.package} is not installed; it has no wheel for this Python"
    if engine is THREE_GPU and shutil.which(engine_runs.chromium()) is None:
        return "Chromium is not installed"
    return None


def try_engine(engine: Engine, subjects: list[Subject], folder: Path, python: Path) -> list[Cell]:
    """The largest coordinate by which any vertex is off at any of the times, for each file."""
    jobs = [{"glb": str(subject.glb), "times": subject.times} for subject in subjects]
    return [
        _moved(engine, each, out) for each, out in zip(subjects, attempt(engine, jobs, folder, python), strict=True)
    ]


def _moved(engine: Engine, subject: Subject, out: Path | Refused) -> Cell:
    if isinstance(out, Refused):
        return _refusal(engine, out, subject.tolerance)
    expected = subject.positions(engine.influences)
    found = np.fromfile(out)
    if found.size != expected.size:
        return Cell(
            None, subject.tolerance, f"gives {found.size // 3} positions instead of {expected.size // 3}", False
        )
    return Cell(float(np.abs(found.reshape(expected.shape) - expected).max()), subject.tolerance)


def try_filament(subjects: list[Subject], folder: Path, python: Path) -> list[Cell]:
    """By how many pixels the drawn outline is off, for each file.

    Filament brings the sum of weights to 1 only where they are floats; what it leaves out of quantized ones is missing.
    """
    shown = [subject.positions(4, normalized=not subject.quantized)[PICTURED_FRAME] for subject in subjects]
    views = [view_of(points) for points in shown]
    jobs = [
        {"glb": str(subject.glb), "time": subject.times[PICTURED_FRAME], "view": view.as_job()}
        for subject, view in zip(subjects, views, strict=True)
    ]
    cells = []
    outs = attempt(FILAMENT, jobs, folder, python)
    for subject, points, view, out in zip(subjects, shown, views, outs, strict=True):
        if isinstance(out, Refused):
            cells.append(_refusal(FILAMENT, out, 2))
            continue
        expected = silhouette(points, subject.triangles, view)
        cells.append(Cell(pixels_apart(drawn(out), expected), 2))
    return cells


def attempt(engine: Engine, jobs: list[dict], folder: Path, python: Path) -> list[Path | Refused]:
    """What the engine writes for each job, or why it does not."""
    absent = missing(engine, python)
    if absent is not None:
        return [Refused(absent)] * len(jobs)
    return engine_runs.attempt(engine.program, jobs, folder, python if engine.in_python else None)


def _refusal(engine: Engine, refused: Refused, allowed: float) -> Cell:
    if engine.refuses is not None and engine.refuses[0] in refused.reason:
        return Cell(None, allowed, engine.refuses[1])
    return Cell(None, allowed, refused.reason.splitlines()[-1], known="not installed" in refused.reason)
