"""xatlas texture coordinates: they cover every corner, do not overlap, and leave the mesh alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_topology import grid, outfit_of

from garmentc.outfit import unwrap as unwrap_module
from garmentc.outfit.outfit import Material, Outfit, Texture
from garmentc.outfit.unwrap import unwrap


def uv_areas(outfit: Outfit) -> np.ndarray:
    a, b, c = (outfit.texcoords[outfit.tri_vt[:, k]] for k in range(3))
    return ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2


def sphere() -> Outfit:
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=2)
    return outfit_of(mesh.vertices, mesh.faces)


def test_every_corner_gets_coordinates_in_the_unit_square() -> None:
    outfit = sphere()
    unwrapped = unwrap(outfit)
    assert unwrapped.has_texcoords
    assert unwrapped.texcoords.min() >= 0
    assert unwrapped.texcoords.max() <= 1
    np.testing.assert_array_equal(unwrapped.tri_v, outfit.tri_v)
    np.testing.assert_array_equal(unwrapped.vertices, outfit.vertices)


def test_charts_do_not_overlap() -> None:
    """The pixels covered by all triangles are those covered by any: each texel belongs to one triangle."""
    unwrapped = unwrap(sphere())
    areas = uv_areas(unwrapped)
    assert (np.sign(areas) == np.sign(areas[0])).all()
    side = 256
    xy = (np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2) + 0.5) / side
    hits = np.zeros(len(xy), int)
    for triangle in unwrapped.tri_vt:
        a, b, c = unwrapped.texcoords[triangle]
        sides = np.stack(
            [(q - p)[0] * (xy - p)[:, 1] - (q - p)[1] * (xy - p)[:, 0] for p, q in ((a, b), (b, c), (c, a))]
        )
        hits += (sides > 1e-12).all(axis=0) | (sides < -1e-12).all(axis=0)
    assert hits.max() == 1


def test_coordinates_keep_the_scale_of_triangles() -> None:
    outfit = outfit_of(*grid(20))
    unwrapped = unwrap(outfit)
    a, b, c = (outfit.vertices[outfit.tri_v[:, k]] for k in range(3))
    ratio = np.abs(uv_areas(unwrapped)) / (np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)
    assert ratio.max() < 2 * ratio.min()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_size_does_not_matter(scale: float) -> None:
    points, triangles = grid(10)
    unwrapped = unwrap(outfit_of(points * scale, triangles))
    assert np.abs(uv_areas(unwrapped)).sum() > 0.3


def test_repeated_runs_agree_to_the_bit() -> None:
    first, second = unwrap(sphere()), unwrap(sphere())
    assert first.texcoords.tobytes() == second.texcoords.tobytes()
    assert first.tri_vt.tobytes() == second.tri_vt.tobytes()


def test_degenerate_triangles_are_survived() -> None:
    points, triangles = grid(6)
    bad = np.array([[0, 0, 1], [3, 3, 3], [0, 1, 2], [36, 37, 38], [39, 40, 41]])
    points = np.concatenate([points, np.tile(points[:1], (3, 1)), [[5, 0, 0], [6, 0, 0], [7, 0, 0]]])
    unwrapped = unwrap(outfit_of(points, np.concatenate([bad, triangles])))
    assert unwrapped.has_texcoords
    assert np.isfinite(unwrapped.texcoords).all()
    assert (np.abs(uv_areas(unwrapped)[len(bad) :]) > 0).all()
    only_bad = unwrap(outfit_of(points, bad[:2]))
    assert only_bad.has_texcoords
    assert np.isfinite(only_bad.texcoords).all()


def test_modes(monkeypatch: pytest.MonkeyPatch) -> None:
    bare = outfit_of(*grid(4))
    assert unwrap(bare, "never") is bare
    authored = replace(bare, texcoords=np.zeros((1, 2)), tri_vt=np.zeros_like(bare.tri_vt))
    assert unwrap(authored, "auto") is authored
    texture = Texture("t", b"", "image/png")
    textured = replace(authored, materials=(Material("m", base_color_texture=texture),))
    again = unwrap(textured, "always")
    assert len(np.unique(again.texcoords, axis=0)) == 16
    assert [warning.code for warning in again.warnings] == ["unwrap.textured"]

    monkeypatch.setattr(unwrap_module, "LARGEST_AUTOMATIC", 10)
    skipped = unwrap(bare, "auto")
    assert not skipped.has_texcoords
    assert [warning.code for warning in skipped.warnings] == ["unwrap.too-large"]
    assert unwrap(bare, "always").has_texcoords


def test_garment_without_coordinates(shared: Path) -> None:
    from garmentc.outfit.obj import read_obj

    unwrapped = unwrap(read_obj(shared / "data/garments/makehuman/female_sportsuit01_nouv.obj"))
    assert unwrapped.has_texcoords
    assert np.abs(uv_areas(unwrapped)).sum() > 0.4
