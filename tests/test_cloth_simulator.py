"""Cloth simulation against mechanics that can be written down: falling, sliding, bending, hanging."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from garmentc.errors import GarmentcError
from garmentc.evaluation.metrics import edge_lengths, signed_distance
from garmentc.outfit.topology import edges
from garmentc.simulation.cloth_simulator import Cloth, SimulatedCloth, simulate
from garmentc.simulation.fabrics import FABRICS, Fabric
from garmentc.simulation.native_stderr import native_stderr_closed
from garmentc.simulation.newton_cloth import NewtonCloth
from garmentc.simulation.pins import pin
from garmentc.simulation.simulation_settings import SimulationSettings
from tests.cloth_samples import ball, sheet, slab

needs_newton = pytest.mark.skipif(find_spec("newton") is None, reason="the extra 'simulate' is not installed")

UNSETTLED = SimulationSettings(settle_frames=0)
GRAVITY = 9.81


def drape(frames: int) -> tuple[Cloth, SimulatedCloth]:
    """A sheet that falls on a ball."""
    body, faces = ball(0.1)
    vertices, triangles = sheet(0.3, 0.3, 11, 11)
    cloth = Cloth(vertices + np.array([0, 0.12, 0]), triangles, FABRICS["cotton"])
    return cloth, simulate(cloth, body, np.repeat(body[None], frames, axis=0), faces, UNSETTLED)


def test_c_code_can_be_kept_quiet(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="after"), native_stderr_closed():
        os.write(2, b"a banner")
        raise ValueError("after")
    os.write(2, b"heard again")
    assert capfd.readouterr().err == "heard again"


@needs_newton
def test_warp_says_nothing_of_graphics_cards() -> None:
    code = "from garmentc.simulation.newton_cloth import import_newton; import_newton()[1].init()"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stderr == ""


@needs_newton
def test_a_sheet_stays_on_a_ball():
    cloth, result = drape(14)
    body, faces = ball(0.1)
    distance = signed_distance(result.frames[-1], body, faces)
    assert distance.min() > 0
    assert (distance < 0.006).sum() >= 9, "the sheet lies on the ball"
    assert np.allclose(result.frames[-1].mean(axis=0)[[0, 2]], 0, atol=0.01), "it slides off to no side"
    edge = edges(cloth.triangles)
    strain = edge_lengths(result.frames[-1], edge) / edge_lengths(cloth.vertices, edge)
    assert strain.min() > 0.8
    assert strain.max() < 1.2


@needs_newton
def test_two_runs_are_alike_to_the_byte():
    assert drape(3)[1].frames.tobytes() == drape(3)[1].frames.tobytes()


@needs_newton
@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_cloth_slides_as_fast_as_friction_lets_it(friction: float):
    """Coulomb: a = g (sin - mu cos) on a slope."""
    assert slid(friction, 12) == pytest.approx(coulomb(friction, 12), rel=0.15)


@needs_newton
def test_more_friction_slides_less():
    ways = [slid(friction, 8) for friction in (0.0, 0.2, 0.8)]
    assert ways[0] > 1.2 * ways[1] > 0
    assert ways[2] < 0.1 * ways[0], "steeper than 0.8 it would have to be"


def slid(friction: float, frames: int) -> float:
    """Metres that a patch slides down a slope of 30 degrees."""
    tilt = 30.0
    body, faces = slab(tilt)
    slope = np.radians(tilt)
    down = np.array([np.cos(slope), -np.sin(slope), 0])
    normal = np.array([np.sin(slope), np.cos(slope), 0])
    flat, triangles = sheet(0.1, 0.1, 5, 5)
    fabric = replace(FABRICS["cotton"], friction=friction)
    lift = UNSETTLED.clearance + fabric.thickness / 2
    placed = flat[:, :1] * down + flat[:, 2:] * [0, 0, 1] + lift * normal
    cloth = Cloth(placed, triangles, fabric)
    result = simulate(cloth, body, np.repeat(body[None], frames, axis=0), faces, UNSETTLED)
    return float(((result.frames[-1] - placed) @ down).mean())


def coulomb(friction: float, frames: int) -> float:
    slope = np.radians(30)
    return 0.5 * GRAVITY * (np.sin(slope) - friction * np.cos(slope)) * (frames / 30) ** 2


@needs_newton
def test_a_moving_body_carries_cloth_along():
    body, faces = slab()
    vertices, triangles = sheet(0.1, 0.1, 5, 5)
    fabric = replace(FABRICS["cotton"], friction=1.0)
    cloth = Cloth(vertices + np.array([0, 0.0045, 0]), triangles, fabric)
    way = 0.2 * (np.arange(1, 11) / 10) ** 2
    frames = body + way[:, None, None] * [1, 0, 0]
    result = simulate(cloth, body, frames, faces, UNSETTLED)
    assert (result.frames[-1] - cloth.vertices)[:, 0].mean() == pytest.approx(0.2, abs=0.02)


def hanging(fabric: Fabric, length: float, seconds: float) -> float:
    """Metres that the free end of a strip, clamped level at the other end, comes to hang below the clamp."""
    body, faces = slab()
    columns = 9
    vertices, triangles = sheet(length * columns / (columns - 1), 0.03, columns + 1, 3)
    vertices = vertices + np.array([0, 0.5, 0])
    clamped = np.flatnonzero(vertices[:, 0] < np.sort(np.unique(vertices[:, 0].round(9)))[1] + 1e-6)
    state = NewtonCloth(vertices, triangles, fabric, body, faces, clamped, UNSETTLED)
    for _ in range(round(seconds * 30)):
        state.advance(body, vertices[clamped], damping=0.9)
    end = vertices[:, 0] > vertices[:, 0].max() - 1e-6
    return float(0.5 - state.positions[end, 1].mean())


@needs_newton
def test_a_strip_bends_like_a_beam():
    """A cantilever's free end sinks by w L^4 / 8 B where it sinks little (Euler and Bernoulli).

    The strip bends at the borders of its cells only, the first of which is the clamp: half a cell more hangs freely.
    """
    fabric = Fabric("card", stretch=500, shear=200, bending=1e-3, density=0.2, friction=0.3, thickness=1e-3)
    beam = 0.2 * GRAVITY * 0.085**4 / (8 * 1e-3)
    assert 0.7 * beam < hanging(fabric, 0.08, 0.5) < 1.5 * beam


@needs_newton
def test_heavier_cloth_hangs_straighter():
    light, heavy = (hanging(replace(FABRICS["leather"], density=density), 0.12, 0.5) for density in (0.1, 1.0))
    assert light < 0.9 * heavy < 0.9 * 0.135


@needs_newton
def test_pinned_vertices_follow_the_skin():
    body, faces = ball(0.1)
    vertices, triangles = sheet(0.1, 0.1, 5, 5)
    vertices = vertices + np.array([0, 0.12, 0])
    pins = pin(vertices, np.arange(5), body, faces)
    moved = body + np.linspace(0, 0.1, 6)[1:, None, None] * [0, 1, 0.5]
    result = simulate(Cloth(vertices, triangles, FABRICS["silk"], pins), body, moved, faces, UNSETTLED)
    assert np.allclose(result.frames[-1][:5], vertices[:5] + np.array([0, 0.1, 0.05]), atol=5e-4)


def test_pins_keep_their_distance_to_the_skin():
    body, faces = ball(0.1)
    vertices = np.array([[0.13, 0, 0], [0, 0.101, 0.0], [0, 0, -0.2]])
    pins = pin(vertices, np.array([0, 1]), body, faces, clearance=0.004)
    bigger = signed_distance(pins.positions(2 * body), 2 * body, faces)
    assert np.allclose(bigger, [0.03, 0.004], atol=5e-4)


@needs_newton
def test_an_explosion_is_an_error_that_says_where():
    body, faces = ball(0.1)
    vertices, triangles = sheet(0.1, 0.1, 3, 3)
    gone = np.stack([body, body + np.array([20.0, 0, 0])])
    with pytest.raises(GarmentcError, match=r"exploded in frame 1 of 2: 9 of 9"):
        simulate(Cloth(vertices + np.array([0, 0.2, 0]), triangles, FABRICS["silk"]), body, gone, faces, UNSETTLED)


@needs_newton
def test_settling_comes_to_rest_and_reports_progress():
    body, faces = slab()
    vertices, triangles = sheet(0.1, 0.1, 4, 4)
    done: list[tuple[int, int]] = []
    cloth = Cloth(vertices + np.array([0, 0.02, 0]), triangles, FABRICS["denim"])
    result = simulate(cloth, body, np.repeat(body[None], 3, axis=0), faces, progress=lambda *count: done.append(count))
    assert np.abs(result.template[:, 1] - 0.004 - FABRICS["denim"].thickness / 2).max() < 1e-3
    assert np.abs(result.frames[-1] - result.template).max() < 5e-4
    assert done == [(1, 3), (2, 3), (3, 3)]


def test_triangles_without_area_are_named():
    body, faces = slab()
    cloth = Cloth(np.zeros((3, 3)), np.array([[0, 1, 2]]), FABRICS["silk"])
    with pytest.raises(GarmentcError, match="triangle 0"):
        simulate(cloth, body, body[None], faces)


def test_without_newton_the_error_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "warp", None)
    body, faces = slab()
    vertices, triangles = sheet(0.1, 0.1, 3, 3)
    with pytest.raises(GarmentcError, match="pip install"):
        simulate(Cloth(vertices, triangles, FABRICS["silk"]), body, body[None], faces)


def test_fabrics_differ_as_fabrics_do():
    silk, cotton, denim, leather = (FABRICS[name] for name in ("silk", "cotton", "denim", "leather"))
    for lighter, heavier in ((silk, cotton), (cotton, denim), (denim, leather)):
        assert lighter.density < heavier.density
        assert lighter.bending < heavier.bending
    assert min(FABRICS.values(), key=lambda fabric: fabric.friction) is silk
