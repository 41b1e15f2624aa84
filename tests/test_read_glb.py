"""Reading files from anywhere: damaged and hostile ones end in a GarmentcError, nothing else."""

from __future__ import annotations

import copy
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_samples import make_asset
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from garmentc.errors import GarmentcError
from garmentc.gltf.glb import read_chunks
from garmentc.gltf.read import read_glb
from garmentc.gltf.write import write_glb

Edit = Callable[[dict[str, Any]], None]


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("glb") / "a.glb"
    write_glb(make_asset(morphs=3, parts=2, columns=8, rows=8), path)
    return path


def pack(document: Any, binary: bytes) -> bytes:
    text = document if isinstance(document, bytes) else json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def refuse(data: bytes, folder: Path, match: str | None = None) -> None:
    path = folder / "bad.glb"
    path.write_bytes(data)
    with pytest.raises(GarmentcError, match=match) as caught:
        read_glb(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_missing_folder_empty_and_foreign_files(tmp_path: Path) -> None:
    with pytest.raises(GarmentcError, match="No such file"):
        read_glb(tmp_path / "none.glb")
    with pytest.raises(GarmentcError, match="cannot be read"):
        read_glb(tmp_path)
    refuse(b"", tmp_path, "too short")
    refuse(b"o cube\nv 0 0 0\nv 1 0 0\nf 1 2 3\n", tmp_path, "no glTF header")
    refuse(struct.pack("<4sII", b"glTF", 1, 24) + bytes(12), tmp_path, "glTF version 1")


def test_every_truncation_is_refused(sample: Path, tmp_path: Path) -> None:
    data = sample.read_bytes()
    for length in [*range(0, 40), *range(40, len(data), 997)]:
        refuse(data[:length], tmp_path)


def test_a_header_that_agrees_with_the_truncation_does_not_help(sample: Path, tmp_path: Path) -> None:
    data = sample.read_bytes()
    json_length = struct.unpack_from("<I", data, 12)[0]
    for length in (25, 20 + json_length + 4, 20 + json_length + 8, len(data) - 100):
        refuse(data[:8] + struct.pack("<I", length) + data[12:length], tmp_path)


@pytest.mark.parametrize(
    "text",
    [b"", b"{", b"[]", b"null", b"7", b'"x"', b"\xff\xfe", b'{"accessors": NaN}', b"[" * 100000, b"9" * 10000],
    ids=repr,
)
def test_bad_json_is_refused(tmp_path: Path, text: bytes) -> None:
    refuse(pack(text, b""), tmp_path)


def first_accessor(document: dict[str, Any], name: str) -> dict[str, Any]:
    return document["accessors"][document["meshes"][0]["primitives"][0]["attributes"][name]]


def indices(document: dict[str, Any]) -> dict[str, Any]:
    return document["accessors"][document["meshes"][0]["primitives"][0]["indices"]]


def first_sampler(document: dict[str, Any]) -> dict[str, Any]:
    return document["animations"][0]["samplers"][0]


def edit_first(name: str, **values: Any) -> Edit:
    return lambda document: first_accessor(document, name).update(values)


def set_at(*path: str | int, value: Any) -> Edit:
    def edit(document: dict[str, Any]) -> None:
        at: Any = document
        for key in path[:-1]:
            at = at[key]
        at[path[-1]] = value

    return edit


HOSTILE: dict[str, Edit] = {
    "count beyond the view": edit_first("POSITION", count=10**6),
    "count beyond memory": edit_first("POSITION", count=2**40),
    "count negative": edit_first("POSITION", count=-1),
    "count zero": edit_first("POSITION", count=0),
    "count a float": edit_first("POSITION", count=1.5),
    "count true": edit_first("POSITION", count=True),
    "zeros without end": edit_first("POSITION", count=2**31, bufferView=None),
    "other count than positions": edit_first("NORMAL", count=3),
    "unknown component type": edit_first("POSITION", componentType=1),
    "wrong type": edit_first("POSITION", type="VEC2"),
    "unknown type": edit_first("POSITION", type="VEC9"),
    "offset beyond the view": edit_first("POSITION", byteOffset=10**9),
    "offset negative": edit_first("POSITION", byteOffset=-4),
    "view beyond the list": edit_first("POSITION", bufferView=10**6),
    "joints as floats": edit_first("JOINTS_0", componentType=5126),
    "view beyond the buffer": set_at("bufferViews", 0, "byteLength", value=10**9),
    "view offset beyond the buffer": set_at("bufferViews", 0, "byteOffset", value=10**9),
    "view offset negative": set_at("bufferViews", 0, "byteOffset", value=-1),
    "stride too small": set_at("bufferViews", 0, "byteStride", value=4),
    "stride too large": set_at("bufferViews", 0, "byteStride", value=10**6),
    "buffer elsewhere": set_at("buffers", 0, "uri", value="../../secret.bin"),
    "buffer longer than the chunk": set_at("buffers", 0, "byteLength", value=10**9),
    "mesh beyond the list": set_at("nodes", 25, "mesh", value=7),
    "skin beyond the list": set_at("nodes", 25, "skin", value=7),
    "child beyond the list": set_at("nodes", 0, "children", value=[99]),
    "a cycle": set_at("nodes", 23, "children", value=[0]),
    "its own parent": set_at("nodes", 25, "children", value=[25]),
    "two parents": set_at("nodes", 25, "children", value=[0]),
    "few joints": set_at("skins", 0, "joints", value=[0, 1]),
    "no joints": set_at("skins", 0, "joints", value=[]),
    "joint beyond the list": set_at("skins", 0, "joints", value=[*range(23), 99]),
    "translation of two": set_at("nodes", 0, "translation", value=[0, 0]),
    "rotation of text": set_at("nodes", 0, "rotation", value=["x", 0, 0, 1]),
    "translation without end": set_at("nodes", 0, "translation", value=[1e400, 0, 0]),
    "no primitives": set_at("meshes", 0, "primitives", value=[]),
    "targets differ": lambda d: d["meshes"][0]["primitives"][0]["targets"].pop(),
    "weights differ": set_at("meshes", 0, "weights", value=[0.0]),
    "lines": set_at("meshes", 0, "primitives", 0, "mode", value=1),
    "indices of floats": lambda d: indices(d).update(componentType=5126),
    "sampler beyond the list": set_at("animations", 0, "channels", 0, "sampler", value=999),
    "unknown interpolation": set_at("animations", 0, "samplers", 0, "interpolation", value="BOUNCE"),
    "times for values": lambda d: first_sampler(d).update(output=first_sampler(d)["input"]),
    "an extension it needs": lambda d: d.update(extensionsRequired=["KHR_draco_mesh_compression"]),
    "glTF 1.0": set_at("asset", "version", value="1.0"),
    "no asset": lambda d: d.pop("asset"),
    "a list for an object": set_at("nodes", 0, value=[]),
    "an object for a list": lambda d: d.update(meshes={}),
    "a name of numbers": set_at("nodes", 3, "name", value=4),
    "extras that are no JSON": set_at("nodes", 25, "extras", value={"GARMENTC_mesh_pose_keys": "{"}),
    "extras with no base64": lambda d: edit_extras(d, lambda n: n["layers"][0].update(weight="!!!!")),
    "extras with a strange joint": lambda d: edit_extras(d, lambda n: n.update(joints=["nobody"])),
    "layers that do not fit": lambda d: d["meshes"][0]["extensions"]["GARMENTC_mesh_pose_keys"]["layers"].reverse(),
    "no layers": set_at("meshes", 0, "extensions", "GARMENTC_mesh_pose_keys", "layers", value=[]),
    "a later version": set_at("meshes", 0, "extensions", "GARMENTC_mesh_pose_keys", "version", value=2),
    "an unknown activation": set_at(
        "meshes", 0, "extensions", "GARMENTC_mesh_pose_keys", "layers", 0, "activation", value="exec"
    ),
}  # fmt: skip


def edit_extras(document: dict[str, Any], change: Callable[[dict[str, Any]], None]) -> None:
    extras = document["nodes"][25]["extras"]
    network = json.loads(extras["GARMENTC_mesh_pose_keys"])
    change(network)
    extras["GARMENTC_mesh_pose_keys"] = json.dumps(network)


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_documents_are_refused(sample: Path, tmp_path: Path, name: str) -> None:
    chunks = read_chunks(sample)
    document = copy.deepcopy(chunks.document)
    HOSTILE[name](document)
    refuse(pack(document, bytes(chunks.binary)), tmp_path)


def edit_sparse(document: dict[str, Any], **values: Any) -> None:
    sparse = next(accessor["sparse"] for accessor in document["accessors"] if "sparse" in accessor)
    sparse.update(values)


@pytest.mark.parametrize("values", [{"count": 10**7}, {"count": 0}, {"indices": {"bufferView": 0}}, {"values": {}}])
def test_hostile_sparse_accessors_are_refused(sample: Path, tmp_path: Path, values: dict[str, Any]) -> None:
    chunks = read_chunks(sample)
    document = copy.deepcopy(chunks.document)
    edit_sparse(document, **values)
    refuse(pack(document, bytes(chunks.binary)), tmp_path)


def test_sparse_indices_beyond_the_accessor_are_refused(sample: Path, tmp_path: Path) -> None:
    chunks = read_chunks(sample)
    sparse = next(accessor["sparse"] for accessor in chunks.document["accessors"] if "sparse" in accessor)
    start = chunks.document["bufferViews"][sparse["indices"]["bufferView"]]["byteOffset"]
    binary = bytearray(chunks.binary)
    struct.pack_into("<H", binary, start + 2 * (sparse["count"] - 1), 65535)
    refuse(pack(chunks.document, bytes(binary)), tmp_path, "increasing indices below")


def test_indices_beyond_the_vertices_are_refused(sample: Path, tmp_path: Path) -> None:
    chunks = read_chunks(sample)
    accessor = indices(chunks.document)
    binary = bytearray(chunks.binary)
    struct.pack_into("<H", binary, chunks.document["bufferViews"][accessor["bufferView"]]["byteOffset"], 60000)
    refuse(pack(chunks.document, bytes(binary)), tmp_path, "list of triangles")


def test_nan_positions_are_refused(sample: Path, tmp_path: Path) -> None:
    chunks = read_chunks(sample)
    accessor = first_accessor(chunks.document, "POSITION")
    binary = bytearray(chunks.binary)
    struct.pack_into("<f", binary, chunks.document["bufferViews"][accessor["bufferView"]]["byteOffset"], np.nan)
    refuse(pack(chunks.document, bytes(binary)), tmp_path, "NaN")


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_random_damage_never_escapes(sample: Path, tmp_path: Path, data: st.DataObject) -> None:
    """Any byte may change: reading gives an asset or a GarmentcError, never anything else."""
    original = bytearray(sample.read_bytes())
    json_end = 20 + struct.unpack_from("<I", original, 12)[0]
    for _ in range(data.draw(st.integers(1, 4))):
        position = data.draw(st.integers(0, json_end - 1))
        original[position] = data.draw(st.sampled_from(b'0123456789-.,:"[]{}x\0'))
    path = tmp_path / "fuzzed.glb"
    path.write_bytes(original)
    try:
        read_glb(path)
    except GarmentcError as error:
        assert "\n" not in str(error)  # noqa: PT017


JUNK = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 2**60) | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_value_of_any_type_anywhere_never_escapes(sample: Path, tmp_path: Path, data: st.DataObject) -> None:
    chunks = read_chunks(sample)
    document = copy.deepcopy(chunks.document)
    at: Any = document
    while True:
        key = data.draw(st.sampled_from(sorted(at) if isinstance(at, dict) else range(len(at))))
        child = at[key]
        if not isinstance(child, (dict, list)) or not child or data.draw(st.integers(0, 3)) == 0:
            at[key] = data.draw(JUNK)
            break
        at = child
    path = tmp_path / "fuzzed.glb"
    path.write_bytes(pack(document, bytes(chunks.binary)))
    try:
        read_glb(path)
    except GarmentcError as error:
        assert "\n" not in str(error)  # noqa: PT017
