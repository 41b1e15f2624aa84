"""Alignment: files in known units, axes and places, cut from the body itself, must be found out."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from align_samples import CAP, GAP, SHIRT, SHOES, SUIT, cut, outfit_of

from garmentc.errors import GarmentcError
from garmentc.outfit.align import AlignOptions, align
from garmentc.outfit.align.axes import AXES, Axes
from garmentc.outfit.align.choose import choose_gender
from garmentc.outfit.align.fit import misfit, sample_cloth
from garmentc.outfit.align.skin import Skin
from garmentc.outfit.obj import read_obj
from garmentc.smpl import BodyModel, load_default_body
from garmentc.smpl.nearest import signed_distance

PER_METRE = {"m": 1, "dm": 10, "cm": 100, "mm": 1000, "in": 1 / 0.0254, "ft": 1 / 0.3048}
FLOOR = {gender: load_default_body(gender).v_template[:, 1].min() for gender in ("female", "male", "neutral")}


def vector(axis: str) -> np.ndarray:
    return np.array([axis.endswith(letter) for letter in "xyz"]) * (-1.0 if axis.startswith("-") else 1.0)


def in_file(vertices: np.ndarray, unit: str, up: str, front: str, origin: np.ndarray) -> np.ndarray:
    """Body coordinates as a file has them whose origin is at the point `origin` of the body."""
    left = np.cross(vector(up), vector(front))
    return (vertices - origin) * PER_METRE[unit] @ np.stack([left, vector(up), vector(front)])


def codes(warnings: tuple) -> set[str]:
    return {warning.code for warning in warnings}


@pytest.mark.parametrize("gender", ["female", "male", "neutral"])
@pytest.mark.parametrize("parts", [SUIT, SHIRT, SHOES, CAP], ids=["suit", "shirt", "shoes", "cap"])
def test_a_file_that_is_as_the_body_is_keeps_its_vertices(gender: str, parts: tuple[str, ...]) -> None:
    outfit, _ = cut(load_default_body(gender), parts)
    found = align(outfit, load_default_body)
    assert found.outfit.vertices is outfit.vertices
    assert found.outfit.normals is outfit.normals
    np.testing.assert_array_equal(found.to_body, np.eye(4))
    assert (found.gender, found.rest_pose, found.arms, found.unpose_weights) == (gender, "T", 0.0, None)
    assert not found.pose.any()
    if parts in (SUIT, SHIRT):  # ears and toes are too close together to be moved outward without harm
        assert found.warnings == ()
        assert found.fit.inside == 0
    assert found.fit.median_gap == pytest.approx(GAP, abs=5e-4)


@pytest.mark.parametrize(
    ("unit", "up", "front", "origin", "parts"),
    [
        ("cm", "y", "z", "floor", SUIT),
        ("cm", "z", "-y", "floor", SUIT),
        ("mm", "z", "-y", "body", SHIRT),
        ("in", "y", "z", "floor", SHIRT),
        ("ft", "z", "y", "body", SUIT),
        ("dm", "y", "-z", "body", SUIT),
        ("m", "y", "x", "floor", SUIT),
        ("m", "x", "z", "body", SUIT),
        ("cm", "-z", "-y", "body", SHIRT),
        ("cm", "z", "-y", "floor", SHOES),
        ("cm", "y", "z", "floor", CAP),
    ],
)
def test_units_axes_and_origin_are_found(unit: str, up: str, front: str, origin: str, parts: tuple[str, ...]) -> None:
    outfit, _ = cut(load_default_body("female"), parts)
    place = np.array([0, FLOOR["female"], 0]) if origin == "floor" else np.zeros(3)
    file = replace(outfit, vertices=in_file(outfit.vertices, unit, up, front, place))
    found = align(file, load_default_body)
    assert (found.frame.unit, found.frame.up, found.frame.front, found.frame.origin) == (unit, up, front, origin)
    assert (found.gender, found.rest_pose) == ("female", "T")
    np.testing.assert_allclose(found.outfit.vertices, outfit.vertices, atol=1e-12)
    homogeneous = np.column_stack([file.vertices, np.ones(len(file.vertices))])
    np.testing.assert_allclose(homogeneous @ found.to_body[:3].T, outfit.vertices, atol=1e-12)
    np.testing.assert_array_equal(found.outfit.normals, file.normals @ found.frame.rotation.T)


def test_unit_conversion_is_one_division() -> None:
    outfit, _ = cut(load_default_body("male"), SUIT)
    centimetres = np.round(outfit.vertices * 100, 4)  # what an exporter prints
    found = align(replace(outfit, vertices=centimetres), load_default_body)
    np.testing.assert_array_equal(found.outfit.vertices, centimetres / 100)


def test_every_axis_pair_is_a_rotation() -> None:
    for up in AXES:
        for front in AXES:
            if up[-1] != front[-1]:
                axes = Axes("m", up, front)
                assert np.linalg.det(axes.rotation) == pytest.approx(1)
                np.testing.assert_array_equal(axes.rotated(np.stack([vector(up), vector(front)])), np.eye(3)[[1, 2]])


def test_an_unknown_origin_is_fitted() -> None:
    outfit, _ = cut(load_default_body("male"), SUIT)
    place = np.array([0.01, 0.4, -0.07])
    found = align(replace(outfit, vertices=in_file(outfit.vertices, "cm", "z", "-y", place)), load_default_body)
    assert (found.frame.unit, found.frame.up, found.frame.origin, found.gender) == ("cm", "z", "fitted", "male")
    np.testing.assert_allclose(found.frame.translation, place, atol=2e-3)
    assert found.rest_pose == "T"


def test_shoes_with_soles_do_not_stand_in_the_floor() -> None:
    outfit, _ = cut(load_default_body("female"), (*SUIT, *SHOES))
    place = np.array([0, FLOOR["female"] - 0.03, 0])
    found = align(replace(outfit, vertices=in_file(outfit.vertices, "cm", "y", "z", place)), load_default_body)
    np.testing.assert_allclose(found.frame.translation, place, atol=3e-3)


def other_body() -> BodyModel:
    """A shorter body whose model has its origin at the neck and in front."""
    body = load_default_body("male")
    moved = np.array([0, -0.5, -0.1])
    return replace(body, v_template=0.85 * body.v_template + moved, J_template=0.85 * body.J_template + moved)


@pytest.mark.parametrize("origin", ["body", "pelvis", "floor"])
def test_origins_are_those_of_the_given_body(origin: str) -> None:
    body = other_body()
    outfit, _ = cut(body, SUIT)
    floor = np.array([0, body.v_template[:, 1].min(), 0])
    place = {"body": np.zeros(3), "pelvis": body.J_template[0], "floor": floor}[origin]
    found = align(replace(outfit, vertices=in_file(outfit.vertices, "cm", "y", "z", place)), {"male": body})
    assert found.frame.origin == origin
    np.testing.assert_allclose(found.outfit.vertices, outfit.vertices, atol=1e-12)


def test_shape_coefficients_are_those_given() -> None:
    betas = np.array([2.0, -1.0])
    outfit, _ = cut(load_default_body("female"), SUIT, betas=betas)
    found = align(outfit, load_default_body, AlignOptions(betas=betas))
    assert (found.gender, found.outfit.vertices is outfit.vertices) == ("female", True)
    assert found.betas is betas
    assert found.misfits["female"] < 0.6 * min(found.misfits["male"], found.misfits["neutral"])


def test_what_is_said_is_not_doubted() -> None:
    outfit, _ = cut(load_default_body("female"), SUIT)
    said = AlignOptions(units="cm", up="z", front="x", pose="t", gender="male", origin="keep")
    found = align(outfit, load_default_body, said)
    assert (found.frame.unit, found.frame.up, found.frame.front) == ("cm", "z", "x")
    assert (found.gender, found.rest_pose, found.frame.origin) == ("male", "T", "body")
    left = np.cross(vector("z"), vector("x"))
    expected = outfit.vertices / 100 @ np.stack([left, vector("z"), vector("x")]).T
    np.testing.assert_allclose(found.outfit.vertices, expected, atol=1e-15)
    assert "outfit-does-not-fit" in codes(found.warnings)


def test_vertices_inside_the_body_are_counted_and_measured() -> None:
    outfit, _ = cut(load_default_body("female"), ("spine1", "spine2", "spine3"))
    sunk = np.arange(len(outfit.vertices)) % 10 == 0
    vertices = outfit.vertices - (GAP + 0.004) * outfit.normals * sunk[:, None]
    found = align(replace(outfit, vertices=vertices), load_default_body)
    assert found.outfit.vertices is vertices
    assert found.fit.inside == pytest.approx(sunk.mean(), abs=0.01)
    assert found.fit.depth == pytest.approx(0.004, abs=2e-4)
    (warning,) = found.warnings
    assert warning.code == "outfit-inside-body"
    assert f"{found.fit.inside:.1%} of the vertices are inside the body by up to 4.0 mm" in str(warning)


def test_a_size_that_no_unit_explains_is_reported() -> None:
    outfit, _ = cut(load_default_body("female"), SUIT)
    found = align(replace(outfit, vertices=outfit.vertices * 1e7), load_default_body)
    assert {"units-unknown", "outfit-does-not-fit"} <= codes(found.warnings)
    assert found.frame.unit == "m"


def test_an_egg_is_ambiguous() -> None:
    """A thing without features, far from the body: some frame is taken, and doubted."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.13)
    found = align(outfit_of(ball.vertices + np.array([0, 40, 0]), ball.faces), load_default_body)
    assert "frame-ambiguous" in codes(found.warnings)
    assert found.frame.origin == "fitted"


