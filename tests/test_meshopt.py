"""EXT_meshopt_compression: smaller files that mean the same."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import engine_runs
import numpy as np
import pytest
from cli_samples import CommandLine, write_top
from gltf_samples import corner_vertices, make_asset, make_motion
from scipy.spatial import cKDTree

from garmentc.errors import GarmentcError
from garmentc.gltf.asset import Asset
from garmentc.gltf.diff import diff_glb
from garmentc.gltf.difference import DiffTolerances
from garmentc.gltf.evaluate import world_mesh, world_positions
from garmentc.gltf.glb import read_chunks
from garmentc.gltf.inspect import inspect_glb
from garmentc.gltf.meshopt import ATTRIBUTES, EXTENSION, INDICES, TRIANGLES, decompress
from garmentc.gltf.posing import state_at_time
from garmentc.gltf.read import read_glb
from garmentc.gltf.reorder import reordered
from garmentc.gltf.state import rest_state
from garmentc.gltf.validate import validate_glb
from garmentc.gltf.write import write_glb

pytest.importorskip("meshopt")

FLOAT, QUANTIZED = 2e-6, 2e-4  # metres
FRAMES = [0, 7, 29]
TIMES = [float(np.float32(frame / 30)) for frame in FRAMES]

CASES = {
    "quantized": {"quantize": True},
    "float": {"quantize": False},
    "eight influences": {"quantize": True, "influences": 8},
    "one part without normals": {"quantize": True, "parts": 1, "normals": False},
    "no morphs": {"quantize": True, "morphs": 0},
}


def sample(case: str, **options: bool) -> Asset:
    return make_asset(**{"morphs": 16, "key_tolerance": 0, **CASES[case], **options})


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("meshopt")


@pytest.fixture(scope="module")
def written(folder: Path) -> dict[str, Path]:
    paths = {case: folder / f"{case.replace(' ', '_')}.glb" for case in CASES}
    for case, path in paths.items():
        write_glb(sample(case, meshopt=True), path)
    return paths


@pytest.mark.parametrize("case", CASES)
def test_it_is_read_back_as_what_it_was(written: dict[str, Path], folder: Path, case: str) -> None:
    plain = folder / "plain.glb"
    write_glb(sample(case), plain)
    left, right = read_glb(plain), read_glb(written[case])
    exact = dict.fromkeys(("normal", "texcoord", "weight", "rotation", "key"), 1e-7)
    rounding = 9e-5 if CASES[case]["quantize"] else 1e-7  # steps of 0.1 mm at most, and finer ones without compression
    assert diff_glb(left, right, DiffTolerances(position=rounding, **exact)) == ()
    assert validate_glb(right) == validate_glb(left)
    assert right.extensions_required == (EXTENSION, *left.extensions_required)


def test_what_it_takes(written: dict[str, Path], folder: Path) -> None:
    plain = folder / "plain.glb"
    write_glb(sample("quantized", pose_keys=False), plain)
    write_glb(sample("quantized", pose_keys=False, meshopt=True), folder / "small.glb")
    small, large = (inspect_glb(read_glb(path)) for path in (folder / "small.glb", plain))
    assert small.bytes < 0.8 * large.bytes  # its shapes are local, and sparse without compression
    for kind in ("morph targets", "vertices", "indices"):
        assert small.bytes_by_kind[kind] < large.bytes_by_kind[kind]
    assert sum(small.bytes_by_kind.values()) == small.bytes
    of_morphs = sum(morph.bytes for morph in small.morphs)
    assert of_morphs == pytest.approx(small.bytes_by_kind["morph targets"], rel=0.01)
    assert len(read_chunks(folder / "small.glb").document["bufferViews"]) < 16


def test_small_deltas_take_a_byte(tmp_path: Path) -> None:
    asset = sample("one part without normals", meshopt=True)
    shapes = asset.rig.blend_shapes.copy()
    shapes[3] *= 0.02
    write_glb(replace(asset, rig=replace(asset.rig, blend_shapes=shapes)), tmp_path / "a.glb")
    storage = read_glb(tmp_path / "a.glb").meshes[0].primitives[0].storage
    assert [storage[f"targets/{target}/POSITION"].component for target in (2, 3)] == ["int16", "int8"]
    assert not storage["POSITION"].normalized


@pytest.mark.parametrize("engine", ["three_cpu.mjs", "gltf_transform.mjs"])
def test_engines_decode_it(written: dict[str, Path], folder: Path, engine: str) -> None:
    engine_runs.require_engines()
    cases = [case for case in CASES if "eight" not in case]  # three.js reads four influences
    found = engine_runs.animated_positions(engine, [written[case] for case in cases], TIMES, folder)
    motion = make_motion()
    for case, positions in zip(cases, found, strict=True):
        asset = sample(case)
        posed = asset.rig.posed(motion.poses[FRAMES], motion.trans[FRAMES])[:, corner_vertices(asset)]
        tolerance = QUANTIZED if CASES[case]["quantize"] else FLOAT
        np.testing.assert_allclose(positions, posed, atol=tolerance, rtol=0)


def test_the_khronos_validator_is_content(written: dict[str, Path], folder: Path) -> None:
    """With the container: it does not know the extension, says so, and does not look inside."""
    engine_runs.require_engines()
    for report in engine_runs.khronos_reports(list(written.values()), folder):
        engine_runs.assert_valid(report)
        assert "UNSUPPORTED_EXTENSION" in {message["code"] for message in report["issues"]["messages"]}


def test_equal_assets_give_equal_bytes(written: dict[str, Path], tmp_path: Path) -> None:
    write_glb(sample("quantized", meshopt=True), tmp_path / "a.glb")
    assert (tmp_path / "a.glb").read_bytes() == written["quantized"].read_bytes()


def test_streams_have_the_versions_that_the_extension_names(written: dict[str, Path]) -> None:
    """EXT_meshopt_compression: attributes begin with 0xa0, triangles with 0xe1, indices with 0xd1."""
    chunks = read_chunks(written["quantized"])
    heads: dict[str, set[int]] = {}
    for view in chunks.document["bufferViews"]:
        packed = view.get("extensions", {}).get(EXTENSION)
        if packed:
            assert packed["count"] * packed["byteStride"] == view["byteLength"]
            heads.setdefault(packed["mode"], set()).add(chunks.binary[packed["byteOffset"]])
    assert heads == {ATTRIBUTES: {0xA0}, TRIANGLES: {0xE1}, INDICES: {0xD1}}


def test_damaged_streams_are_refused(written: dict[str, Path], tmp_path: Path) -> None:
    chunks = read_chunks(written["quantized"])
    packed = next(
        view["extensions"][EXTENSION]
        for view in chunks.document["bufferViews"]
        if EXTENSION in view.get("extensions", {})
    )
    whole = written["quantized"].read_bytes()
    start = len(whole) - len(chunks.binary) + packed["byteOffset"]
    damaged = tmp_path / "damaged.glb"
    damaged.write_bytes(whole[:start] + b"\x00" + whole[start + 1 :])
    with pytest.raises(GarmentcError, match=r"damaged.glb: /bufferViews/\d+/extensions/EXT_.* cannot be decompressed"):
        read_glb(damaged)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": 7}, "must have 28 bytes, 4 for each of 7|must have 56 bytes, 8 for each of 7"),
        ({"mode": "MAGIC"}, "the mode MAGIC with the filter NONE is not known"),
        ({"filter": "BLUR"}, "the filter BLUR is not known"),
        ({"byteOffset": 2**40}, "must be a whole number from 0"),
        ({"byteLength": 0}, "must be a whole number from 1"),
        ({"buffer": 1}, "buffer must be a whole number from 0 to 0"),
    ],
)
def test_wrong_descriptions_are_refused(
    written: dict[str, Path], tmp_path: Path, change: dict[str, object], message: str
) -> None:
    chunks = read_chunks(written["quantized"])
    view = next(view for view in chunks.document["bufferViews"] if "extensions" in view)
    view["extensions"][EXTENSION] |= change
    text = json.dumps(chunks.document).encode()
    text += b" " * (-len(text) % 4)
    total = 28 + len(text) + len(chunks.binary)
    parts = [b"glTF", (2).to_bytes(4, "little"), total.to_bytes(4, "little"), len(text).to_bytes(4, "little"), b"JSON"]
    parts += [text, len(chunks.binary).to_bytes(4, "little"), b"BIN\0", bytes(chunks.binary)]
    (tmp_path / "a.glb").write_bytes(b"".join(parts))
    with pytest.raises(GarmentcError, match=message):
        read_glb(tmp_path / "a.glb")


@pytest.mark.parametrize("stride", [0, 3, 260])
def test_strides_that_the_codec_cannot_have_are_refused(stride: int) -> None:
    with pytest.raises(ValueError, match="stride"):
        decompress(memoryview(b"\xa0" * 64), 4, stride, ATTRIBUTES, "NONE")


def test_noise_never_crashes_the_decoder(written: dict[str, Path]) -> None:
    random = np.random.default_rng(0)
    chunks = read_chunks(written["quantized"])
    packed = next(view["extensions"][EXTENSION] for view in chunks.document["bufferViews"] if "extensions" in view)
    data = bytearray(chunks.binary[packed["byteOffset"] : packed["byteOffset"] + packed["byteLength"]])
    for _ in range(500):
        noisy = bytearray(data)
        for place in random.integers(1, len(noisy), 4):
            noisy[place] = random.integers(256)
        cut = noisy[: random.integers(1, len(noisy) + 1)]
        try:
            decoded = decompress(memoryview(cut), packed["count"], packed["byteStride"], packed["mode"], "NONE")
        except ValueError:
            continue
        assert len(decoded) == packed["count"] * packed["byteStride"]


def test_reordering_keeps_the_surface() -> None:
    primitive = sample("quantized").primitives[1]
    random = np.random.default_rng(1)
    shuffled = random.permutation(len(primitive.triangles))
    given = replace(primitive, triangles=primitive.triangles[shuffled], tri_index=primitive.tri_index[shuffled])
    found = reordered(given)
    assert len(found.vertices) == len(given.vertices)

    def surface(part: object, values: np.ndarray) -> dict[int, list[list[float]]]:
        corners = values[part.triangles]  # type: ignore[attr-defined]
        lowest = corners.reshape(len(corners), 3, -1)[:, :, 0].argmin(axis=1)
        turned = [np.roll(triangle, -k, axis=0).tolist() for triangle, k in zip(corners, lowest, strict=True)]
        return dict(zip(part.tri_index.tolist(), turned, strict=True))  # type: ignore[attr-defined]

    for name in ("vertices", "obj_vertices", "texcoords", "normals"):
        assert surface(found, getattr(found, name)) == surface(given, getattr(given, name)), name


def test_the_missing_package_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, written: dict[str, Path]
) -> None:
    run, top = CommandLine(capsys), write_top(tmp_path)
    monkeypatch.setitem(sys.modules, "meshopt", None)
    line = run.fails("compile", top, "-o", tmp_path / "a.glb", "--meshopt")
    assert "needs the package meshopt; run: pip install 'garmentc[meshopt]'" in line
    assert "pip install" in run.fails("inspect", written["quantized"])


def test_compile_with_meshopt(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run, top = CommandLine(capsys), write_top(tmp_path)
    options = ["--gender", "female", "--profile", "mobile", "--no-pose-keys"]
    for name, more in (("plain", []), ("small", ["--meshopt"]), ("again", ["--meshopt"])):
        result = run("compile", top, "-o", tmp_path / f"{name}.glb", *options, *more)
        assert result.code == 0
        assert ("a step of 0.100 mm" in result.out) == bool(more)
    small, again = tmp_path / "small.glb", tmp_path / "again.glb"
    assert small.read_bytes() == again.read_bytes()
    assert small.stat().st_size < 0.6 * (tmp_path / "plain.glb").stat().st_size
    assert run("validate", small, "--strict").code == 0
    plain, compressed = (world_mesh(glb, rest_state(glb))[0] for glb in map(read_glb, (tmp_path / "plain.glb", small)))
    apart, _ = cKDTree(compressed).query(plain)
    assert len(plain) == len(compressed)
    assert apart.max() < 1e-4


def test_animations_are_compressed_losslessly(written: dict[str, Path], folder: Path) -> None:
    write_glb(sample("float"), folder / "plain.glb")
    plain, small = read_glb(folder / "plain.glb"), read_glb(written["float"])
    for left, right in zip(plain.animations[0].channels, small.animations[0].channels, strict=True):
        assert left.path == right.path
        np.testing.assert_array_equal(left.values, right.values)
        np.testing.assert_array_equal(left.times, right.times)
    states = [state_at_time(glb, 0.31) for glb in (plain, small)]
    np.testing.assert_array_equal(*(np.concatenate(world_positions(plain, state)) for state in states))
