"""Checks of meaning: nothing to say about our own files, and every fault found."""

from __future__ import annotations

import dataclasses
import io
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_samples import make_asset, make_motion
from PIL import Image

from garmentc.gltf.asset import Clip
from garmentc.gltf.glb_asset import GlbAsset, Primitive
from garmentc.gltf.inspect import inspect_glb
from garmentc.gltf.read import read_glb
from garmentc.gltf.validate import validate_glb
from garmentc.gltf.write import write_glb
from garmentc.outfit.outfit import Material, Texture


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> GlbAsset:
    path = tmp_path_factory.mktemp("glb") / "a.glb"
    write_glb(make_asset(morphs=6), path)
    return read_glb(path)


@pytest.mark.parametrize("quantize", [False, True])
@pytest.mark.parametrize("morphs", [0, 6])
def test_our_own_files_are_sound(tmp_path: Path, quantize: bool, morphs: int) -> None:
    write_glb(make_asset(morphs=morphs, quantize=quantize, parts=3, key_tolerance=5e-4), tmp_path / "a.glb")
    assert validate_glb(read_glb(tmp_path / "a.glb")) == ()


def test_eight_influences_are_worth_a_warning(tmp_path: Path) -> None:
    write_glb(make_asset(influences=8), tmp_path / "a.glb")
    assert {(f.severity, f.code) for f in validate_glb(read_glb(tmp_path / "a.glb"))} == {
        ("warning", "influence-limit")
    }


def test_influences_too_small_to_miss_are_not(tmp_path: Path) -> None:
    asset = make_asset(influences=8)
    weights = np.sort(asset.rig.weights, axis=1)[:, ::-1].copy()
    weights[:, 4:] *= 0.005
    weights /= weights.sum(axis=1, keepdims=True)
    write_glb(replace(asset, rig=replace(asset.rig, weights=weights)), tmp_path / "a.glb")
    glb = read_glb(tmp_path / "a.glb")
    assert glb.meshes[0].primitives[0].weights[:, 4:].any()
    assert validate_glb(glb) == ()


def edit_primitive(glb: GlbAsset, **changes: Callable[[Primitive], Any]) -> GlbAsset:
    mesh = glb.meshes[0]
    edited = replace(mesh.primitives[0], **{name: change(mesh.primitives[0]) for name, change in changes.items()})
    return replace(glb, meshes=(replace(mesh, primitives=(edited, *mesh.primitives[1:])),))


def edit_mesh(glb: GlbAsset, **changes: Any) -> GlbAsset:
    return replace(glb, meshes=(replace(glb.meshes[0], **changes),))


def edit_node(glb: GlbAsset, index: int, **changes: Any) -> GlbAsset:
    nodes = list(glb.nodes)
    nodes[index] = replace(nodes[index], **changes)
    return replace(glb, nodes=tuple(nodes))


def edit_skin(glb: GlbAsset, **changes: Any) -> GlbAsset:
    return replace(glb, skins=(replace(glb.skins[0], **changes),))


def edit_channel(glb: GlbAsset, path: str, change: Callable[[np.ndarray], np.ndarray]) -> GlbAsset:
    channels = list(glb.animations[0].channels)
    number = next(number for number, channel in enumerate(channels) if channel.path == path)
    channels[number] = replace(channels[number], values=change(channels[number].values.copy()))
    return replace(glb, animations=(replace(glb.animations[0], channels=tuple(channels)),))


def edit_bias(glb: GlbAsset, amount: float) -> GlbAsset:
    network = glb.meshes[0].pose_keys
    assert network is not None
    last = replace(network.layers[-1], bias=network.layers[-1].bias + np.float32(amount))
    return edit_mesh(glb, pose_keys=replace(network, layers=(*network.layers[:-1], last)))


def more_outputs(glb: GlbAsset) -> GlbAsset:
    network = glb.meshes[0].pose_keys
    assert network is not None
    twice = network.layers[-1]
    last = replace(twice, bias=np.tile(twice.bias, 2), weight=np.tile(twice.weight, (2, 1)))
    return edit_mesh(glb, pose_keys=replace(network, layers=(*network.layers[:-1], last)))


def seam_vertex(glb: GlbAsset) -> int:
    """A vertex of the first primitive that another one has at the same place."""
    positions = glb.meshes[0].primitives[0].positions
    _, first, counts = np.unique(positions, axis=0, return_index=True, return_counts=True)
    return int(first[counts > 1][0])


def changed(array: np.ndarray, index: Any, value: Any) -> np.ndarray:
    array = array.copy()
    array[index] = value
    return array


