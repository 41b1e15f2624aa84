"""Our simulation beside an independent one: Blender's cloth, on two outfits of the benchmark dataset.

Blender never meets the package: it runs in its own Python (3.11 for Blender 4.5) as a subprocess.

    python3.11 -m venv blender && blender/bin/pip install 'bpy==4.5.*'
    python -m tests.simulation.compare_blender --python blender/bin/python --out compared

prints the table of docs/dataset.md, and writes compared/<outfit>.png and the frames of both. Some ten minutes on one
core. Not part of the test suite.
"""

from __future__ import annotations

import argparse
import subprocess
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from garmentc.evaluation.metrics import edge_lengths, signed_distance
from garmentc.outfit.topology import edges as edges_of
from garmentc.simulation.cloth_simulator import Cloth, simulate
from garmentc.simulation.fabrics import FABRICS
from garmentc.simulation.pins import pin, worn_tight
from garmentc.simulation.plan import make_plan
from garmentc.simulation.presets import BENCHMARK
from garmentc.simulation.self_crossings import self_crossings
from garmentc.simulation.simulate_task import SETTINGS, make_outfit, prepared_motion
from garmentc.smpl.default_body import load_default_body
from tests.simulation.drawing import draw

OUTFITS = (20, 82)
"""A T-shirt of cotton and a flared skirt of denim."""

WALK_FRAMES = 45
SETTLE_FRAMES = 60
QUALITIES = (6, 12)
"""Blender's substeps per frame."""

CELL = (300, 340)
TURNS = (0.4, 1.9)


@dataclass(frozen=True)
class Scene:
    """An outfit on a body that goes from rest to a pose and on to the next."""

    name: str
    cloth: Cloth
    rest: NDArray[Any]
    body_frames: NDArray[Any]
    faces: NDArray[Any]


def make_scene(index: int) -> Scene:
    """Outfit `index` of the benchmark, with the start of its own motion."""
    plan = make_plan(BENCHMARK, 0)
    planned = plan.outfits[index]
    motion = replace(plan.tasks_of(planned)[0].motion, frames=WALK_FRAMES)
    body = load_default_body(planned.parameters.gender)
    betas = np.asarray(planned.parameters.betas)
    outfit, _ = make_outfit(planned)
    rest = body.shaped(betas)
    prepared = prepared_motion(motion, body, betas)
    pins = pin(outfit.vertices, worn_tight(outfit), rest, body.faces, SETTINGS.clearance)
    cloth = Cloth(outfit.vertices, outfit.triangles, FABRICS[planned.fabric], pins)
    frames = body.posed(prepared.motion.poses, betas, prepared.motion.trans)
    name = f"{planned.name} {planned.parameters.category} {planned.fabric}"
    return Scene(name, cloth, rest, frames, body.faces)


def in_newton(scene: Scene) -> NDArray[np.float32]:
    """Template and frames (1 + T, N, 3)."""
    settings = replace(SETTINGS, settle_frames=SETTLE_FRAMES)
    result = simulate(scene.cloth, scene.rest, scene.body_frames, scene.faces, settings)
    return np.concatenate([result.template[None], result.frames])


