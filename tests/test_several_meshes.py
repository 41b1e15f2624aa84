"""Several meshes on one skeleton in a file: what each is worth alone, it is worth beside the others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import engine_runs
import numpy as np
import pytest
from gltf_samples import corner_vertices, make_asset, make_motion

from garmentc.evaluation.posed_outfit import read_outfit
from garmentc.gltf.asset import Asset, Clip, RiggedMesh
from garmentc.gltf.body_mesh import body_mesh, left_out_correctives
from garmentc.gltf.diff import diff_glb
from garmentc.gltf.evaluate import world_positions
from garmentc.gltf.inspect import inspect_glb
from garmentc.gltf.names import unique_names
from garmentc.gltf.posing import state_at_pose, state_at_time
from garmentc.gltf.read import read_glb
from garmentc.gltf.state import rest_state
from garmentc.gltf.validate import validate_glb
from garmentc.gltf.write import write_glb
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.pose_sampler import sample_poses

FLOAT, QUANTIZED = 2e-6, 2e-4  # metres
BODY = load_default_body("neutral")


def together(**options: bool) -> Asset:
    """A gown, a smaller one with other morphs and no pose keys of the first, and the body."""
    gown, slip = make_asset(key_tolerance=0, **options), make_asset(morphs=3, columns=16, rows=12, parts=1)
    rig = replace(slip.rig, template=0.9 * slip.rig.template)
    also = (RiggedMesh("slip", rig, slip.primitives, slip.materials), body_mesh(BODY, None))
    return replace(gown, also=also)


@pytest.fixture(scope="module", params=[False, True], ids=["float", "quantized"])
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Asset, Path, float]:
    path = tmp_path_factory.mktemp("together") / "a.glb"
    asset = together(quantize=request.param)
    write_glb(asset, path)
    return asset, path, QUANTIZED if request.param else FLOAT


def of_meshes(asset: Asset, posed: list[np.ndarray]) -> np.ndarray:
    corners = [np.concatenate([primitive.vertices for primitive in mesh.primitives]) for mesh in (asset, *asset.also)]
    return np.concatenate([vertices[..., corner, :] for vertices, corner in zip(posed, corners, strict=True)], axis=-2)


def test_every_mesh_moves_as_its_rig_does(written: tuple[Asset, Path, float]) -> None:
    asset, path, tolerance = written
    glb = read_glb(path)
    for pose in sample_poses(4, seed=3):
        found = np.concatenate(world_positions(glb, state_at_pose(glb, pose)))
        meant = of_meshes(asset, [rig.posed(pose) for rig in asset.rigs])
        np.testing.assert_allclose(found, meant, atol=tolerance, rtol=0)


def test_the_animation_drives_every_mesh(written: tuple[Asset, Path, float]) -> None:
    asset, path, tolerance = written
    glb, motion = read_glb(path), make_motion()
    channels = [glb.nodes[channel.node].name for channel in glb.animations[0].channels if channel.path == "weights"]
    assert channels == ["gown", "slip"]
    for frame in (0, 13, 29):
        found = np.concatenate(world_positions(glb, state_at_time(glb, frame / 30)))
        posed = [rig.posed(motion.poses[frame], motion.trans[frame]) for rig in asset.rigs]
        np.testing.assert_allclose(found, of_meshes(asset, posed), atol=tolerance, rtol=0)


def test_engines_move_every_mesh(tmp_path: Path) -> None:
    engine_runs.require_engines()
    asset, motion = together(), make_motion()
    write_glb(asset, tmp_path / "a.glb")
    engine_runs.assert_valid(engine_runs.khronos_reports([tmp_path / "a.glb"], tmp_path)[0])
    times = [float(np.float32(frame / 30)) for frame in (7, 29)]
    meant = of_meshes(asset, [rig.posed(motion.poses[[7, 29]], motion.trans[[7, 29]]) for rig in asset.rigs])
    for engine in ("three_cpu.mjs", "gltf_transform.mjs"):
        [found] = engine_runs.animated_positions(engine, [tmp_path / "a.glb"], times, tmp_path)
        np.testing.assert_allclose(found, meant, atol=FLOAT, rtol=0)


def test_a_file_of_several_meshes_has_one_skeleton_and_no_findings(written: tuple[Asset, Path, float]) -> None:
    _, path, _ = written
    glb = read_glb(path)
    assert len(glb.skins) == 1
    assert [glb.nodes[index].name for index in glb.mesh_nodes] == ["gown", "slip", "body"]
    assert validate_glb(glb) == ()
    summary = inspect_glb(glb)
    assert [(keys.mesh, keys.layers[-1]) for keys in summary.pose_keys] == [("gown", 8), ("slip", 3)]
    assert {morph.mesh for morph in summary.morphs} == {"gown", "slip"}
    assert sum(summary.bytes_by_kind.values()) == summary.bytes


def test_diff_sees_every_mesh(tmp_path: Path) -> None:
    asset = together()
    shapes = asset.also[0].rig.blend_shapes.copy()
    shapes[2, 0] += 0.001
    changed = replace(asset.also[0], rig=replace(asset.also[0].rig, blend_shapes=shapes))
    write_glb(asset, tmp_path / "a.glb")
    write_glb(replace(asset, also=(changed, asset.also[1])), tmp_path / "b.glb")
    left, right = read_glb(tmp_path / "a.glb"), read_glb(tmp_path / "b.glb")
    assert diff_glb(left, left) == ()
    assert {difference.where for difference in diff_glb(left, right)} == {"meshes/1/primitives/0/targets/2/POSITION"}


def test_each_mesh_has_its_own_weights_track(tmp_path: Path) -> None:
    keys = np.random.default_rng(0).random((30, 8))
    write_glb(replace(together(), clips=(Clip(make_motion(), (keys,)),)), tmp_path / "a.glb")
    glb = read_glb(tmp_path / "a.glb")
    gown, slip, _ = glb.mesh_nodes
    state = state_at_time(glb, 12 / 30)
    np.testing.assert_allclose(state.weights[gown], keys[12], atol=1e-6)
    own = together().also[0].rig.pose_keys(make_motion().poses[12])
    np.testing.assert_allclose(state.weights[slip], own, atol=1e-5)


def test_only_outfits_are_evaluated(tmp_path: Path) -> None:
    asset = make_asset()
    for path, also in (("a.glb", ()), ("b.glb", (body_mesh(BODY, None),))):
        write_glb(replace(asset, also=also), tmp_path / path)
    alone, with_body = read_outfit(tmp_path / "a.glb"), read_outfit(tmp_path / "b.glb")
    np.testing.assert_array_equal(alone.triangles, with_body.triangles)
    pose = sample_poses(1, seed=2)[0]
    np.testing.assert_array_equal(alone.posed(pose), with_body.posed(pose))


def test_layers_that_touch_stay_apart(tmp_path: Path) -> None:
    asset = make_asset(parts=1)
    double = RiggedMesh("lining", asset.rig, asset.primitives, asset.materials)
    write_glb(replace(asset, also=(double,)), tmp_path / "a.glb")
    outfit = read_outfit(tmp_path / "a.glb")
    assert len(outfit.rest) == 2 * asset.rig.vertex_count
    assert len(outfit.triangles) == 2 * len(asset.rig.triangles)


def test_the_body_is_skinned_as_smpl_skins_it(tmp_path: Path) -> None:
    betas = np.array([1.0, -0.5])
    body = load_default_body("female")
    rig = body_mesh(body, betas).rig
    poses = sample_poses(3, seed=1)
    # 1e-6: the back end's weights are float32
    np.testing.assert_allclose(rig.posed(poses), body.posed(poses, betas, correctives=False), atol=1e-6)
    mean, largest = left_out_correctives(body, poses)
    moved = np.linalg.norm(body.posed(poses) - body.posed(poses, correctives=False), axis=-1)
    assert (mean, largest) == pytest.approx((moved.mean(), moved.max()))


def test_names_are_unique_among_meshes_and_joints() -> None:
    assert unique_names(["shirt", "shirt", "head", "body", "body"]) == ("shirt", "shirt_2", "head_2", "body", "body_2")


def test_several_meshes_leave_the_first_ones_bytes_alone(tmp_path: Path) -> None:
    """A file with one mesh has nothing of this: its bytes are pinned by the goldens; here its mesh in a larger file."""
    asset = make_asset()
    write_glb(asset, tmp_path / "a.glb")
    write_glb(replace(asset, also=(body_mesh(BODY, None),)), tmp_path / "b.glb")
    alone, beside = read_glb(tmp_path / "a.glb"), read_glb(tmp_path / "b.glb")
    resting = [
        np.concatenate(world_positions(glb, rest_state(glb)))[: len(corner_vertices(asset))] for glb in (alone, beside)
    ]
    np.testing.assert_array_equal(*resting)
