"""examples/runtime: the pose-key network in JavaScript, alone against onnxruntime, and in three.js and Babylon.js."""

from __future__ import annotations

import base64
import json
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import engine_runs
import numpy as np
import onnx
import onnxruntime
import pytest
from gltf_samples import make_asset, make_keys
from onnx import TensorProto, numpy_helper
from runtime_runs import EXAMPLES, PROGRAMS, network_of, node
from scipy.spatial.transform import Rotation

import garmentc
from garmentc.gltf.asset import Asset, RiggedMesh
from garmentc.gltf.pose_keys import EXTENSION, extras_string
from garmentc.gltf.skeletons import MIXAMO
from garmentc.gltf.write import write_glb
from garmentc.key_graph import key_graph
from garmentc.rig import ENCODING_GRAVITY_JOINTS, ENCODING_WIDTHS, KeyNetwork
from garmentc.smpl.pose_sampler import sample_poses

ENGINES = ("three", "babylon", "babylon_right_handed")
PRECISION = 1e-5


@dataclass(frozen=True)
class Compiled:
    """The first example as `garmentc compile` writes it."""

    glb: Path
    keys_onnx: Path

    @property
    def network(self) -> KeyNetwork:
        return network_of(self.glb)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Compiled:
    folder = tmp_path_factory.mktemp("compiled")
    result = Compiled(folder / "a.glb", folder / "keys.onnx")
    garmentc.compile_outfit(EXAMPLES / "tee_and_skirt.obj", result.glb, keys_onnx=result.keys_onnx)
    return result


@pytest.fixture(scope="module")
def poses() -> np.ndarray:
    """(40, 24, 3): a person's poses, the root turned any way, with rest and almost half a turn among them."""
    sampled = sample_poses(40, seed=11)
    sampled[:, 0] = np.random.default_rng(1).normal(scale=1.2, size=(40, 3))
    sampled[0] = 0
    sampled[1, 0] = [0, 2.5, 0]
    sampled[2, 18] = [0, 3.14, 0]
    return sampled.astype(np.float32).astype(np.float64)  # what onnxruntime is given, to the bit


def quaternions(poses: np.ndarray) -> np.ndarray:
    """(T, 24, 4) x y z w of (T, 24, 3) axis-angles. Every other one is negated: it is the same rotation."""
    found = Rotation.from_rotvec(poses.reshape(-1, 3)).as_quat()
    found[::2] *= -1
    return found.reshape(len(poses), 24, 4)


def evaluated(network: str, poses: np.ndarray, folder: Path) -> np.ndarray:
    """(T, M) keys by pose_keys.js alone; `network` is the string of a node's extras."""
    (folder / "network").write_text(network)
    quaternions(poses).tofile(folder / "rotations")
    job = {name: str(folder / name) for name in ("network", "rotations", "out")}
    (folder / "job.json").write_text(json.dumps(job))
    node(PROGRAMS / "evaluate.mjs", folder / "job.json")
    return np.fromfile(folder / "out").reshape(len(poses), -1)


def by_onnxruntime(graph: bytes, poses: np.ndarray) -> np.ndarray:
    session = onnxruntime.InferenceSession(graph, providers=["CPUExecutionProvider"])
    kind = np.float64 if session.get_inputs()[0].type == "tensor(double)" else np.float32
    return session.run(["keys"], {"pose": poses.astype(kind)})[0]


def in_doubles(graph: bytes) -> bytes:
    """The same graph computing in 64-bit floats."""
    model = onnx.load_from_string(graph)
    for constant in model.graph.initializer:
        if constant.data_type == TensorProto.FLOAT:
            constant.CopyFrom(
                numpy_helper.from_array(numpy_helper.to_array(constant).astype(np.float64), constant.name)
            )
    for value in (*model.graph.input, *model.graph.output):
        value.type.tensor_type.elem_type = TensorProto.DOUBLE
    return model.SerializeToString()


@pytest.mark.parametrize("activation", ["linear", "nonnegative"])
@pytest.mark.parametrize("encoding", ENCODING_WIDTHS)
def test_equals_onnxruntime(encoding: str, activation: str, poses: np.ndarray, tmp_path: Path) -> None:
    network = make_keys(11, np.random.default_rng(7), encoding)
    network = KeyNetwork((*network.layers[:-1], replace(network.layers[-1], activation=activation)), encoding)
    found = evaluated(extras_string(network), poses, tmp_path)
    np.testing.assert_allclose(found, by_onnxruntime(key_graph(network), poses), atol=PRECISION, rtol=0)
    np.testing.assert_allclose(found, network(poses), atol=1e-12, rtol=0)


