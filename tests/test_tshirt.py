"""The T-shirt of one topology: outside every body, never through itself, and its styles do what they say."""

from __future__ import annotations

from dataclasses import replace

import igl
import numpy as np
import pytest

from garmentc.simulation.outfits import GeneratedOutfit
from garmentc.simulation.self_crossings import self_crossings
from garmentc.simulation.tshirt import BODIES, TshirtStyle, fit_tshirt, tshirt_parameters, tshirt_style
from garmentc.smpl.default_body import load_default_body

PLAIN = TshirtStyle((0.0, 0.0))


def _fit(style: TshirtStyle) -> GeneratedOutfit:
    return fit_tshirt(style, tshirt_parameters(0, style))


@pytest.fixture(scope="module")
def plain() -> GeneratedOutfit:
    return _fit(PLAIN)


def _clearance(shirt: GeneratedOutfit, points: np.ndarray) -> np.ndarray:
    body = load_default_body("female")
    rest = body.shaped(np.asarray(shirt.parameters.betas))
    faces = body.faces.astype(np.int64)
    return np.asarray(igl.signed_distance(np.ascontiguousarray(points), rest, faces)[0])


@pytest.mark.parametrize("index", [0, 8, 2 + BODIES, 6 + 2 * BODIES, 44])
def test_a_shirt_fits_its_body(plain: GeneratedOutfit, index: int) -> None:
    shirt = _fit(tshirt_style(0, index))
    np.testing.assert_array_equal(shirt.triangles, plain.triangles)
    assert 2700 < len(shirt.vertices) < 3300
    assert _clearance(shirt, shirt.vertices).min() > 0.0014
    assert _clearance(shirt, shirt.vertices[shirt.triangles].mean(axis=1)).min() > 0
    assert len(self_crossings(shirt.vertices, shirt.triangles)) == 0


def test_bodies_and_styles_are_all_different() -> None:
    styles = [tshirt_style(7, index) for index in range(45)]
    assert len(set(styles)) == 45
    assert len({style.betas for style in styles}) == BODIES
    assert styles == [tshirt_style(7, index) for index in range(45)]
    assert len({(style.sleeve, style.length, style.ease) for style in styles}) == 5


def test_styles_do_what_they_say(plain: GeneratedOutfit) -> None:
    def span(shirt: GeneratedOutfit) -> float:
        return float(np.ptp(shirt.vertices[:, 0]))

    def hem(shirt: GeneratedOutfit) -> float:
        return float(shirt.vertices[:, 1].min())

    longer_sleeves, longer, looser = (
        _fit(replace(PLAIN, **{field: value})) for field, value in (("sleeve", 0.5), ("length", 0.2), ("ease", 0.02))
    )
    assert span(longer_sleeves) > span(plain) + 0.05
    assert hem(longer_sleeves) == pytest.approx(hem(plain), abs=0.005)
    assert hem(longer) < hem(plain) - 0.04
    assert span(longer) == pytest.approx(span(plain), abs=0.005)
    gained = _clearance(looser, looser.vertices) - _clearance(plain, plain.vertices)
    assert np.median(gained) > 0.01
