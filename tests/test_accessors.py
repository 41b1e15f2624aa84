"""Accessors: what lies in the binary chunk, decoded here by hand from the specification."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from gltf_samples import corner_vertices, make_asset

from garmentc.errors import GarmentcError
from garmentc.gltf.accessors import AccessorWriter
from garmentc.gltf.asset import GltfOptions
from garmentc.gltf.cursor import Cursor
from garmentc.gltf.glb import glb_writer, read_chunks
from garmentc.gltf.read_accessors import AccessorReader
from garmentc.gltf.skin import largest_influences, left_out_share, to_unorm16
from garmentc.gltf.write import write_glb

NUMPY = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def decode(document: dict[str, Any], binary: memoryview, index: int) -> np.ndarray:
    """An accessor's raw values, element by element."""
    accessor = document["accessors"][index]

    def elements(view: int, kind: int, count: int, width: int, offset: int = 0) -> np.ndarray:
        where = document["bufferViews"][view]
        dtype = np.dtype(NUMPY[kind])
        stride = where.get("byteStride", dtype.itemsize * width)
        start = where.get("byteOffset", 0) + offset
        return np.array([np.frombuffer(binary, dtype, width, start + i * stride) for i in range(count)])

    kind, count, width = accessor["componentType"], accessor["count"], WIDTH[accessor["type"]]
    values = np.zeros((count, width), NUMPY[kind])
    if "bufferView" in accessor:
        values = elements(accessor["bufferView"], kind, count, width)
    if "sparse" in accessor:
        sparse = accessor["sparse"]
        rows = elements(sparse["indices"]["bufferView"], sparse["indices"]["componentType"], sparse["count"], 1)
        values[rows[:, 0]] = elements(sparse["values"]["bufferView"], kind, sparse["count"], width)
    return values


def written(tmp_path: Path, method: str, array: np.ndarray, **options: Any) -> tuple[dict[str, Any], np.ndarray]:
    """The accessor's description and the values decoded by hand, after checking that our reader gives the same."""
    path = tmp_path / "a.glb"
    with glb_writer(path) as (document, chunk):
        writer = AccessorWriter(document, chunk)
        writer.view(b"odd")  # what follows must be aligned all the same
        getattr(writer, method)(array, **options)
    chunks = read_chunks(path)
    values = decode(chunks.document, chunks.binary, 0)
    accessor = chunks.document["accessors"][0]
    reader = AccessorReader(Cursor(chunks.document, "", path), chunks.binary)
    ours = reader.array(Cursor(0, "/x", path), (accessor["type"],), scale=False)
    np.testing.assert_array_equal(ours.reshape(values.shape), values)
    return chunks.document, values


@pytest.mark.parametrize("dtype", ["f4", "i2", "i1", "u2", "u1"])
@pytest.mark.parametrize("width", [2, 3, 4])
def test_vertex_attributes_are_padded_to_four_bytes(tmp_path: Path, dtype: str, width: int) -> None:
    array = (np.random.default_rng(0).random((7, width)) * 100).astype(dtype)
    document, values = written(tmp_path, "attribute", array, label="x")
    np.testing.assert_array_equal(values, array)
    view = document["bufferViews"][1]
    stride = view.get("byteStride", array.itemsize * width)
    assert stride % 4 == 0
    assert view["byteLength"] == 7 * stride
    assert view["target"] == 34962


def test_bounds_are_those_of_the_stored_values(tmp_path: Path) -> None:
    array = np.random.default_rng(1).normal(size=(50, 3)).astype(np.float32)
    document, _ = written(tmp_path, "attribute", array, bounds=True, label="x")
    accessor = document["accessors"][0]
    assert np.array_equal(np.float32(accessor["min"]), array.min(axis=0))
    assert np.array_equal(np.float32(accessor["max"]), array.max(axis=0))