def test_the_default_network_equals_onnxruntime(compiled: Compiled, poses: np.ndarray, tmp_path: Path) -> None:
    found = evaluated(extras_string(compiled.network), poses, tmp_path)
    graph = compiled.keys_onnx.read_bytes()
    np.testing.assert_allclose(found, by_onnxruntime(in_doubles(graph), poses), atol=PRECISION, rtol=0)
    # In 32-bit floats it is onnxruntime that is some 1e-4 off: the last layer subtracts large numbers.
    np.testing.assert_allclose(found, by_onnxruntime(graph, poses), atol=1e-3, rtol=0)


def test_the_kernel_is_what_its_source_says(tmp_path: Path) -> None:
    engine_runs.require_engines()
    node(PROGRAMS / "assemble.mjs", EXAMPLES / "runtime" / "kernel.wat", tmp_path / "kernel.wasm")
    embedded = re.search(r"KERNEL = `([^`]+)`", (EXAMPLES / "runtime" / "pose_keys.js").read_text())
    assert embedded is not None
    assert base64.b64decode(embedded[1]) == (tmp_path / "kernel.wasm").read_bytes()


def test_the_network_costs_little_more_than_its_numbers_twice(compiled: Compiled, tmp_path: Path) -> None:
    gown = make_asset(morphs=compiled.network.output_size)
    gown = replace(gown, rig=replace(gown.rig, keys=compiled.network))
    write_glb(gown, tmp_path / "with.glb")
    write_glb(replace(gown, options=replace(gown.options, pose_keys=False)), tmp_path / "without.glb")
    more = (tmp_path / "with.glb").stat().st_size - (tmp_path / "without.glb").stat().st_size
    numbers = 4 * sum(layer.weight.size + layer.bias.size for layer in compiled.network.layers)
    assert more <= 2.5 * numbers


def wardrobe() -> Asset:
    """Two garments with networks of each encoding and another number of morphs, under names that three.js alters.

    Two morphs of the second are left to animations.
    """
    gown, slip = make_asset(skeleton=MIXAMO), make_asset(morphs=5, columns=16, rows=12, parts=1)
    hanging = replace(slip.rig, keys=make_keys(3, np.random.default_rng(8), ENCODING_GRAVITY_JOINTS))
    return replace(gown, also=(RiggedMesh("slip", hanging, slip.primitives, slip.materials),))


def rewritten(glb: Path, to: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """A copy of a .glb with its JSON changed."""
    data = glb.read_bytes()
    [length] = struct.unpack_from("<I", data, 12)
    document = json.loads(data[20 : 20 + length])
    change(document)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    to.write_bytes(struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest)
    return to


def without_extension(document: dict[str, Any]) -> None:
    document["extensionsUsed"].remove(EXTENSION)
    for mesh in document["meshes"]:
        mesh.pop("extensions", None)


def without_extras(document: dict[str, Any]) -> None:
    for each in document["nodes"]:
        each.pop("extras", None)


def of_another_version(document: dict[str, Any]) -> None:
    for mesh in document["meshes"]:
        mesh["extensions"][EXTENSION]["version"] = 2
    for each in document["nodes"]:
        if EXTENSION in each.get("extras", {}):
            each["extras"][EXTENSION] = json.dumps(json.loads(each["extras"][EXTENSION]) | {"version": 2})


def broken(document: dict[str, Any]) -> None:
    for each in document["nodes"]:
        if EXTENSION in each.get("extras", {}):
            network = json.loads(each["extras"][EXTENSION])
            network["layers"][1]["bias"] = network["layers"][2]["bias"]
            each["extras"][EXTENSION] = json.dumps(network)


@dataclass(frozen=True)
class Drive:
    """A job for drive.mjs: a file in an engine, turned and scaled as a whole."""

    engine: str
    glb: Path
    turn: tuple[float, float, float, float] | None = None


@pytest.fixture(scope="module")
def asset() -> Asset:
    return wardrobe()


FILES = ("written", "extras only", "extension only", "glTF-Transform", "gltfpack", "another version", "broken")
TURN = Rotation.from_rotvec([0.4, -1.1, 0.7])


@pytest.fixture(scope="module")
def driven(asset: Asset, poses: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], Any]:
    """What drive.mjs says, by engine and file; by engine and "turned" with the whole scene turned."""
    engine_runs.require_engines()
    folder = tmp_path_factory.mktemp("driven")
    written = folder / "written.glb"
    write_glb(asset, written)
    for name, change in (
        ("extras only", without_extension),
        ("extension only", without_extras),
        ("another version", of_another_version),
        ("broken", broken),
    ):
        rewritten(written, folder / f"{name}.glb", change)
    for name, program, job in (
        ("glTF-Transform", "rewrite_gltf_transform.mjs", {"steps": []}),
        ("gltfpack", "rewrite_gltfpack.mjs", {"flags": ["-kn", "-km", "-ke", "-kv", "-af", "0"]}),
    ):
        [out] = engine_runs.run(program, [{"glb": str(written), **job}], folder)
        out.rename(folder / f"{name}.glb")
    jobs = [{"engine": engine, "file": name} for engine, name in product(ENGINES, FILES)]
    for engine in ENGINES:
        x, y, z, w = TURN.as_quat()
        # Babylon's own left-handed world is glTF's mirrored in x, and so is a turn in it.
        turn = [x, -y, -z, w] if engine == "babylon" else [x, y, z, w]
        jobs.append({"engine": engine, "file": "turned", "turn": turn, "scale": 2.5})
    rotations = quaternions(poses).reshape(len(poses), -1).tolist()
    for number, job in enumerate(jobs):
        name = "written" if job["file"] == "turned" else job["file"]
        job |= {"glb": str(folder / f"{name}.glb"), "poses": rotations, "out": str(folder / f"drive-{number}.json")}
    (folder / "jobs.json").write_text(json.dumps(jobs))
    node(PROGRAMS / "drive.mjs", folder / "jobs.json")
    return {(job["engine"], job["file"]): json.loads(Path(job["out"]).read_text()) for job in jobs}