def in_blender(scene: Scene, python: Path, folder: Path, quality: int, self_collision: bool) -> NDArray[np.float32]:
    """The same from Blender, which stands at rest for SETTLE_FRAMES first."""
    cloth, fabric = scene.cloth, scene.cloth.fabric
    body = np.concatenate([np.repeat(scene.rest[None], SETTLE_FRAMES, axis=0), scene.body_frames])
    soft = min(1.0, fabric.density * SETTINGS.wave_speed**2 / fabric.stretch)  # as NewtonCloth does
    files = [folder / f"{name}.npz" for name in ("scene", "blender")]
    np.savez(
        files[0],
        vertices=cloth.vertices,
        triangles=cloth.triangles,
        body_frames=body.astype(np.float32),
        faces=scene.faces,
        pinned=cloth.pins.vertices,
        pin_frames=np.array([cloth.pins.positions(frame) for frame in body], np.float32),
        stretch=soft * fabric.stretch,
        bending=fabric.bending,
        density=fabric.density,
        friction=fabric.friction,
        distance=SETTINGS.clearance + fabric.thickness / 2,
        self_collision=self_collision,
        self_radius=SETTINGS.self_collision_radius,
        fps=SETTINGS.fps,
        quality=quality,
        collision_quality=4,
    )
    script = Path(__file__).with_name("blender_cloth.py")
    subprocess.run([python, script, *files], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    with np.load(files[1]) as result:
        frames: NDArray[np.float32] = result["frames"][SETTLE_FRAMES - 1 :]
    return frames


def differences(a: NDArray[Any], b: NDArray[Any]) -> str:
    """Cells of the table: mean / 95th percentile in mm at rest, in the last frame, and over all frames."""
    error = 1000 * np.linalg.norm(a.astype(float) - b, axis=2)
    parts = (error[0], error[-1], error[1:])
    return " | ".join(f"{part.mean():.1f} / {np.percentile(part, 95):.1f}" for part in parts)


def faults(frames: NDArray[Any], scene: Scene) -> str:
    """Cells: share of vertices over 1 mm in the body, edges through cloth (most), 99th percentile of stretch."""
    bodies = np.concatenate([scene.rest[None], scene.body_frames])
    chosen = np.unique(np.linspace(0, len(frames) - 1, 12).round().astype(int))
    inside = np.mean([(signed_distance(frames[k], bodies[k], scene.faces) < -1e-3).mean() for k in chosen])
    crossing = max(len(self_crossings(frames[k], scene.cloth.triangles)) for k in chosen)
    edge = edges_of(np.asarray(scene.cloth.triangles, np.int32))
    rest = edge_lengths(scene.cloth.vertices, edge)
    stretch = np.percentile([edge_lengths(frames[k], edge) / rest for k in chosen], 99)
    return f"{inside:.2%} | {crossing} | {stretch:.2f}"


def picture(ours: NDArray[Any], theirs: NDArray[Any], scene: Scene, path: Path) -> None:
    """Ours above, Blender's below: at rest, in the middle of the motion and at its end, from the front and the side."""
    bodies = np.concatenate([scene.rest[None], scene.body_frames])
    moments = (0, len(ours) // 2, len(ours) - 1)
    sheet = Image.new("RGB", (2 * len(moments) * CELL[0], 2 * CELL[1]), "white")
    captions = ImageDraw.Draw(sheet)
    for row, (title, frames) in enumerate((("garmentc (Newton)", ours), ("Blender", theirs))):
        for column, moment in enumerate(moments):
            middle = (ours[moment].min(axis=0) + ours[moment].max(axis=0)) / 2
            height = 1.35 * float(np.ptp(ours[moment], axis=0).max())
            layers = [(frames[moment], scene.cloth.triangles, 0)]
            views = draw((bodies[moment], scene.faces), layers, TURNS, (middle, height), CELL)
            for side, view in enumerate(views):
                at = ((2 * column + side) * CELL[0], row * CELL[1])
                sheet.paste(view, at)
                captions.text((at[0] + 6, at[1] + 4), f"{title}, frame {moment}", fill="black")
    sheet.save(path)


def label_of(quality: int, self_collision: bool) -> str:
    """What the table calls a run."""
    return f"Blender, {quality} substeps{', self-collision' if self_collision else ''}"


def main() -> None:
    """Simulate, compare, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", type=Path, required=True, help="a Python that has bpy")
    parser.add_argument("--out", type=Path, required=True, help="folder for pictures and frames")
    parser.add_argument("--outfits", type=int, nargs="+", default=OUTFITS, help="of the benchmark, by number")
    parser.add_argument("--substeps", type=int, nargs="+", default=QUALITIES, help="of Blender's, per frame")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    print("| outfit | simulator | at rest | last pose | all frames | in the body | crossings | stretch | s |")
    print("|---|---|---|---|---|---|---|---|---|")
    for index in options.outfits:
        scene = make_scene(index)
        start = time.process_time()
        ours = in_newton(scene)
        print(
            f"| {scene.name} | Newton | | | | {faults(ours, scene)} | {time.process_time() - start:.0f} |", flush=True
        )
        runs = {}
        for quality, self_collision in (*((q, False) for q in options.substeps), (options.substeps[0], True)):
            began = time.monotonic()
            theirs = in_blender(scene, options.python, options.out, quality, self_collision)
            label = label_of(quality, self_collision)
            took = time.monotonic() - began
            row = f"{differences(ours, theirs)} | {faults(theirs, scene)} | {took:.0f}"
            print(f"| {scene.name} | {label} | {row} |", flush=True)
            runs[label] = theirs
        if len(options.substeps) > 1:
            between = differences(*list(runs.values())[:2])
            print(f"| {scene.name} | Blender at {options.substeps[:2]} substeps | {between} | | | | |", flush=True)
        np.savez_compressed(options.out / f"{index}.npz", newton=ours, **runs)
        picture(ours, runs[label_of(options.substeps[-1], False)], scene, options.out / f"{scene.name.split()[0]}.png")


if __name__ == "__main__":
    main()
