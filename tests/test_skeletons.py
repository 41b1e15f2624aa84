"""Joints under the names of other tools."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import engine_runs
import numpy as np
import pytest
from cli_samples import CommandLine, write_top
from gltf_samples import make_asset
from scipy.spatial import cKDTree

import garmentc
from garmentc.evaluation.posed_outfit import read_outfit
from garmentc.gltf.diff import diff_glb
from garmentc.gltf.evaluate import world_mesh
from garmentc.gltf.glb import read_chunks
from garmentc.gltf.posing import smpl_joints, state_at_pose
from garmentc.gltf.read import read_glb
from garmentc.gltf.skeletons import MIXAMO, SKELETONS, UNREAL, VRM, Skeleton
from garmentc.gltf.state import rest_state
from garmentc.gltf.validate import validate_glb
from garmentc.gltf.write import write_glb
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.smpl.skeleton import JOINT_NAMES, MIRROR, PARENTS

OTHERS = [VRM, MIXAMO, UNREAL]
GROUND = -1.21


def sample(skeleton: Skeleton, folder: Path) -> Path:
    asset = make_asset(key_tolerance=0, skeleton=skeleton)
    write_glb(replace(asset, ground=GROUND), folder / f"{skeleton.name}.glb")
    return folder / f"{skeleton.name}.glb"


def called(skeleton: Skeleton, joint: str) -> str:
    return skeleton.joints[JOINT_NAMES.index(joint)]


def test_names_are_at_their_joints() -> None:
    """By hand, for the joints that are easily confused."""
    for joint, names in {
        "pelvis": ("hips", "mixamorig:Hips", "pelvis"),
        "spine3": ("upperChest", "mixamorig:Spine2", "spine_03"),
        "left_hip": ("leftUpperLeg", "mixamorig:LeftUpLeg", "thigh_l"),
        "right_knee": ("rightLowerLeg", "mixamorig:RightLeg", "calf_r"),
        "left_foot": ("leftToes", "mixamorig:LeftToeBase", "ball_l"),
        "right_collar": ("rightShoulder", "mixamorig:RightShoulder", "clavicle_r"),
        "left_shoulder": ("leftUpperArm", "mixamorig:LeftArm", "upperarm_l"),
        "right_elbow": ("rightLowerArm", "mixamorig:RightForeArm", "lowerarm_r"),
        "left_wrist": ("leftHand", "mixamorig:LeftHand", "hand_l"),
    }.items():
        assert tuple(called(skeleton, joint) for skeleton in OTHERS) == names


@pytest.mark.parametrize("skeleton", SKELETONS.values(), ids=list(SKELETONS))
def test_sides_are_mirrored(skeleton: Skeleton) -> None:
    def other(name: str) -> str:
        if name.endswith(("_l", "_r")):
            return name[:-1] + ("r" if name[-1] == "l" else "l")
        swap = {"left": "right", "right": "left", "Left": "Right", "Right": "Left"}
        return next((name.replace(side, swap[side]) for side in swap if side in name), name)

    assert len(set(skeleton.joints)) == 24
    assert [skeleton.joints[joint] for joint in MIRROR] == [other(name) for name in skeleton.joints]


@pytest.mark.parametrize("skeleton", OTHERS, ids=lambda skeleton: skeleton.name)
def test_only_names_and_place_differ(skeleton: Skeleton, tmp_path: Path) -> None:
    smpl, other = read_glb(sample(SKELETONS["smpl"], tmp_path)), read_glb(sample(skeleton, tmp_path))
    joints = smpl_joints(other)
    assert tuple(other.nodes[joint].name for joint in joints) == skeleton.joints
    for joint, parent in enumerate(PARENTS[1:], start=1):
        assert other.nodes[joints[joint]].parent == joints[parent]
    assert validate_glb(other) == ()
    for pose in sample_poses(3, seed=6):
        there, here = (world_mesh(glb, state_at_pose(glb, pose))[0] for glb in (smpl, other))
        np.testing.assert_allclose(here - [0, -GROUND, 0], there, atol=1e-6)
    assert {difference.where for difference in diff_glb(smpl, other)} == {"nodes"}


def test_unreal_has_a_root(tmp_path: Path) -> None:
    glb = read_glb(sample(UNREAL, tmp_path))
    assert glb.nodes[glb.nodes[smpl_joints(glb)[0]].parent or 0].name == "root"


@pytest.mark.parametrize("skeleton", OTHERS, ids=lambda skeleton: skeleton.name)
def test_evaluation_is_in_the_bodys_axes(skeleton: Skeleton, tmp_path: Path) -> None:
    smpl, other = (read_outfit(sample(each, tmp_path)) for each in (SKELETONS["smpl"], skeleton))
    pose = sample_poses(1, seed=6)[0]
    apart, same = cKDTree(smpl.rest).query(other.rest)
    assert len(smpl.rest) == len(other.rest)
    assert apart.max() < 1e-6
    np.testing.assert_allclose(other.posed(pose), smpl.posed(pose)[same], atol=1e-6)


def test_renamed_joints_are_found_by_the_skin(tmp_path: Path) -> None:
    """As three.js writes Mixamo's names."""
    path = sample(MIXAMO, tmp_path)
    data = path.read_bytes()
    text = data.replace(b'"name":"mixamorig:', b'"name":"mixamorig_')
    path.write_bytes(text.replace(b'GARMENTC_mesh_pose_keys":{', b'ANOTHER_mesh_pose_keys_":{'))
    glb = read_glb(path)
    assert glb.meshes[0].pose_keys is None
    network = glb.nodes[glb.mesh_nodes[0]].pose_keys
    assert network is not None
    assert network.joints == glb.skins[0].joints