def test_neutral_where_genders_fit_alike() -> None:
    assert choose_gender({"female": 1.0, "male": 2.0, "neutral": 1.04})[0] == "neutral"
    gender, warnings = choose_gender({"female": 1.0, "male": 2.0, "neutral": 1.1})
    assert (gender, codes(warnings)) == ("female", {"gender-ambiguous"})
    assert choose_gender({"female": 1.0, "male": 2.0, "neutral": 1.5}) == ("female", ())


@pytest.mark.parametrize(
    "options",
    [
        {"units": "yd"},
        {"up": "w"},
        {"up": "y", "front": "-y"},
        {"pose": "x"},
        {"pose": np.zeros((3, 3))},
        {"pose": np.full((24, 3), np.nan)},
        {"gender": "other"},
        {"origin": "moon"},
    ],
)
def test_options_that_mean_nothing_are_refused(options: dict) -> None:
    with pytest.raises(GarmentcError, match=r"choose|give"):
        AlignOptions(**options)


def test_outfits_without_surface_and_missing_bodies_are_refused() -> None:
    outfit, _ = cut(load_default_body("female"), SHIRT)
    with pytest.raises(GarmentcError, match="no faces"):
        align(outfit_of(outfit.vertices, np.zeros((0, 3))), load_default_body)
    with pytest.raises(GarmentcError, match="no area"):
        align(replace(outfit, vertices=np.ones_like(outfit.vertices)), load_default_body)
    with pytest.raises(GarmentcError, match="no male body; choose female"):
        align(outfit, {"female": load_default_body("female")}, AlignOptions(gender="male"))


