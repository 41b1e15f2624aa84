"""Simulated cloth against closed forms: free fall, a strip that hangs, Coulomb's law, skin that moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from garmentc.outfit.topology import edges
from garmentc.passes.cloth_dynamics import ClothDynamics, MovingCloth, SkinPath, advanced
from garmentc.passes.overlaps import NO_OVERLAPS, Overlaps
from garmentc.passes.springs import Springs

G = 9.81
UNDAMPED = ClothDynamics(damping=1e9, smoothing=0)


def sheet(rows: int, columns: int, edge: float = 0.025) -> tuple[np.ndarray, Springs]:
    """Equilateral triangles that hang down from the origin: vertices (n, 3), and springs along their edges."""
    k, i = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    x, y = (i + 0.5 * (k % 2)) * edge, -k * edge * np.sqrt(3) / 2
    vertices = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    triangles = []
    for row in range(rows - 1):
        for column in range(columns - 1):
            a = row * columns + column
            b, c, d = a + 1, a + columns, a + columns + 1
            triangles += [[a, b, c], [b, d, c]] if row % 2 == 0 else [[a, b, d], [a, d, c]]
    return vertices, Springs.of(vertices, edges(np.array(triangles, np.int32)))


def at(vertices: np.ndarray, step: np.ndarray | float = 0.0) -> MovingCloth:
    place = np.float32(vertices.T[:, :, None])
    return MovingCloth(place, np.zeros_like(place) + np.float32(step))


def nowhere(count: int) -> SkinPath:
    nothing = np.zeros((3, count, 1), np.float32)
    return SkinPath(nothing, nothing[0], nothing[0], nothing)


def plane(normal: np.ndarray, count: int, offset: float = 0.0, moved: np.ndarray | None = None) -> SkinPath:
    """A plane `offset` metres along its normal, that moves by `moved` (3,)."""
    normals = np.repeat(np.float32(normal)[:, None, None], count, axis=1)
    least = np.full((count, 1), offset, np.float32)
    moved = np.zeros(3) if moved is None else moved
    slid = np.repeat(np.float32(moved)[:, None, None], count, axis=1)
    return SkinPath(normals, least, least + np.float32(normal @ moved), slid)


def run(
    cloth: MovingCloth,
    springs: Springs,
    skin: SkinPath,
    seconds: float,
    dynamics: ClothDynamics = UNDAMPED,
    held: np.ndarray | None = None,
    borne: bool = True,
) -> MovingCloth:
    count = cloth.vertices.shape[1]
    firmness = np.zeros(count, np.float32) if held is None else np.float32(held)
    hold = firmness, cloth.vertices, cloth.vertices
    rounds = dynamics.rounds(springs, seconds)
    return advanced(cloth, springs, NO_OVERLAPS, skin, hold, np.full((count, 1), borne), dynamics, seconds, rounds)


def test_what_nothing_stops_falls_freely() -> None:
    vertices, springs = sheet(6, 5)
    fallen = run(at(vertices), springs, nowhere(len(vertices)), 0.2).vertices[:, :, 0].T
    way = vertices - fallen
    np.testing.assert_allclose(way[:, 1], G * 0.2**2 / 2, rtol=0.01)
    np.testing.assert_allclose(way[:, [0, 2]], 0, atol=1e-5)


def test_what_nothing_bears_stays() -> None:
    vertices, springs = sheet(6, 5)
    fallen = run(at(vertices), springs, nowhere(len(vertices)), 0.2, borne=False)
    np.testing.assert_allclose(fallen.vertices[:, :, 0].T, vertices, atol=1e-6)


@pytest.mark.parametrize("edge", [0.02, 0.04])
@pytest.mark.parametrize("speed", [10.0, 20.0])
def test_a_strip_hangs_as_much_longer_as_its_stiffness_says(edge: float, speed: float) -> None:
    """g L^2 / 2 c^2, whatever the mesh: the tension at a height bears all that is below."""
    length = 0.8
    vertices, springs = sheet(1 + round(length / (edge * np.sqrt(3) / 2)), 4, edge)
    top = vertices[:, 1] == 0
    dynamics = ClothDynamics(wave_speed=speed, damping=0.05, smoothing=0)
    hung = run(at(vertices), springs, nowhere(len(vertices)), 3.0, dynamics, held=top.astype(float))
    lowest = vertices[:, 1] == vertices[:, 1].min()
    longer = float((vertices[lowest, 1] - hung.vertices[1, lowest, 0]).mean())
    expected = G * np.ptp(vertices[:, 1]) ** 2 / (2 * speed**2)
    # A strip four vertices wide has half edges: it is a little softer than the middle of a sheet.
    assert 0.8 * expected < longer < 1.5 * expected


@pytest.mark.parametrize(("slope", "friction"), [(20.0, 0.5), (20.0, 0.2), (35.0, 0.4), (60.0, 0.6)])
def test_cloth_on_a_slope_sticks_or_slides_as_coulomb_says(slope: float, friction: float) -> None:
    angle = np.radians(slope)
    normal, down = np.array([0, np.cos(angle), np.sin(angle)]), np.array([0, -np.sin(angle), np.cos(angle)])
    vertices, springs = sheet(6, 5)
    lying = vertices[:, [0]] * np.array([1.0, 0, 0]) + vertices[:, [1]] * down
    dynamics = replace(UNDAMPED, friction=friction)
    slid = run(at(lying), springs, plane(normal, len(lying)), 0.3, dynamics).vertices[:, :, 0].T - lying
    expected = max(0.0, G * (np.sin(angle) - friction * np.cos(angle)) * 0.3**2 / 2)
    np.testing.assert_allclose(slid @ down, expected, atol=0.002 + 0.05 * expected)
    np.testing.assert_allclose(slid @ normal, 0, atol=1e-4)


def test_skin_drags_cloth_along() -> None:
    """Faster and faster from rest, by less than friction bears."""
    vertices, springs = sheet(6, 5)
    flat = vertices[:, [0, 2, 1]]
    up, cloth, moved = np.array([0.0, 1, 0]), at(vertices[:, [0, 2, 1]]), np.zeros(3)
    for frame in range(10):
        ahead = np.array([3e-4 * (frame + 0.5), 0, 0])
        cloth = run(cloth, springs, plane(up, len(flat), moved=ahead), 1 / 30)
        moved = moved + ahead
    way = cloth.vertices[:, :, 0].T - flat
    np.testing.assert_allclose(way[:, 0], moved[0], atol=1e-3)


def test_skin_pushes_but_does_not_throw() -> None:
    vertices, springs = sheet(6, 5)
    flat = vertices[:, [0, 2, 1]]
    up = np.array([0.0, 1, 0])
    pressed = run(at(flat), springs, plane(up, len(flat), offset=0.01), 1 / 30)
    assert pressed.vertices[1].min() > 0.0099
    freed = run(pressed, springs, nowhere(len(flat)), 1 / 30, borne=False)
    np.testing.assert_allclose(freed.vertices[1], 0.01, atol=2e-4)


def test_skin_that_moves_takes_what_it_holds() -> None:
    vertices, springs = sheet(6, 5)
    cloth, count = at(vertices), len(vertices)
    end = cloth.vertices + np.float32([[[0.1]], [[0]], [[0]]])
    hold = np.ones(count, np.float32), cloth.vertices, end
    moved = advanced(cloth, springs, NO_OVERLAPS, nowhere(count), hold, np.ones((count, 1), bool), UNDAMPED, 1 / 30, 60)
    np.testing.assert_allclose(moved.vertices, end, atol=1e-5)


def test_poses_do_not_depend_on_each_other() -> None:
    vertices, springs = sheet(6, 5)
    alone = run(at(vertices), springs, plane(np.array([0.0, 1, 0]), len(vertices), -0.05), 0.1)
    both = at(vertices)
    both = MovingCloth(*(np.concatenate([a, a + np.float32(1)], axis=2) for a in (both.vertices, both.step)))
    one = plane(np.array([0.0, 1, 0]), len(vertices), -0.05)
    skin = SkinPath(*(np.concatenate([a, a], axis=-1) for a in (one.normals, one.before, one.after, one.slid)))
    hold = np.zeros(len(vertices), np.float32), both.vertices, both.vertices
    rounds = UNDAMPED.rounds(springs, 0.1)
    moved = advanced(both, springs, NO_OVERLAPS, skin, hold, np.ones((len(vertices), 2), bool), UNDAMPED, 0.1, rounds)
    np.testing.assert_allclose(moved.vertices[:, :, :1], alone.vertices, atol=1e-6)


def test_short_edges_take_more_rounds_up_to_the_most() -> None:
    dynamics = ClothDynamics()
    coarse, fine, finest = (sheet(4, 4, edge)[1] for edge in (0.08, 0.04, 0.001))
    assert dynamics.rounds(fine, 1) == pytest.approx(2 * dynamics.rounds(coarse, 1), abs=1)
    assert dynamics.rounds(finest, 1) == dynamics.most
    assert dynamics.rounds(coarse, 1e-6) == 1


def test_a_sheet_stays_above_what_it_lies_over() -> None:
    """A plane presses the lower sheet up through the upper one, at rest two millimetres higher."""
    vertices, springs = sheet(6, 5)
    flat = vertices[:, [0, 2, 1]]
    count, up = len(flat), np.array([0.0, 1, 0])
    both = np.concatenate([flat, flat + 0.002 * up])
    pair = Springs.of(both, np.concatenate([springs.pairs, springs.pairs + count]))
    over = Overlaps(np.arange(count, 2 * count), np.arange(count), np.full(count, 0.002, np.float32))
    skin = plane(up, 2 * count, offset=0.01)
    for overlaps, apart in ((over, 0.002), (NO_OVERLAPS, 0.0)):
        hold = np.zeros(2 * count, np.float32), at(both).vertices, at(both).vertices
        borne = np.ones((2 * count, 1), bool)
        end = advanced(at(both), pair, overlaps, skin, hold, borne, UNDAMPED, 1 / 30, 60).vertices[1, :, 0]
        np.testing.assert_allclose(end[count:] - end[:count], apart, atol=3e-4)
