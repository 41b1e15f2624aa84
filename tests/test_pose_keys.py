"""The extension GARMENTC_mesh_pose_keys: both copies, their schemas, and the mathematics of its document."""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_samples import make_asset, make_keys, make_rig
from scipy.spatial.transform import Rotation

from garmentc.errors import GarmentcError
from garmentc.gltf.glb import read_chunks
from garmentc.gltf.pose_keys import EXTENSION
from garmentc.gltf.posing import pose_key_network, state_at_pose
from garmentc.gltf.read import read_glb
from garmentc.gltf.write import write_glb
from garmentc.rig import ENCODING_GRAVITY_JOINTS, KeyNetwork
from garmentc.schema import check_schema
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.smpl.skeleton import JOINT_NAMES, PARENTS

KEYS = {
    "as first": make_rig(morphs=6).keys,
    "gravity in joints": make_keys(6, np.random.default_rng(1), ENCODING_GRAVITY_JOINTS),
}


@pytest.fixture(scope="module", params=KEYS)
def keys(request: pytest.FixtureRequest) -> KeyNetwork:
    found = KEYS[request.param]
    assert found is not None
    return found


@pytest.fixture(scope="module")
def sample(keys: KeyNetwork, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("glb") / "a.glb"
    asset = make_asset(morphs=6)
    write_glb(replace(asset, rig=replace(asset.rig, keys=keys)), path)
    return path


def in_words_of_the_document(network: dict[str, Any], pose: np.ndarray) -> np.ndarray:
    """Step by step as docs/GARMENTC_mesh_pose_keys.md says, with scipy's rotations and Python's base64."""
    rotations = Rotation.from_rotvec(pose)
    numbers = [rotations[0].inv().apply([0, 1, 0]) - [0, 1, 0]]
    world = [rotations[0]]
    for joint in range(1, 24):
        world.append(world[PARENTS[joint]] * rotations[joint])
        if network["encoding"] == "gravity_joints":
            numbers.append(world[joint].inv().apply([0, 1, 0]) - [0, 1, 0])
        numbers.append(rotations[joint].as_rotvec())
    x = np.concatenate(numbers)
    for layer in network["layers"]:
        weight = np.frombuffer(base64.b64decode(layer["weight"]), "<f4").reshape(layer["outputs"], layer["inputs"])
        x = weight.astype(float) @ x + np.frombuffer(base64.b64decode(layer["bias"]), "<f4")
        if layer["activation"] in ("relu", "normalized_relu"):
            x = np.maximum(x, 0)
        if layer["activation"] == "normalized_relu":
            x = x / (x.sum() + 1e-6)
        if layer["activation"] == "nonnegative":
            x = x - min(x)
    return x


def test_both_copies_follow_their_schemas(sample: Path) -> None:
    document = read_chunks(sample).document
    check_schema(document["meshes"][0]["extensions"][EXTENSION], EXTENSION)
    text = document["nodes"][25]["extras"][EXTENSION]
    assert isinstance(text, str)
    check_schema(json.loads(text), f"{EXTENSION}.extras")
    assert json.loads(text)["joints"] == list(JOINT_NAMES)
    with pytest.raises(GarmentcError):
        check_schema({"version": 2}, EXTENSION)


def test_it_is_used_and_never_required(sample: Path) -> None:
    document = read_chunks(sample).document
    assert EXTENSION in document["extensionsUsed"]
    assert EXTENSION not in document.get("extensionsRequired", [])


def test_both_copies_hold_the_network(sample: Path, keys: KeyNetwork) -> None:
    glb = read_glb(sample)
    for network in (glb.meshes[0].pose_keys, glb.nodes[25].pose_keys):
        assert network is not None
        assert network.joints == tuple(range(24))
        assert network.encoding == keys.encoding
        for layer, expected in zip(network.layers, keys.layers, strict=True):
            np.testing.assert_array_equal(layer.weight, expected.weight)
            np.testing.assert_array_equal(layer.bias, expected.bias)
            assert layer.activation == expected.activation


def test_the_documents_mathematics_gives_the_rigs_keys(sample: Path, keys: KeyNetwork) -> None:
    glb = read_glb(sample)
    network = json.loads(read_chunks(sample).document["nodes"][25]["extras"][EXTENSION])
    long_way = np.zeros((24, 3))
    long_way[5] = [4.0, 0.0, 0.0]  # beyond pi: the shorter way counts
    for pose in (*sample_poses(20, seed=1), np.zeros((24, 3)), long_way):
        expected = in_words_of_the_document(network, pose)
        np.testing.assert_allclose(keys(pose), expected, atol=1e-10)
        np.testing.assert_allclose(state_at_pose(glb, pose).weights[25], expected, atol=1e-10)


def test_the_rest_pose_has_no_keys(sample: Path) -> None:
    weights = state_at_pose(read_glb(sample), np.zeros((24, 3))).weights[25]
    assert np.abs(weights).max() < 1e-6


def test_the_copy_in_the_extras_serves_where_the_extension_was_dropped(sample: Path) -> None:
    glb = read_glb(sample)
    stripped = replace(glb, meshes=(replace(glb.meshes[0], pose_keys=None),))
    assert pose_key_network(stripped, 25) is glb.nodes[25].pose_keys
    pose = sample_poses(1, seed=2)[0]
    np.testing.assert_array_equal(state_at_pose(stripped, pose).weights[25], state_at_pose(glb, pose).weights[25])


def test_it_can_be_left_out(tmp_path: Path) -> None:
    write_glb(make_asset(pose_keys=False), tmp_path / "a.glb")
    document = read_chunks(tmp_path / "a.glb").document
    assert "extensionsUsed" not in document
    assert "extras" not in document["nodes"][25]
    assert pose_key_network(read_glb(tmp_path / "a.glb"), 25) is None
