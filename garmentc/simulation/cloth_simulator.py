"""Cloth on a moving body: first settled at rest, then frame by frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.simulation.fabrics import FABRICS, Fabric
from garmentc.simulation.newton_cloth import NewtonCloth
from garmentc.simulation.pins import NO_PINS, Pins
from garmentc.simulation.simulation_settings import SimulationSettings

Progress = Callable[[int, int], None]
"""Called with the number of frames done and of all frames."""


@dataclass(frozen=True)
class Cloth:
    """What is simulated: an outfit on the body at rest.

    vertices   (N, 3) metres, unstretched, in the body's axes (Y up)
    triangles  (F, 3) int, each with an area; garments of several layers are one mesh with several components
    fabric     of all of it
    pins       vertices that follow the skin
    """

    vertices: NDArray[Any]
    triangles: NDArray[Any]
    fabric: Fabric
    pins: Pins = NO_PINS


@dataclass(frozen=True)
class SimulatedCloth:
    """Vertices of a cloth over time, float32 metres.

    template  (N, 3) settled on the body at rest: the template T of the outfit
    frames    (T, N, 3), one for each frame of the body
    """

    template: NDArray[np.float32]
    frames: NDArray[np.float32]


def simulate(
    cloth: Cloth,
    rest_body: NDArray[Any],
    body_frames: NDArray[Any],
    faces: NDArray[Any],
    settings: SimulationSettings | None = None,
    progress: Progress | None = None,
) -> SimulatedCloth:
    """Settle the cloth on the body at rest (V, 3), then move the body through `body_frames` (T, V, 3).

    faces  (F, 3) of the body, a closed surface. Frames are 1 / fps apart and the first should be close to rest: a body
    that jumps leaves its clothes behind (motion_preparation leads in).

    The same arguments give the same bytes on the same machine. Raises GarmentcError where Newton is not installed,
    where a triangle of the cloth has no area, and where the cloth explodes: it says in which frame.
    """
    settings = settings or SimulationSettings()
    if len(body_frames) and np.shape(body_frames)[1:] != np.shape(rest_body):
        raise GarmentcError(f"the moving body has {np.shape(body_frames)[1]} vertices, at rest {len(rest_body)}")
    _check_areas(cloth)
    state = NewtonCloth(cloth.vertices, cloth.triangles, cloth.fabric, rest_body, faces, cloth.pins.vertices, settings)
    template = _settle(state, cloth.pins, np.asarray(rest_body), settings)
    frames = np.empty((len(body_frames), *template.shape), dtype=np.float32)
    for index, body in enumerate(body_frames):
        frames[index] = state.advance(body, cloth.pins.positions(body))
        _check_contained(frames[index], body, f"in frame {index} of {len(body_frames)}", settings)
        if progress:
            progress(index + 1, len(body_frames))
    return SimulatedCloth(template, frames)


def warm_up() -> None:
    """Compile Newton's kernels into their cache: do it once before several processes simulate side by side.

    Processes that find no cache all compile, which takes minutes and memory each.
    """
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    cloth = Cloth(corners[:3] * 0.1 + [0, 0, 2], np.array([[0, 1, 2]]), FABRICS["cotton"])
    simulate(cloth, corners, np.repeat(corners[None], 2, axis=0), faces, SimulationSettings(settle_frames=1))


def _settle(state: NewtonCloth, pins: Pins, body: NDArray[Any], settings: SimulationSettings) -> NDArray[np.float32]:
    """The cloth at rest on the resting body, (N, 3)."""
    positions = state.positions
    targets = pins.positions(body)
    for _ in range(settings.settle_frames):
        moved = state.advance(body, targets, settings.settle_damping)
        _check_contained(moved, body, "while it settled at rest", settings)
        steps = np.linalg.norm(moved - positions, axis=1)
        positions = moved
        if np.percentile(steps, 99) < settings.settled_step:
            break
    return positions


def _check_areas(cloth: Cloth) -> None:
    a, b, c = (np.asarray(cloth.vertices, np.float64)[cloth.triangles[:, k]] for k in range(3))
    flat = np.flatnonzero(np.linalg.norm(np.cross(b - a, c - a), axis=1) < 1e-12)
    if len(flat):
        raise GarmentcError(f"triangle {flat[0]} of the cloth has no area; remove it (and {len(flat) - 1} more)")


def _check_contained(positions: NDArray[Any], body: NDArray[Any], when: str, settings: SimulationSettings) -> None:
    low, high = np.min(body, axis=0) - settings.escape, np.max(body, axis=0) + settings.escape
    held = np.isfinite(positions).all(axis=1) & (positions >= low).all(axis=1) & (positions <= high).all(axis=1)
    if not held.all():
        raise GarmentcError(
            f"the cloth exploded {when}: {np.count_nonzero(~held)} of {len(held)} vertices left the scene; "
            "use a slower motion, or more substeps"
        )
