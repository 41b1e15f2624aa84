"""Try all engines on all files and write docs/engines.md and docs/engines.png.

    PYTHONPATH=tests python -m conformance --python ENGINES/bin/python

Ends with status 1 where an engine shows a vertex farther from the rig than it may, or refuses a file unexpectedly.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from string import Template

import engine_runs
import numpy as np
from compiled import case, compile_case
from engine_runs import Refused

from conformance import engines, report
from conformance.engines import BLENDER, MEASURED
from conformance.gowns import ALL, Gown
from conformance.pictures import RENDERERS, draw_sheet
from conformance.round_trips import TRIPS, make_trips
from conformance.subject import GOWN_COLUMNS, Subject, of_compiled, of_gowns

ROOT = Path(__file__).parents[2]
OUTFIT = ROOT / "examples" / "tee_and_skirt.obj"
FRAMES = [11, 43, 78, 119]
PICTURED, ANGLES = [43, 119], [0.4, -0.5]

# More vertices than 16 bits count.
LARGE = Gown(4, 16, True, False, parts=1, columns=260, rows=260)


def main() -> int:
    parser = argparse.ArgumentParser(prog="conformance", description=__doc__)
    parser.add_argument("--python", type=Path, required=True, help="the Python that has tests/engines/requirements.txt")
    parser.add_argument("--docs", type=Path, default=ROOT / "docs", help="where engines.md and engines.png go")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        text, good = measure(Path(folder), given.python.absolute(), given.docs / "engines.png")
    (given.docs / "engines.md").write_text(text)
    print(text)
    return 0 if good else 1


def measure(folder: Path, python: Path, sheet: Path) -> tuple[str, bool]:
    """The document, and whether everything in it is as it should be."""
    say("writing files")
    profiles = compiled_subjects(folder)
    gowns = of_gowns([*ALL, LARGE], folder)
    subjects = [*profiles, *gowns]
    khronos = engine_runs.khronos_reports([subject.glb for subject in subjects], folder)
    columns = []
    for engine in MEASURED:
        say(f"{engine.name}: {len(subjects)} files")
        columns.append((engine.name, engines.try_engine(engine, subjects, folder, python)))
    say(f"{engines.FILAMENT.name}: {len(subjects)} pictures")
    columns.append((engines.FILAMENT.name, engines.try_filament(subjects, folder, python)))
    say("round trips")
    journeys = list(product(TRIPS, trip_subjects(profiles)))
    returned = make_trips(journeys, folder)
    pictured = next(subject for subject in profiles if subject.labels[0] == "web")
    say("pictures")
    outlines = draw_sheet(at(pictured, PICTURED), ANGLES, folder, python, sheet)

    split = len(profiles)
    text = Template((Path(__file__).parent / "engines.md").read_text()).substitute(
        summary=summary(subjects, khronos, columns, python),
        profiles=report.matrix(profiles, PROFILE_COLUMNS, khronos[:split], cut(columns, slice(split))),
        gowns=report.matrix(gowns, GOWN_COLUMNS, khronos[split:], cut(columns, slice(split, None))),
        trips=report.round_trips(journeys, returned),
        renderers=", ".join(engine.name for engine in RENDERERS),
        outlines=outline_text(outlines),
        **limits(subjects, folder, python),
    )
    good = all(report.issues(each) == "0 / 0" for each in khronos)
    return text, good and all(cell.good for _, column in columns for cell in column)


def summary(
    subjects: Sequence[Subject], khronos: Sequence[dict], columns: Sequence[report.Column], python: Path
) -> str:
    """A row for each engine."""
    valid = sum(report.issues(each) == "0 / 0" for each in khronos)
    rows = [
        [
            "Khronos glTF validator",
            f"gltf-validator {engines.npm_version('gltf-validator')}",
            "",
            "",
            "",
            f"{valid} of {len(khronos)} valid",
        ]
    ]
    for engine, (name, column) in zip((*MEASURED, engines.FILAMENT), columns, strict=True):
        packed = [cell for cell, subject in zip(column, subjects, strict=True) if "meshopt" in " ".join(subject.labels)]
        reads = "reads meshopt" if all(cell.error is not None for cell in packed) else "no meshopt"
        errors = [report.worst(column, subjects, quantized, report.unit(name)) for quantized in (False, True)]
        rows.append(
            [name, f"{engine.package} {engines.version(engine, python)}", str(engine.influences), *errors, reads]
        )
    return report.table(["engine", "package", "influences read", "float, µm", "quantized, µm", ""], rows)


def limits(subjects: Sequence[Subject], folder: Path, python: Path) -> dict[str, str]:
    """What engines are known to leave out, in millimetres."""
    lost = [farthest_apart(each.positions(8), each.positions(4)) for each in subjects if each.labels[0] == "desktop"]
    shrunk = [
        farthest_apart(each.positions(4), each.positions(4, normalized=False))
        for each in subjects
        if each.influences == 8 and each.quantized
    ]
    held = []
    for name in ("web --no-quantize", "reference"):
        subject = next(subject for subject in subjects if subject.labels[0] == name)
        job = {"glb": str(subject.glb), "times": subject.times, "as_imported": True}
        [found] = engines.attempt(BLENDER, [job], folder, python)
        held.append(found.reason if isinstance(found, Refused) else f"{_clamped(found, subject) * 1000:.1f} mm")
    return {
        "four_influences": f"{max(lost) * 1000:.1f}",
        "shrunk": f"{max(shrunk) * 1000:.0f}",
        "sliders": held[0],
        "sliders_reference": held[1],
    }


def _clamped(found: Path, subject: Subject) -> float:
    expected = subject.positions()
    return farthest_apart(np.fromfile(found).reshape(expected.shape), expected)


def farthest_apart(found: np.ndarray, expected: np.ndarray) -> float:
    """The largest distance between a vertex and itself, metres."""
    return float(np.linalg.norm(found - expected, axis=-1).max())


def at(subject: Subject, frames: list[int]) -> Subject:
    return replace(subject, frames=frames)


def cut(columns: Sequence[report.Column], rows: slice) -> list[report.Column]:
    return [(name, column[rows]) for name, column in columns]


def outline_text(apart: dict[str, float | Refused]) -> str:
    return ", ".join(
        f"{name} {found.reason if isinstance(found, Refused) else f'{found:.1f} px'}" for name, found in apart.items()
    )


PROFILE_COLUMNS = ("profile", "influences", "morphs", "numbers", "vertices", "kB")


def say(progress: str) -> None:
    """To standard error, with the time of day: some steps take minutes."""
    print(time.strftime("%H:%M:%S"), progress, file=sys.stderr, flush=True)


def compiled_subjects(folder: Path) -> list[Subject]:
    """The example outfit in every profile."""
    subjects = []
    for name, given in {
        "mobile": {"profile": "mobile"},
        "web": {"profile": "web"},
        "web --meshopt": {"profile": "web", "meshopt": True},
        "web --no-quantize": {"profile": "web", "quantize": False},
        "desktop": {"profile": "desktop"},
        "reference": {"profile": "reference"},
    }.items():
        made = compile_case(case(OUTFIT, **given), folder)
        settings = made.case.options.settings
        labels = (
            name,
            str(settings.influences),
            str(made.rig.morph_count),
            "quantized" if settings.quantize else "float",
            f"{len(made.corner_vertices):,}",
            f"{made.written.bytes / 1000:,.0f}",
        )
        subjects.append(of_compiled(made, labels, made.path, FRAMES))
    return subjects


def trip_subjects(profiles: Sequence[Subject]) -> list[Subject]:
    return [subject for subject in profiles if subject.labels[0] in ("web", "web --no-quantize")]


if __name__ == "__main__":
    sys.exit(main())
