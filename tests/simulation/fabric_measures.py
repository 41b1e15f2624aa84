"""How fabrics hang and slide, measured as textile laboratories and mechanics textbooks do.

    python -m tests.simulation.fabric_measures

prints the tables of docs/dataset.md; two minutes on one core. tests/test_fabrics.py asserts the same at less cost.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.simulation.brims import rim_loops
from garmentc.simulation.cloth_simulator import Cloth, simulate
from garmentc.simulation.fabrics import FABRICS, Fabric
from garmentc.simulation.newton_cloth import NewtonCloth
from garmentc.simulation.outfit_parameters import GarmentParameters, OutfitParameters
from garmentc.simulation.outfits import GeneratedOutfit, generate_outfit
from garmentc.simulation.pins import pin, worn_tight
from garmentc.simulation.simulation_settings import SimulationSettings
from garmentc.smpl.default_body import load_default_body
from tests.cloth_samples import sheet, slab

GRAVITY = 9.81
DISC, SPECIMEN = 0.09, 0.15
"""Metres: radii of the supporting disc and of the specimen in Cusick's test (ISO 9073-9)."""

UNSETTLED = SimulationSettings(settle_frames=0)


def drape_coefficient(fabric: Fabric, rings: int = 10, frames: int = 90) -> float:
    """Cusick's: share of the ring outside the disc that the specimen still shades from above; 1 is a board."""
    vertices, triangles = disc(SPECIMEN, rings)
    held = np.flatnonzero(np.hypot(vertices[:, 0], vertices[:, 2]) < DISC + 1e-6)
    floor, faces = slab()
    placed = vertices + np.array([0, 0.5, 0])
    state = NewtonCloth(placed, triangles, fabric, floor, faces, held, UNSETTLED)
    for _ in range(frames):
        state.advance(floor, placed[held], damping=0.9)
    rim = state.positions[-6 * rings :]
    x, z = rim[:, 0].astype(float), rim[:, 2].astype(float)
    shadow = 0.5 * abs(float((x * np.roll(z, -1) - np.roll(x, -1) * z).sum()))
    board = 0.5 * 6 * rings * SPECIMEN**2 * np.sin(2 * np.pi / (6 * rings))
    hole = np.pi * DISC**2
    return float((shadow - hole) / (board - hole))


