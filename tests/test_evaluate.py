"""A .glb evaluated as an engine does it, against the rig it was made from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gltf_samples import corner_vertices, make_asset
from scipy.spatial.transform import Rotation

from garmentc.errors import GarmentcError
from garmentc.gltf.evaluate import world_mesh, world_positions
from garmentc.gltf.posing import evaluate_network, pose_key_network, state_at_pose, state_at_time
from garmentc.gltf.read import read_glb
from garmentc.gltf.state import rest_state, world_matrices
from garmentc.gltf.write import write_glb

FLOAT, QUANTIZED = 5e-7, 1e-4  # metres


@pytest.mark.parametrize("influences", [4, 8])
@pytest.mark.parametrize("morphs", [0, 8, 128])
@pytest.mark.parametrize("quantize", [False, True])
@pytest.mark.parametrize("sparse", [False, True])
def test_agrees_with_the_rig(tmp_path: Path, influences: int, morphs: int, quantize: bool, sparse: bool) -> None:
    asset = make_asset(morphs, influences, quantize=quantize, sparse=sparse, key_tolerance=0)
    write_glb(asset, tmp_path / "a.glb")
    glb = read_glb(tmp_path / "a.glb")
    corners, tolerance = corner_vertices(asset), QUANTIZED if quantize else FLOAT

    rest = np.concatenate(world_positions(glb, rest_state(glb)))
    np.testing.assert_allclose(rest, asset.rig.template[corners], atol=tolerance)
    motion = asset.clips[0].motion
    for frame in (0, 7, 17, 29):
        expected = asset.rig.posed(motion.poses[frame], motion.trans[frame])[corners]
        animated = world_positions(glb, state_at_time(glb, frame / motion.fps))
        np.testing.assert_allclose(np.concatenate(animated), expected, atol=tolerance)
        posed = world_positions(glb, state_at_pose(glb, motion.poses[frame], motion.trans[frame]))
        np.testing.assert_allclose(np.concatenate(posed), expected, atol=tolerance)


def test_rest_joint_matrices_are_exactly_the_identity(tmp_path: Path) -> None:
    write_glb(make_asset(), tmp_path / "a.glb")
    glb = read_glb(tmp_path / "a.glb")
    skin = glb.skins[0]
    world = world_matrices(glb, rest_state(glb)).astype(np.float32)
    joint_matrices = world[list(skin.joints)] @ skin.inverse_bind_matrices
    np.testing.assert_array_equal(joint_matrices, np.tile(np.eye(4, dtype=np.float32), (24, 1, 1)))


def test_positions_are_exactly_the_template(tmp_path: Path) -> None:
    asset = make_asset(parts=1)
    write_glb(asset, tmp_path / "a.glb")
    [primitive] = read_glb(tmp_path / "a.glb").meshes[0].primitives
    expected = asset.rig.template[asset.primitives[0].vertices].astype(np.float32)
    np.testing.assert_array_equal(primitive.positions, expected)
    shapes = asset.rig.blend_shapes[:, asset.primitives[0].vertices]
    np.testing.assert_array_equal(primitive.morph_positions, shapes)


def test_given_keys_replace_the_network(tmp_path: Path) -> None:
    asset = make_asset(morphs=3)
    write_glb(asset, tmp_path / "a.glb")
    glb = read_glb(tmp_path / "a.glb")
    pose, keys = asset.clips[0].motion.poses[5], np.array([0.5, -1.0, 2.0])
    positions = np.concatenate(world_positions(glb, state_at_pose(glb, pose, keys=keys)))
    np.testing.assert_allclose(positions, asset.rig.posed(pose, keys=keys)[corner_vertices(asset)], atol=FLOAT)


def test_heading_changes_no_key(tmp_path: Path) -> None:
    asset = make_asset(morphs=5)
    write_glb(asset, tmp_path / "a.glb")
    glb = read_glb(tmp_path / "a.glb")
    pose = asset.clips[0].motion.poses[9].copy()
    expected = state_at_pose(glb, pose).weights[25]
    turned = state_at_pose(glb, pose)
    turned.rotation[0] = (Rotation.from_rotvec([0, 1, 0]) * Rotation.from_rotvec(pose[0])).as_quat()
    network = pose_key_network(glb, 25)
    assert network is not None
    np.testing.assert_allclose(evaluate_network(glb, network, turned), expected, atol=1e-12)


def test_world_mesh_joins_all_primitives(tmp_path: Path) -> None:
    asset = make_asset(parts=3)
    write_glb(asset, tmp_path / "a.glb")
    glb = read_glb(tmp_path / "a.glb")
    positions, triangles = world_mesh(glb, rest_state(glb))
    assert len(positions) == len(corner_vertices(asset))
    welded = np.sort(corner_vertices(asset)[triangles], axis=1)
    expected = np.sort(np.concatenate([p.vertices[p.triangles] for p in asset.primitives]), axis=1)
    np.testing.assert_array_equal(welded, expected)


def test_one_needs_an_animation_and_joints(tmp_path: Path) -> None:
    write_glb(replace(make_asset(), clips=()), tmp_path / "a.glb")
    glb = read_glb(tmp_path / "a.glb")
    with pytest.raises(GarmentcError, match="0 animations"):
        state_at_time(glb, 0.0)
    with pytest.raises(GarmentcError, match="8 morph targets, not 2"):
        state_at_pose(glb, np.zeros((24, 3)), keys=np.zeros(2))
    renamed = replace(glb, nodes=tuple(replace(node, name=f"x{node.name}") for node in glb.nodes))
    with pytest.raises(GarmentcError, match="no joint named pelvis"):
        state_at_pose(renamed, np.zeros((24, 3)))