FAULTS: dict[str, Callable[[GlbAsset], GlbAsset]] = {
    "weight-sum": lambda g: edit_primitive(g, weights=lambda p: p.weights * np.float32(0.9)),
    "weight-negative": lambda g: edit_primitive(g, weights=lambda p: changed(p.weights, (3, 3), -0.1)),
    "weight-order": lambda g: edit_primitive(
        g, weights=lambda p: p.weights[:, ::-1].copy(), joints=lambda p: p.joints[:, ::-1].copy()
    ),
    "no-weights": lambda g: edit_primitive(g, weights=lambda p: None, joints=lambda p: None),
    "torn-seam": lambda g: edit_primitive(
        g, morph_positions=lambda p: changed(p.morph_positions, (0, seam_vertex(g)), 0.01)
    ),
    "no-skin": lambda g: edit_node(g, 25, skin=None),
    "no-mesh": lambda g: replace(edit_node(g, 25, mesh=None), animations=()),
    "skinned-not-root": lambda g: edit_node(g, 25, parent=24),
    "node-weights": lambda g: edit_node(g, 25, weights=(0.0,) * 6),
    "rotation-norm": lambda g: edit_node(g, 4, rotation=(0.0, 0.0, 0.0, 2.0)),
    "joint-count": lambda g: edit_skin(
        g, joints=g.skins[0].joints[:-1], inverse_bind_matrices=g.skins[0].inverse_bind_matrices[:-1]
    ),
    "joint-names": lambda g: edit_node(g, 7, name="Bip01"),
    "joint-hierarchy": lambda g: edit_node(g, 7, parent=0),
    "bind-pose": lambda g: edit_node(g, 7, translation=(0.0, 0.0, 0.0)),
    "morph-rest": lambda g: edit_mesh(g, weights=(0.5,) * 6),
    "target-names": lambda g: edit_mesh(g, target_names=("a",) * 6),
    "pose-key-outputs": more_outputs,
    "pose-key-copies": lambda g: edit_bias(g, 1e-8),
    "pose-key-rest": lambda g: edit_bias(g, 0.1),
    "pose-key-joints": lambda g: edit_mesh(g, pose_keys=replace(g.meshes[0].pose_keys, joints=tuple(range(1, 25)))),
    "pose-key-encoding": lambda g: edit_mesh(g, pose_keys=replace(g.meshes[0].pose_keys, encoding="magic")),
    "extension-required": lambda g: replace(g, extensions_required=("GARMENTC_mesh_pose_keys",)),
    "extension-listed": lambda g: replace(g, extensions_used=()),
    "baked-keys": lambda g: edit_channel(g, "weights", lambda v: v + np.float32(0.3)),
    "rotation-sign": lambda g: edit_channel(g, "rotation", lambda v: changed(v, slice(5, None), -v[5:])),
}


@pytest.mark.parametrize("code", FAULTS)
def test_every_fault_is_found(sample: GlbAsset, code: str) -> None:
    findings = validate_glb(FAULTS[code](sample))
    assert code in {finding.code for finding in findings}
    assert all("\n" not in str(finding) for finding in findings)


def test_a_network_of_the_other_encoding_must_have_its_inputs(sample: GlbAsset) -> None:
    network = replace(sample.meshes[0].pose_keys, encoding="gravity_joints")
    [found] = [each for each in validate_glb(edit_mesh(sample, pose_keys=network)) if each.code == "pose-key-encoding"]
    assert "take 72 inputs, not 141" in found.message


def test_a_broken_quaternion_in_an_animation(sample: GlbAsset) -> None:
    broken = edit_channel(sample, "rotation", lambda values: values * np.float32(1.1))
    assert [finding.code for finding in validate_glb(broken)] == ["rotation-norm"]


def test_many_morphs_name_the_engine(tmp_path: Path) -> None:
    write_glb(make_asset(morphs=130, columns=8, rows=8), tmp_path / "a.glb")
    [finding] = validate_glb(read_glb(tmp_path / "a.glb"))
    assert finding.code == "morph-limit"
    assert "Babylon" in finding.message


def jpeg(width: int, height: int) -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (width, height)).save(file, "JPEG")
    return file.getvalue()


def test_inspect_counts_everything(tmp_path: Path) -> None:
    texture = Texture("shirt.jpg", jpeg(40, 24), "image/jpeg")
    asset = replace(
        make_asset(morphs=4, quantize=True, parts=2, key_tolerance=0),
        materials=(Material("silk", base_color_texture=texture), Material("wool")),
        clips=(Clip(make_motion(name="walk")),),
    )
    write_glb(asset, tmp_path / "a.glb")
    summary = inspect_glb(read_glb(tmp_path / "a.glb"))
    assert summary.bytes == (tmp_path / "a.glb").stat().st_size
    assert sum(summary.bytes_by_kind.values()) == summary.bytes
    assert summary.bytes_by_kind["images"] == len(texture.data)
    assert 0 <= summary.bytes_by_kind["other"] < 600  # padding and headers
    assert summary.joints == 24
    assert [primitive.material for primitive in summary.primitives] == ["silk", "wool"]
    assert [p.vertices for p in summary.primitives] == [len(p.vertices) for p in asset.primitives]
    assert [p.triangles for p in summary.primitives] == [len(p.triangles) for p in asset.primitives]
    assert summary.primitives[0].attributes["POSITION"] == "int16 normalised"
    assert summary.primitives[0].influences == 4
    assert summary.animations[0].name == "walk"
    assert summary.animations[0].keyframes == 26 * 30
    assert summary.pose_keys[0].layers == (72, 32, 24, 4)
    assert summary.pose_keys[0].parameters == 72 * 32 + 32 + 32 * 24 + 24 + 24 * 4 + 4
    [image] = summary.images
    assert (image.width, image.height) == (40, 24)
    largest = np.linalg.norm(asset.rig.blend_shapes, axis=2).max(axis=1) * 1000
    np.testing.assert_allclose([morph.largest_mm for morph in summary.morphs], largest, atol=0.05)
    assert summary.findings == ()
    json.dumps(dataclasses.asdict(summary))