def test_sparse_only_where_smaller(tmp_path: Path) -> None:
    array = np.zeros((100, 3), np.float32)
    array[[3, 40, 99]] = [[1, 0, 0], [0, -2, 0], [0, 0, 3]]
    document, values = written(tmp_path, "sparse_attribute", array, bounds=True, label="x")
    np.testing.assert_array_equal(values, array)
    accessor = document["accessors"][0]
    assert accessor["sparse"]["count"] == 3
    assert "bufferView" not in accessor
    assert accessor["min"] == [0, -2, 0]

    document, values = written(tmp_path, "sparse_attribute", np.ones((100, 3), np.float32), label="x")
    assert "sparse" not in document["accessors"][0]
    np.testing.assert_array_equal(values, 1)


def test_an_empty_shape_is_one_sparse_zero(tmp_path: Path) -> None:
    document, values = written(tmp_path, "sparse_attribute", np.zeros((70000, 3), np.float32), label="x")
    assert document["accessors"][0]["sparse"]["count"] == 1
    assert document["accessors"][0]["sparse"]["indices"]["componentType"] == 5125
    assert not values.any()


@pytest.mark.parametrize(("largest", "kind"), [(65534, 5123), (65535, 5125)])
def test_indices_avoid_the_restart_value(tmp_path: Path, largest: int, kind: int) -> None:
    document, values = written(tmp_path, "indices", np.array([[0, 1, largest]], np.uint32))
    assert document["accessors"][0]["componentType"] == kind
    assert values[:, 0].tolist() == [0, 1, largest]


def test_nan_is_named(tmp_path: Path) -> None:
    with pytest.raises(GarmentcError, match="the thing: NaN"):
        written(tmp_path, "attribute", np.full((4, 3), np.nan, np.float32), label="the thing")


def test_sixteen_bit_weights_sum_exactly_and_keep_their_order() -> None:
    random = np.random.default_rng(2)
    weights = np.sort(random.dirichlet(np.full(8, 0.3), 5000), axis=1)[:, ::-1]
    weights = np.concatenate([weights, np.full((1, 8), 1 / 8), np.eye(8)[:1]])
    stored = to_unorm16(weights).astype(int)
    assert (stored.sum(axis=1) == 65535).all()
    assert (np.diff(stored, axis=1) <= 0).all()
    assert np.abs(stored / 65535 - weights).max() < 1.01 / 65535
    assert not stored[-1, 1:].any()


def test_largest_influences_match_a_plain_loop() -> None:
    random = np.random.default_rng(3)
    weights = random.dirichlet(np.full(24, 0.2), 300).astype(np.float32)
    joints, kept = largest_influences(weights, 4)
    for row in range(len(weights)):
        best = sorted(range(24), key=lambda joint: -weights[row, joint])[:4]
        assert joints[row].tolist() == best
        expected = weights[row, best].astype(float)
        np.testing.assert_allclose(kept[row], expected / expected.sum(), rtol=1e-12)

    left_out = 1 - np.sort(weights, axis=1)[:, -4:].sum(axis=1, dtype=float) / weights.sum(axis=1, dtype=float)
    assert left_out_share(weights, 4) == pytest.approx(left_out.max(), rel=1e-6)


def test_weights_that_are_left_out_are_told(tmp_path: Path) -> None:
    asset = make_asset(influences=8)
    result = write_glb(replace(asset, options=GltfOptions(influences=4)), tmp_path / "a.glb")
    assert [warning.code for warning in result.warnings] == ["influences-left-out"]
    assert write_glb(asset, tmp_path / "a.glb").warnings == ()


def test_trimesh_sees_the_template(tmp_path: Path) -> None:
    asset = make_asset(morphs=4, parts=2)
    write_glb(asset, tmp_path / "a.glb")
    scene = trimesh.load(tmp_path / "a.glb", process=False)
    meshes = list(scene.geometry.values())
    assert len(meshes) == 2
    expected = asset.rig.template[corner_vertices(asset)].astype(np.float32)
    np.testing.assert_array_equal(np.concatenate([mesh.vertices for mesh in meshes]).astype(np.float32), expected)
    for mesh, primitive in zip(meshes, asset.primitives, strict=True):
        np.testing.assert_array_equal(mesh.faces, primitive.triangles)
        flipped = np.stack([primitive.texcoords[:, 0], 1 - primitive.texcoords[:, 1]], axis=1)
        np.testing.assert_allclose(mesh.visual.uv, flipped, atol=1e-6)
