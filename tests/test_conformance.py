"""The conformance suite's own arithmetic, and that its page is about the engines that are installed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from conformance.engines import BLENDER, FILAMENT, MEASURED, Cell
from conformance.report import shown
from conformance.silhouette import View, pixels_apart, silhouette, view_of
from engine_runs import ENGINES

PAGE = Path(__file__).parents[1] / "docs" / "engines.md"
SQUARE = np.array([[-0.5, 1, 0], [0.5, 1, 0], [0.5, 2, 0], [-0.5, 2, 0]], dtype=float)
TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])


def test_a_silhouette_is_where_the_camera_sees_it() -> None:
    view = View(position=(0, 1.5, 4), target=(0, 1.5, 0), fov=30, width=200, height=300)
    covered = silhouette(SQUARE, TRIANGLES, view)
    side = 1000 / view.millimetres_per_pixel
    assert side == pytest.approx(300 / (2 * 4 * np.tan(np.radians(15))))
    assert covered.sum() == pytest.approx(side**2, rel=0.02)
    rows, columns = np.nonzero(covered)
    assert (rows.mean(), columns.mean()) == pytest.approx((149.5, 99.5), abs=0.5)
    raised = silhouette(SQUARE + np.array([0.1, 0.2, 0]), TRIANGLES, view)
    rows, columns = np.nonzero(raised)
    assert (rows.mean(), columns.mean()) == pytest.approx((149.5 - 0.2 * side, 99.5 + 0.1 * side), abs=0.5)


def test_a_view_shows_all_points() -> None:
    points = np.random.default_rng(0).normal(size=(100, 3)) * (0.2, 1, 0.3) + (3, 1, -2)
    view = view_of(points, angle=0.7, width=200, height=300)
    pixels = view.project(points)
    assert (pixels >= 0).all()
    assert (pixels <= (200, 300)).all()


def test_outlines_are_as_far_apart_as_they_were_moved() -> None:
    square = np.zeros((60, 60), dtype=bool)
    square[20:40, 20:40] = True
    assert pixels_apart(square, square) == 0
    assert pixels_apart(np.roll(square, 5, axis=1), square) == 5
    assert pixels_apart(np.zeros_like(square), square) == np.inf


def test_a_cell_says_what_is_wrong() -> None:
    good, bad = Cell(1.5e-6, 2e-6), Cell(2.5e-6, 2e-6)
    assert (good.good, shown(good, "µm")) == (True, "1.5")
    assert (bad.good, shown(bad, "µm")) == (False, "**2.5**")
    known, unknown = Cell(None, 2e-6, "no meshopt"), Cell(None, 2e-6, "crashed", known=False)
    assert (known.good, shown(known, "µm")) == (True, "no meshopt")
    assert (unknown.good, shown(unknown, "µm")) == (False, "crashed")


def test_the_page_is_about_these_versions() -> None:
    """After another version of an engine, `make conformance` is due."""
    pinned = json.loads((ENGINES / "package.json").read_text())["dependencies"]
    required = (ENGINES / "requirements.txt").read_text()
    page = PAGE.read_text()
    for engine in (*MEASURED, FILAMENT):
        if not engine.in_python:
            assert f"{engine.package} {pinned[engine.package]} " in page
    assert f"gltf-validator {pinned['gltf-validator']} " in page
    for engine in (BLENDER, FILAMENT):
        measured = page.split(f"| {engine.package} ")[1].split()[0]
        assert f"{engine.package}=={measured}" in required