def assert_driven(found: Any, asset: Asset, poses: np.ndarray) -> None:
    """Every mesh of every garment has its network's keys. Files may list garments in any order."""
    assert isinstance(found, list), found
    by_morphs = {len(driver["weights"][0][0]): driver for driver in found}
    assert set(by_morphs) == {rig.morph_count for rig in asset.rigs}
    assert len(found) == len(asset.rigs)
    for shown in asset.meshes:
        weights = np.array(by_morphs[shown.rig.morph_count]["weights"])
        assert weights.shape[1] == len(shown.primitives)
        for part in range(weights.shape[1]):
            np.testing.assert_allclose(weights[:, part], shown.rig.pose_keys(poses), atol=PRECISION, rtol=0)


@pytest.mark.parametrize("file", ["written", "extras only", "extension only", "glTF-Transform", "gltfpack"])
@pytest.mark.parametrize("engine", ENGINES)
def test_engines_find_the_network_and_set_the_weights(
    driven: dict[tuple[str, str], Any], asset: Asset, poses: np.ndarray, engine: str, file: str
) -> None:
    assert_driven(driven[engine, file], asset, poses)


@pytest.mark.parametrize("engine", ENGINES)
def test_gravity_pulls_where_the_whole_scene_is_turned_and_scaled(
    driven: dict[tuple[str, str], Any], asset: Asset, poses: np.ndarray, engine: str
) -> None:
    turned = poses.copy()
    turned[:, 0] = (TURN * Rotation.from_rotvec(poses[:, 0])).as_rotvec()
    assert_driven(driven[engine, "turned"], asset, turned)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_later_version_is_left_alone(driven: dict[tuple[str, str], Any], engine: str) -> None:
    assert driven[engine, "another version"] == []


@pytest.mark.parametrize("engine", ENGINES)
def test_a_broken_network_is_refused(driven: dict[tuple[str, str], Any], engine: str) -> None:
    assert "GARMENTC_mesh_pose_keys: a layer does not hold 32 × " in driven[engine, "broken"]["error"]


@pytest.mark.parametrize("encoding", ENCODING_WIDTHS)
@pytest.mark.parametrize("engine", ["three", "babylon"])
def test_an_update_allocates_nothing(engine: str, encoding: str, tmp_path: Path) -> None:
    engine_runs.require_engines()
    gown, keys = make_asset(morphs=32), make_keys(32, np.random.default_rng(7), encoding)
    write_glb(replace(gown, rig=replace(gown.rig, keys=keys)), tmp_path / "a.glb")
    # Babylon's own setter of an influence allocates a number wherever V8 does not inline it.
    inline = "--max-inlined-bytecode-size-cumulative=4000"
    least = float(node("--expose-gc", inline, PROGRAMS / "allocations.mjs", engine, tmp_path / "a.glb"))
    assert least < 1  # bytes an update