def disc(radius: float, rings: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """A level disc: ring k has 6 k vertices; its outermost are the last."""
    from scipy.spatial import Delaunay

    points = [np.zeros((1, 2))]
    for ring in range(1, rings + 1):
        angle = 2 * np.pi * np.arange(6 * ring) / (6 * ring)
        points.append(radius * ring / rings * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    flat = np.concatenate(points)
    triangles = np.array(Delaunay(flat).simplices, dtype=np.int64)
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles[area > 0] = triangles[area > 0][:, ::-1]  # z points at the reader: facing up
    triangles = triangles[np.abs(area) > 1e-9]
    return np.stack([flat[:, 0], np.zeros(len(flat)), flat[:, 1]], axis=1), triangles


@dataclass(frozen=True)
class Hang:
    """How a skirt hangs at rest.

    spread  mm: mean distance of the hem from its own axis
    folds   mm: how far the hem goes in and out of an even oval, root mean square
    bend    mean of 1 - cos between the normals of neighbouring triangles, in thousandths
    """

    spread: float
    folds: float
    bend: float


def circle_skirt(vertex_count: int = 1400) -> GeneratedOutfit:
    """A knee-length skirt that would stand out like a cone if it had no weight."""
    garment = GarmentParameters("skirt", length=0.55, flare=0.5, rise=0.8, roughness=0.0)
    parameters = OutfitParameters(1, "skirt", "female", (0.0,) * 10, vertex_count, (garment,))
    return generate_outfit(parameters, load_default_body("female"))


def hang(outfit: GeneratedOutfit, fabric: Fabric, settings: SimulationSettings | None = None) -> Hang:
    """Settle a skirt on its body and measure it."""
    settings = settings or SimulationSettings(settle_frames=90)
    body = load_default_body("female")
    rest = body.shaped(np.zeros(10))
    pins = pin(outfit.vertices, worn_tight(outfit), rest, body.faces, settings.clearance)
    cloth = Cloth(outfit.vertices, outfit.triangles, fabric, pins)
    settled = simulate(cloth, rest, rest[None][:0], body.faces, settings).template.astype(np.float64)
    return measure_hang(settled, outfit.triangles)


def measure_hang(settled: NDArray[Any], triangles: NDArray[Any]) -> Hang:
    hem = settled[min(rim_loops(triangles), key=lambda loop: float(settled[np.array(loop), 1].mean()))]
    x, z = (hem[:, [0, 2]] - hem[:, [0, 2]].mean(axis=0)).T
    angle, radius = np.arctan2(z, x), np.hypot(x, z)
    waves = [np.ones_like(angle), *(f(k * angle) for k in (1, 2) for f in (np.cos, np.sin))]
    oval = np.stack(waves, axis=1)
    even = oval @ np.linalg.lstsq(oval, radius, rcond=None)[0]
    return Hang(
        1000 * float(radius.mean()),
        1000 * float(np.sqrt(np.mean((radius - even) ** 2))),
        1000 * bend(settled, triangles),
    )


def bend(vertices: NDArray[Any], triangles: NDArray[Any]) -> float:
    """Mean of 1 - cos between the normals of triangles that share an edge."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    corners = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    owner = np.tile(np.arange(len(triangles)), 3)
    order = np.lexsort(corners.T)
    same = (corners[order][1:] == corners[order][:-1]).all(axis=1)
    pairs = np.stack([owner[order][:-1][same], owner[order][1:][same]], axis=1)
    return float((1 - (normal[pairs[:, 0]] * normal[pairs[:, 1]]).sum(axis=1)).mean())


def slid(friction: float, tilt: float, frames: int) -> float:
    """Metres that a patch of cotton slides down a slope of `tilt` degrees in `frames` of 1/30 s."""
    body, faces = slab(tilt)
    slope = np.radians(tilt)
    down, normal = np.array([np.cos(slope), -np.sin(slope), 0]), np.array([np.sin(slope), np.cos(slope), 0])
    flat, triangles = sheet(0.1, 0.1, 5, 5)
    fabric = replace(FABRICS["cotton"], friction=friction)
    placed = flat[:, :1] * down + flat[:, 2:] * [0, 0, 1] + (UNSETTLED.clearance + fabric.thickness / 2) * normal
    result = simulate(Cloth(placed, triangles, fabric), body, np.repeat(body[None], frames, axis=0), faces, UNSETTLED)
    return float(((result.frames[-1] - placed) @ down).mean())


def coulomb(friction: float, tilt: float, frames: int) -> float:
    """The same in closed form: it sticks where tan(tilt) < friction, else a = g (sin - friction cos)."""
    slope = np.radians(tilt)
    return float(0.5 * GRAVITY * max(np.sin(slope) - friction * np.cos(slope), 0.0) * (frames / 30) ** 2)


def left_behind(friction: float, acceleration: float, frames: int) -> float:
    """Metres that a patch lags behind a level slab that speeds up at `acceleration` m/s2."""
    body, faces = slab()
    flat, triangles = sheet(0.1, 0.1, 5, 5)
    fabric = replace(FABRICS["cotton"], friction=friction)
    placed = flat + np.array([0, UNSETTLED.clearance + fabric.thickness / 2, 0])
    way = 0.5 * acceleration * (np.arange(1, frames + 1) / 30) ** 2
    moved = body + way[:, None, None] * [1, 0, 0]
    result = simulate(Cloth(placed, triangles, fabric), body, moved, faces, UNSETTLED)
    return float(way[-1] - (result.frames[-1] - placed)[:, 0].mean())


def main() -> None:
    """Print the tables."""
    _print("fabric", "drape coefficient", "bending length, cm", "hem spread, mm", "folds, mm", "bend, 1e-3")
    skirt = circle_skirt()
    for name in ("silk", "cotton", "denim", "leather"):
        fabric = FABRICS[name]
        length = 100 * (fabric.bending / (fabric.density * GRAVITY)) ** (1 / 3)
        _print(name, f"{drape_coefficient(fabric):.0%}", f"{length:.1f}", *_cells(hang(skirt, fabric)), head=False)
    _print("denim of g/m2", "hem spread, mm", "folds, mm", "bend, 1e-3")
    for density in (0.1, 0.324, 1.0):
        _print(f"{1000 * density:.0f}", *_cells(hang(skirt, replace(FABRICS["denim"], density=density))), head=False)
    _print("slope", "its tangent", "friction", "slid in 0.4 s, mm", "Coulomb, mm")
    for tilt in (10.0, 20.0, 30.0):
        for friction in (0.0, 0.1, 0.25, 0.45, 0.7):
            ways = (f"{1000 * law(friction, tilt, 12):.1f}" for law in (slid, coulomb))
            _print(f"{tilt:.0f}°", f"{np.tan(np.radians(tilt)):.2f}", str(friction), *ways, head=False)


def _cells(row: Hang) -> tuple[str, str, str]:
    return f"{row.spread:.0f}", f"{row.folds:.1f}", f"{row.bend:.1f}"


def _print(*cells: str, head: bool = True) -> None:
    """A row of a table; a head comes after an empty line."""
    if head:
        print()
    print("|", " | ".join(cells), "|", flush=True)
    if head:
        print("|" + "---|" * len(cells))


if __name__ == "__main__":
    main()