def test_half_renamed_joints_are_a_finding(tmp_path: Path) -> None:
    path = sample(VRM, tmp_path)
    path.write_bytes(path.read_bytes().replace(b'"name":"upperChest"', b'"name":"upperchest"'))
    finding = next(finding for finding in validate_glb(read_glb(path)) if finding.code == "joint-names")
    assert "joint 9 is 'upperchest' where 'upperChest' is expected" in finding.message


def test_vrm_is_an_avatar(tmp_path: Path) -> None:
    document = read_chunks(sample(VRM, tmp_path)).document
    vrm = document["extensions"]["VRMC_vrm"]
    assert "VRMC_vrm" in document["extensionsUsed"]
    assert vrm["specVersion"] == "1.0"
    assert vrm["meta"] == {"name": "gown", "authors": ["unknown"], "licenseUrl": "https://vrm.dev/licenses/1.0/"}
    required = ["hips", "spine", "head", "leftUpperLeg", "rightFoot", "leftUpperArm", "rightLowerArm", "leftHand"]
    for bone in required:
        assert document["nodes"][vrm["humanoid"]["humanBones"][bone]["node"]]["name"] == bone
    assert "extensions" not in read_chunks(sample(MIXAMO, tmp_path)).document


def test_engines_load_every_skeleton(tmp_path: Path) -> None:
    engine_runs.require_engines()
    paths = [sample(skeleton, tmp_path) for skeleton in OTHERS]
    for report in engine_runs.khronos_reports(paths, tmp_path):
        engine_runs.assert_valid(report)


def test_the_compiled_figure_stands_on_the_ground(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run, top = CommandLine(capsys), write_top(tmp_path)
    arguments = ["compile", top, "-o", tmp_path / "a.glb", "--gender", "female", "--with-body", "--json"]
    result = run(*arguments, "--skeleton", "vrm")
    codes = [warning["code"] for warning in json.loads(result.out)["warnings"]]
    assert codes == ["vrm-meta", "vrm-quantized"]
    assert json.loads(run(*arguments, "--skeleton", "vrm", "--no-quantize").out)["warnings"][0]["code"] == "vrm-meta"
    glb = read_glb(tmp_path / "a.glb")
    vertices, _ = world_mesh(glb, rest_state(glb))
    assert abs(vertices[:, 1].min()) < 1e-6
    garmentc.compile_outfit(top, tmp_path / "b.glb", gender="female", with_body=True, skeleton="smpl", quantize=False)
    plain = read_glb(tmp_path / "b.glb")
    assert world_mesh(plain, rest_state(plain))[0][:, 1].min() < -0.8
