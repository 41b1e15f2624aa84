"""Fabrics hang and slide as their numbers say: Cusick's drape test, and Coulomb's law on slopes and moving bodies."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from garmentc.errors import GarmentcError
from garmentc.simulation.fabrics import FABRICS, find_fabric
from tests.simulation.fabric_measures import GRAVITY, coulomb, disc, drape_coefficient, left_behind, measure_hang, slid

needs_newton = pytest.mark.skipif(find_spec("newton") is None, reason="the extra 'simulate' is not installed")


@needs_newton
def test_stiffer_fabrics_drape_less():
    """Drape coefficients in the order of the fabrics' bending lengths, (bending / weight)^(1/3)."""
    order = ("silk", "denim", "leather")
    lengths = [FABRICS[name].bending / FABRICS[name].density for name in order]
    drapes = [drape_coefficient(FABRICS[name], rings=8, frames=60) for name in order]
    assert lengths == sorted(lengths)
    assert 0.2 < drapes[0] < drapes[1] - 0.05 < drapes[2] - 0.1 < 0.95


@needs_newton
def test_of_two_alike_fabrics_the_heavier_one_hangs_straighter():
    light, heavy = (drape_coefficient(replace(FABRICS["denim"], density=d), rings=8, frames=60) for d in (0.1, 1.0))
    assert heavy < light - 0.1


@needs_newton
@pytest.mark.parametrize(("tilt", "friction"), [(10.0, 0.25), (20.0, 0.45)])
def test_cloth_sticks_on_slopes_less_steep_than_its_friction(tilt: float, friction: float):
    assert np.tan(np.radians(tilt)) < friction
    assert coulomb(friction, tilt, 12) == 0
    assert abs(slid(friction, tilt, 12)) < 0.003


@needs_newton
def test_cloth_slides_on_steeper_ones():
    assert slid(0.25, 20.0, 12) == pytest.approx(coulomb(0.25, 20.0, 12), rel=0.1)


@needs_newton
def test_a_body_that_speeds_up_leaves_cloth_behind_as_friction_lets_it():
    """Sticks where the acceleration is less than friction x g; else it lags by (a - friction g) t^2 / 2."""
    assert abs(left_behind(0.6, 4.0, 10)) < 0.01
    slipped = 0.5 * (4.0 - 0.1 * GRAVITY) * (10 / 30) ** 2
    assert left_behind(0.1, 4.0, 10) == pytest.approx(slipped, rel=0.15)


def test_measures_of_a_cone_are_those_of_a_cone():
    """The specimen of the drape test, pulled down to a cone with eight waves of 5 mm at its rim."""
    flat, triangles = disc(0.15, 12)
    angle, radius = np.arctan2(flat[:, 2], flat[:, 0]), np.hypot(flat[:, 0], flat[:, 2])
    waved = radius + 0.005 * np.sqrt(2) * np.cos(8 * angle) * radius / 0.15
    cone = np.stack([waved * np.cos(angle), -radius, waved * np.sin(angle)], axis=1)
    measured = measure_hang(cone, triangles)
    assert measured.spread == pytest.approx(150, abs=1)
    assert measured.folds == pytest.approx(5, rel=0.05)
    assert measure_hang(flat, triangles).bend == pytest.approx(0, abs=1e-9)


def test_unknown_fabric():
    with pytest.raises(GarmentcError, match="unknown fabric 'wool'; use one of cotton, silk, denim, leather"):
        find_fabric("wool")
