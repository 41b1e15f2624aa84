"""Normal deltas of blend shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from gltf_samples import make_rig

from garmentc.passes.key_reach import key_reach
from garmentc.passes.morph_normals import MorphNormals, morph_normals
from garmentc.passes.pose_set import plausible_poses
from garmentc.rig import Rig

POSES = plausible_poses(fit=100, check=4)


@pytest.fixture(scope="module")
def rig() -> Rig:
    sample = make_rig(morphs=6, columns=40, rows=30, normals=False)
    strong = replace(sample, blend_shapes=20 * sample.blend_shapes)
    return morph_normals(strong, MorphNormals(), POSES)[0]


def normals_of(rig: Rig, vertices: np.ndarray) -> np.ndarray:
    """trimesh's vertex normals (its faces are weighted by corner angle too)."""
    return trimesh.Trimesh(vertices, rig.triangles, process=False).vertex_normals


def test_deltas_give_the_normals_of_the_moved_surface(rig: Rig) -> None:
    reach = key_reach(rig.pose_keys(POSES.fit))
    rest = normals_of(rig, rig.template)
    assert rig.blend_normals is not None
    for shape, delta, amount in zip(rig.blend_shapes, rig.blend_normals, reach, strict=True):
        moved = normals_of(rig, rig.template + amount * shape.astype(np.float64))
        error, turn = (np.linalg.norm(v, axis=1) for v in (rest + amount * delta - moved, moved - rest))
        assert turn.max() > 0.1  # there is something to get right
        assert error.sum() < 0.05 * turn.sum()
        assert error.max() < 0.03  # radians: corner angles of the moved surface differ a little


def test_deltas_are_exactly_zero_where_nothing_moves(rig: Rig) -> None:
    assert rig.blend_normals is not None
    for shape, delta in zip(rig.blend_shapes, rig.blend_normals, strict=True):
        moving = (shape != 0).any(axis=1)
        near = np.zeros(len(moving), dtype=bool)
        near[rig.triangles[moving[rig.triangles].any(axis=1)]] = True
        assert (delta[~near] == 0).all()
        assert 0 < near.sum() < len(near)


def test_deltas_are_float32_and_one_for_each_shape(rig: Rig) -> None:
    assert rig.blend_normals is not None
    assert rig.blend_normals.dtype == np.float32
    assert rig.blend_normals.shape == rig.blend_shapes.shape


def test_no_shapes_no_deltas() -> None:
    bare = make_rig(morphs=0, normals=False)
    assert morph_normals(bare, MorphNormals(), POSES)[0].blend_normals is None


def test_a_shape_that_turns_a_flat_sheet(rig: Rig) -> None:
    """A sheet in the XZ plane sheared upwards along X by the slope s has the normal (-s, 1, 0) / sqrt(1 + s^2)."""
    x, z = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5))
    sheet = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    cell = (np.arange(4)[:, None] * 5 + np.arange(4)).ravel()
    triangles = np.concatenate([np.stack([cell, cell + 5, cell + 1], 1), np.stack([cell + 1, cell + 5, cell + 6], 1)])
    slope = 0.3
    shape = np.stack([np.zeros(25), slope * sheet[:, 0], np.zeros(25)], axis=1).astype(np.float32)
    flat = replace(
        rig,
        template=sheet,
        triangles=triangles.astype(np.int32),
        weights=np.tile(np.eye(24, dtype=np.float32)[0], (25, 1)),
        blend_shapes=np.repeat(shape[None], 6, axis=0),
        blend_normals=None,
    )
    deltas = morph_normals(flat, MorphNormals(), POSES)[0].blend_normals
    assert deltas is not None
    for delta, amount in zip(deltas, key_reach(flat.pose_keys(POSES.fit)), strict=True):
        tilt = amount * slope
        expected = (np.array([-tilt, 1, 0]) / np.hypot(1, tilt) - [0, 1, 0]) / amount
        np.testing.assert_allclose(delta, np.tile(expected, (25, 1)), atol=1e-5)