def test_sample_is_even_in_area() -> None:
    vertices = np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 5], [1, 0, 5], [0, 2, 5]], dtype=float)
    sample = sample_cloth(vertices, np.array([[0, 1, 2], [3, 4, 5]], dtype=np.int32), 400)
    assert (sample.points[:, 2] == 0).sum() == 300  # three quarters of the area
    np.testing.assert_allclose(sample.points[:300].mean(axis=0), [1, 2 / 3, 0], atol=0.02)
    np.testing.assert_allclose(sample.normals, [[0, 0, 1]] * 400)


def test_skin_measures_as_the_exact_distance_does() -> None:
    body = load_default_body("neutral")
    surface = Skin.of(body.v_template, body.faces, body.J_template)
    rng = np.random.default_rng(0)
    points = body.v_template[rng.integers(0, len(body.v_template), 2000)] + rng.normal(scale=0.03, size=(2000, 3))
    exact = signed_distance(points, body.v_template, body.faces)
    assert np.percentile(np.abs(surface.distance(points) - exact), 99) < 0.004
    assert misfit(np.full(7, 0.02)) == pytest.approx(0.02)
    assert misfit(np.array([0.01, -0.01])) > misfit(np.array([0.01, 0.02]))


GARMENTS = (
    "fedora", "female_casualsuit01", "female_casualsuit01_apose_dm", "female_casualsuit01_penetrating",
    "female_casualsuit01_unwelded", "female_casualsuit01_zup", "female_sportsuit01", "female_sportsuit01_nouv",
    "male_casualsuit01", "male_casualsuit04", "male_casualsuit04_cm_floor", "male_casualsuit04_ngon_negative_crlf",
    "male_casualsuit04_triangulated", "male_casualsuit04_zup_cm_floor", "male_outfit_casualsuit04_shoes01_fedora",
    "male_worksuit01", "shoes01",
)  # fmt: skip


