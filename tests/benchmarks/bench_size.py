"""Sizes of compiled files by profile, beside what gltfpack and glTF-Transform make of the same file: prints Markdown.

    python -m tests.benchmarks.bench_size [outfit.obj [profile...]]

Each profile's own settings in plain float are the reference, which the other programs get too. The error is that of
vertices along the animation against it, the pose-key network apart (nobody else keeps it). Needs `npm ci` in
tests/engines.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import garmentc
from garmentc.errors import GarmentcError
from garmentc.gltf.evaluate import world_mesh
from garmentc.gltf.glb_asset import GlbAsset
from garmentc.gltf.posing import state_at_time
from garmentc.gltf.read import read_glb
from garmentc.gltf.state import rest_state
from garmentc.options import PROFILES

sys.path.insert(0, str(Path(__file__).parents[1]))
import engine_runs

from tests.benchmarks.bench_compile import write_tunic

EXAMPLES = Path(__file__).parents[2] / "examples"
MOTION = EXAMPLES / "motions" / "step_turn_raise.npz"
TIMES = np.linspace(0, 3.9, 14)

KEPT = ["-kn", "-km", "-ke", "-kv", "-af", "0"]
REFERENCE = "float, dense"
PACKED = {
    "gltfpack -cc": ["-cc", *KEPT],
    "gltfpack -cc, 16 bits": ["-cc", "-vp", "16", "-vt", "16", "-ar", "16", "-at", "24", *KEPT],
}
TRANSFORMED = {"glTF-Transform meshopt": ["meshopt"]}

MATERIAL = """newmtl cloth
map_Kd twill.png
map_Bump twill_normal.png
"""


@dataclass(frozen=True)
class Row:
    """A file: its size, and how far its vertices are from the reference's along the animation, millimetres."""

    made_by: str
    bytes: int
    mean_mm: float
    max_mm: float


def main(arguments: Sequence[str]) -> None:
    """The outfit to compile, or a tunic of 10,000 vertices; then the profiles to measure, or all of them."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        outfit = Path(arguments[0]) if arguments else textured_tunic(folder)
        profiles = arguments[1:] or list(PROFILES)
        print("| profile | file | size | error, mean | max |\n| --- | --- | ---: | ---: | ---: |")
        for profile in profiles:
            for row in rows(outfit, profile, folder):
                cells = (
                    profile,
                    row.made_by,
                    f"{row.bytes / 1000:.0f} kB",
                    f"{row.mean_mm:.3f} mm",
                    f"{row.max_mm:.2f} mm",
                )
                print(f"| {' | '.join(cells)} |", flush=True)
        print("\n| profile | without pose keys | with | their share |\n| --- | ---: | ---: | ---: |")
        for profile in profiles:
            without, with_keys = (
                compiled(outfit, folder / "keys.glb", profile=profile, pose_keys=keys) for keys in (False, True)
            )
            share = (with_keys - without) / with_keys
            print(
                f"| {profile} | {without / 1000:.0f} kB | {with_keys / 1000:.0f} kB | {100 * share:.0f} % |", flush=True
            )


def textured_tunic(folder: Path) -> Path:
    """10,000 vertices, with a colour and a normal texture."""
    plain, outfit = folder / "plain.obj", folder / "tunic.obj"
    write_tunic(plain, 80, 125)
    outfit.write_text("mtllib tunic.mtl\nusemtl cloth\n" + plain.read_text())
    (folder / "tunic.mtl").write_text(MATERIAL)
    for texture in ("twill.png", "twill_normal.png"):
        shutil.copy(EXAMPLES / texture, folder)
    return outfit


def rows(outfit: Path, profile: str, folder: Path) -> list[Row]:
    """All files of one profile, the reference first."""
    settings: dict[str, Any] = {"profile": profile, "pose_keys": False}
    own: dict[str, dict[str, Any]] = {
        REFERENCE: {"quantize": False, "sparse": "never"},
        "garmentc": {},
        "garmentc --meshopt": {"meshopt": True},
    }
    if not PROFILES[profile].quantize:
        own["garmentc --quantize --meshopt"] = {"quantize": True, "meshopt": True}
    files = {}
    for number, (made_by, options) in enumerate(own.items()):
        files[made_by] = folder / f"own-{number}.glb"
        compiled(outfit, files[made_by], **settings, **options)
    reference = files[REFERENCE]
    packed = [{"glb": str(reference), "flags": flags} for flags in PACKED.values()]
    files |= dict(zip(PACKED, engine_runs.run("rewrite_gltfpack.mjs", packed, folder), strict=True))
    steps = [{"glb": str(reference), "steps": given} for given in TRANSFORMED.values()]
    files |= dict(zip(TRANSFORMED, engine_runs.run("rewrite_gltf_transform.mjs", steps, folder), strict=True))
    meant = read_glb(reference)
    return [row(made_by, path, meant) for made_by, path in files.items()]


def compiled(outfit: Path, output: Path, **options: Any) -> int:
    """Compile; returns the file's size."""
    return garmentc.compile_outfit(outfit, output, gender="neutral", motion=MOTION, **options).output.bytes


def row(made_by: str, path: Path, meant: GlbAsset) -> Row:
    size = path.stat().st_size
    try:
        apart = 1000 * distances(meant, read_glb(path))
    except GarmentcError as error:
        return Row(f"{made_by} ({error.message})", size, float("nan"), float("nan"))
    return Row(made_by, size, float(apart.mean()), float(apart.max()))


def distances(meant: GlbAsset, found: GlbAsset) -> NDArray[np.float64]:
    """Metres (T, S) from each vertex of `meant` to where it is in `found`: the vertex at the same place at rest."""
    _, same = cKDTree(world_mesh(found, rest_state(found))[0]).query(world_mesh(meant, rest_state(meant))[0])
    moved = []
    for time in TIMES:
        left, right = (world_mesh(glb, state_at_time(glb, float(time)))[0] for glb in (meant, found))
        moved.append(np.linalg.norm(left - right[same], axis=1))
    return np.array(moved)


if __name__ == "__main__":
    main(sys.argv[1:])
