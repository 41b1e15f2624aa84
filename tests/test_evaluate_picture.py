"""The rasteriser against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from garmentc.evaluation.evaluation_picture import FULL_SCALE, heat
from garmentc.evaluation.raster import Camera, Surface, render

FRONT = Camera(np.eye(3), np.zeros(3), 2.0, (90, 60))


def quad(depth: float, side: float, color: tuple[float, float, float], middle: float = 0.0) -> Surface:
    corners = side / 2 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    return Surface(corners + np.array([middle, 0, depth]), np.array([[0, 1, 2], [0, 2, 3]]), np.array(color))


def drawn(picture: np.ndarray) -> np.ndarray:
    """How much of each pixel is covered: surfaces here are black."""
    return 1 - picture[..., 0] / 255


@pytest.mark.parametrize("subdivisions", [1, 5])
def test_a_ball_covers_its_disc(subdivisions: int) -> None:
    """Small triangles and large ones alike; the silhouette of few facets is a little smaller than the disc."""
    ball = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.8)
    covered = drawn(render([Surface(ball.vertices, ball.faces, np.zeros(3))], FRONT))
    assert covered.sum() == pytest.approx(np.pi * (0.8 * 30) ** 2, rel=0.12 if subdivisions == 1 else 0.005)
    row, column = np.indices(covered.shape)
    assert (row * covered).sum() / covered.sum() == pytest.approx(29.5, abs=0.1)
    assert (column * covered).sum() / covered.sum() == pytest.approx(44.5, abs=0.1)


def test_a_sheet_has_no_seam_and_exact_edges() -> None:
    covered = drawn(render([quad(0.0, 1.0, (0, 0, 0))], FRONT))
    expected = np.zeros((60, 90))
    expected[15:45, 30:60] = 1
    np.testing.assert_array_equal(covered, expected)


@pytest.mark.parametrize("order", [1, -1])
def test_what_is_nearer_hides_what_is_behind(order: int) -> None:
    picture = render([quad(0.5, 0.4, (1, 0, 0)), quad(-0.5, 1.0, (0, 0, 1))][::order], FRONT)
    assert picture[30, 45].argmax() == 0
    assert picture[18, 45].argmax() == 2
    assert picture[5, 5].tolist() == [255, 255, 255]


def test_what_leaves_the_picture_is_cut_off() -> None:
    covered = drawn(render([quad(0.0, 1.0, (0, 0, 0), middle=1.5), quad(0.0, 1.0, (0, 0, 0), middle=9)], FRONT))
    assert covered[15:45, 75:].min() == 1
    assert covered.sum() == 30 * 15


def test_colors_run_from_corner_to_corner() -> None:
    sheet = quad(0.0, 1.0, (0, 0, 0))
    shades = Surface(sheet.vertices, sheet.triangles, np.array([[0.0] * 3, [1.0] * 3, [1.0] * 3, [0.0] * 3]))
    row = render([shades], FRONT)[30, 30:60, 0].astype(float)
    assert (np.diff(row) > 0).all()
    np.testing.assert_allclose(np.diff(row), np.diff(row).mean(), atol=1.01)


def test_up_is_up_and_turned_cameras_turn() -> None:
    above = Surface(quad(0, 0.4, (0, 0, 0)).vertices + np.array([0, 0.5, 0]), np.array([[0, 1, 2]]), np.zeros(3))
    covered = drawn(render([above], FRONT))
    assert covered[:30].sum() > 0 == covered[30:].sum()
    sideways = Camera(np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]), np.zeros(3), 2.0, (90, 60))
    assert drawn(render([above], sideways)).sum() == 0, "a sheet seen from its edge"


def test_heat_is_monotonous_and_ends_at_full_scale() -> None:
    colors = heat(np.array([0.0, FULL_SCALE / 2, FULL_SCALE, 10 * FULL_SCALE]))
    assert colors[0, 2] > colors[0, 0], "none is blue"
    assert colors[2, 0] > colors[2, 2], "all is red"
    np.testing.assert_array_equal(colors[2], colors[3])