@pytest.mark.parametrize("name", GARMENTS)
def test_makehuman_garments_are_recognised(shared: Path, name: str) -> None:
    folder = shared / "data" / "garments" / "makehuman"
    truth = json.loads((folder / "metadata.json").read_text())["files"][f"{name}.obj"]
    outfit = read_obj(folder / f"{name}.obj")
    found = align(outfit, load_default_body)
    unit = {"metre": "m", "decimetre": "dm", "centimetre": "cm"}[truth["unit"]]
    assert (found.frame.unit, found.frame.up.upper()) == (unit, truth["up_axis"])
    assert (found.gender, found.rest_pose) == (truth["body"], truth["pose"])
    # MakeHuman's own origin is no known one and is fitted; all others are exact.
    np.testing.assert_allclose(found.to_body, truth["to_reference"], atol=3e-3 if truth["pose"] == "A" else 1e-7)
    if truth["unit"] == "metre" and truth["up_axis"] == "Y":
        assert found.outfit.vertices is outfit.vertices
    if name == "female_casualsuit01_penetrating":
        assert found.fit.inside == pytest.approx(truth["inside_pct"] / 100, abs=2e-3)
    if truth["pose"] == "A":
        assert found.arms == pytest.approx(47.1, abs=3)
        straight = read_obj(folder / "female_casualsuit01.obj").vertices
        error = np.linalg.norm(found.outfit.vertices - straight, axis=1)
        assert error.mean() < 0.008
        assert np.percentile(error, 95) < 0.025
        assert found.fit.inside < 0.04


@pytest.mark.parametrize("authored", [False, True])
def test_an_outfit_that_is_inside_out_is_turned_round(authored: bool) -> None:
    right, _ = cut(load_default_body("female"), SHIRT)
    if not authored:
        right = replace(right, tri_vn=np.full_like(right.tri_vn, -1), normals=np.zeros((0, 3)))
    around = [0, 2, 1]
    wrong = replace(right, tri_v=right.tri_v[:, around], tri_vt=right.tri_vt[:, around], tri_vn=right.tri_vn[:, around])
    for normals in (right.normals, -right.normals):  # either may have been turned with the faces
        found = align(replace(wrong, normals=normals), load_default_body)
        assert codes(found.warnings) == {"outfit-inside-out"}
        np.testing.assert_array_equal(found.outfit.tri_v, right.tri_v)
        np.testing.assert_array_equal(found.outfit.tri_vn, right.tri_vn)
        np.testing.assert_array_equal(found.outfit.normals, right.normals)


def test_a_lining_is_not_turned_round() -> None:
    shirt, _ = cut(load_default_body("female"), SHIRT)
    triangles = np.concatenate([shirt.tri_v, shirt.tri_v[:, [0, 2, 1]], shirt.tri_v[:100, [0, 2, 1]]])
    found = align(outfit_of(shirt.vertices, triangles), load_default_body)
    np.testing.assert_array_equal(found.outfit.tri_v, triangles)
    assert found.warnings == ()


def test_a_stray_piece_far_away_is_told() -> None:
    shirt, _ = cut(load_default_body("female"), SHIRT)
    count = len(shirt.vertices)
    vertices = np.concatenate([shirt.vertices, [[500, 0, 0], [500, 0.1, 0], [500, 0, 0.1]]])
    found = align(outfit_of(vertices, [*shirt.tri_v, [count, count + 1, count + 2]]), load_default_body)
    assert codes(found.warnings) == {"outfit-strays"}
    assert "3 vertices lie up to 499 m" in found.warnings[0].message
    np.testing.assert_array_equal(found.outfit.vertices, vertices)


@pytest.mark.parametrize("place", [0.0, 100.0])
def test_faces_that_are_lines_are_no_surface(place: float) -> None:
    line = np.array([[0.1, 0.2, 0.1], [0.2, 0.2, 0.1], [0.3, 0.2, 0.1]]) + place
    with pytest.raises(GarmentcError, match="no area"):
        align(outfit_of(line, [[0, 1, 2]]), load_default_body)
