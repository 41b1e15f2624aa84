"""The default body, pose correctives and rotations."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from garmentc.errors import GarmentcError
from garmentc.smpl import load_body, load_default_body
from garmentc.smpl import rotations as r
from garmentc.smpl.correctives import PoseCorrectives
from garmentc.smpl.default_body import DEFAULT_BODY_PATH
from garmentc.smpl.gender import GENDERS
from garmentc.smpl.skeleton import JOINT_NAMES, MIRROR, PARENTS
from garmentc.smpl.skinning import joint_transforms, skin

ID = {name: k for k, name in enumerate(JOINT_NAMES)}


@pytest.mark.parametrize("gender", GENDERS)
def test_shapes_and_conventions(gender: str) -> None:
    """24 joints, T-pose, metres, Y up, +Z front, the pelvis at the origin, weights that sum to 1."""
    body = load_default_body(gender)
    assert body.v_template.shape == (7002, 3)
    assert body.faces.shape == (14000, 3)
    assert body.shapedirs.shape == (7002, 3, 10)
    assert body.J_shapedirs.shape == (24, 3, 10)
    assert body.posedirs.shape == (7002, 3, 207)
    assert body.dtype == np.float64
    np.testing.assert_allclose(body.weights.sum(axis=1), 1, atol=1e-12)
    assert (body.weights >= 0).all()
    joints = body.joints()
    np.testing.assert_allclose(joints[0], 0, atol=1e-6)
    np.testing.assert_allclose(joints[MIRROR] * [-1, 1, 1], joints, atol=1e-6)
    assert joints[ID["left_wrist"], 0] > joints[ID["left_elbow"], 0] > joints[ID["left_shoulder"], 0] > 0.1
    arm = joints[[ID["left_shoulder"], ID["left_elbow"], ID["left_wrist"]]]
    np.testing.assert_allclose(arm[:, 1], arm[0, 1], atol=1e-3)
    assert joints[ID["left_foot"], 2] > joints[ID["left_ankle"], 2] + 0.05
    height = np.ptp(body.v_template[:, 1])
    assert 1.55 < height < 1.85


@pytest.mark.parametrize("gender", GENDERS)
def test_mesh_is_closed_and_faces_outwards(gender: str) -> None:
    import trimesh

    body = load_default_body(gender)
    for betas in (None, np.full(10, 1.5), np.full(10, -1.5)):
        mesh = trimesh.Trimesh(body.shaped(betas), body.faces, process=False)
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        assert 0.03 < mesh.volume < 0.13  # cubic metres


def test_joints_stay_inside_a_reshaped_body() -> None:
    """Joints follow the shape: they lie within the body for every single coefficient."""
    import trimesh

    body = load_default_body("female")
    for k in range(10):
        betas = np.eye(10)[k] * 2
        mesh = trimesh.Trimesh(body.shaped(betas), body.faces, process=False)
        inner = body.joints(betas)[[0, 1, 2, 4, 5, 6, 9, 16, 17, 18, 19]]
        assert mesh.contains(inner).all()


def test_reference(shared: Path) -> None:
    """The shipped body is the shared reference body, within a hundredth of a millimetre."""
    with np.load(shared / "data/body/reference_body.npz") as file:
        for gender in GENDERS:
            body = load_default_body(gender)
            np.testing.assert_array_equal(body.faces, file["faces"])
            np.testing.assert_allclose(body.v_template, file[f"{gender}_v_template"], atol=1e-5)
            np.testing.assert_allclose(body.joints(), file[f"{gender}_J"], atol=1e-5)
            np.testing.assert_allclose(body.shapedirs, file[f"{gender}_shapedirs"], atol=1e-4)


def test_posing_against_scipy_rotations() -> None:
    """Rigid parts move rigidly: the head's vertices follow the chain of rotations computed by scipy."""
    body = load_default_body("male")
    poses = np.random.default_rng(0).normal(scale=0.4, size=(24, 3))
    world, place = Rotation.identity(), np.zeros(3)
    joints = body.joints()
    for joint in (0, 3, 6, 9, 12, 15):
        parent = PARENTS[joint]
        place = joints[0] if parent < 0 else place + world.apply(joints[joint] - joints[parent])
        world = world * Rotation.from_rotvec(poses[joint])
    rigid = body.weights[:, ID["head"]] > 0.9999
    assert rigid.sum() > 100
    expected = world.apply(body.v_template[rigid] - joints[15]) + place + [1, 2, 3]
    ours = body.posed(poses, None, np.array([1.0, 2, 3]), correctives=False)[rigid]
    np.testing.assert_allclose(ours, expected, atol=1e-4)


def test_correctives_keep_the_volume_of_a_bent_elbow() -> None:
    """What the correctives are for: plain skinning loses volume at a joint that bends far; they win some back."""
    import trimesh

    body = load_default_body("neutral")
    pose = np.zeros((24, 3))
    pose[ID["left_elbow"], 1] = -2.0
    pose[ID["left_knee"], 0] = pose[ID["right_knee"], 0] = 2.0
    volumes = [
        trimesh.Trimesh(body.posed(pose, correctives=on), body.faces, process=False).volume for on in (False, True)
    ]
    rest = trimesh.Trimesh(body.v_template, body.faces, process=False).volume
    assert volumes[0] < volumes[1] < rest * 1.01


def test_correctives_sparse_and_dense_agree() -> None:
    random = np.random.default_rng(1)
    dense = random.normal(size=(40, 3, 207)) * (random.random((40, 1, 207)) < 0.05)
    sparse = PoseCorrectives.from_dense(dense)
    np.testing.assert_array_equal(sparse.dense(40), dense)
    rotations = (
        Rotation.from_rotvec(np.random.default_rng(2).normal(scale=2, size=(24 * 6, 3)))
        .as_matrix()
        .reshape(2, 3, 24, 3, 3)
    )
    vertices = np.zeros((2, 3, 40, 3))
    sparse.add_to(vertices, rotations)
    features = (rotations - np.eye(3))[..., 1:, :, :].reshape(2, 3, 207)
    np.testing.assert_allclose(vertices, np.einsum("vcf,abf->abvc", dense, features), atol=1e-12)


def test_float32_is_close() -> None:
    body = load_default_body("female")
    poses = np.random.default_rng(3).normal(scale=0.5, size=(4, 24, 3))
    betas = np.linspace(-2, 2, 10)
    fast = body.astype(np.float32).posed(poses, betas)
    assert fast.dtype == np.float32
    np.testing.assert_allclose(fast, body.posed(poses, betas), atol=5e-6)


def test_betas() -> None:
    body = load_default_body("female")
    np.testing.assert_array_equal(body.shaped(np.ones(2)), body.shaped(np.array([1.0, 1, 0, 0])))
    np.testing.assert_array_equal(body.shaped(np.array([1.0] + [0] * 15)), body.shaped(np.ones(1)))
    with pytest.raises(GarmentcError, match=r"got 16 shape coefficients .* 'default female' has 10"):
        body.shaped(np.ones(16))


def test_loading() -> None:
    assert load_body() is load_default_body("neutral")
    assert load_body(None, "male") is load_default_body("male")
    with pytest.raises(GarmentcError, match="unknown gender 'x'"):
        load_default_body("x")
    body = load_default_body("male")
    with pytest.raises(ValueError, match="read-only"):
        body.v_template[0] = 0
    assert body.astype(np.float32).v_template.flags.writeable


def test_loading_needs_numpy_only() -> None:
    """Start-up time: the body comes without scipy, trimesh and the rest."""
    code = (
        "import sys; from garmentc.smpl import load_default_body; load_default_body('female').joints();"
        "print([m for m in ('scipy', 'trimesh', 'onnxruntime', 'torch', 'fastjsonschema') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_package_data_is_small() -> None:
    assert DEFAULT_BODY_PATH.stat().st_size <= 2_500_000


def test_rotations_against_scipy() -> None:
    random = np.random.default_rng(5)
    vectors = np.concatenate(
        [random.normal(scale=2, size=(50, 3)), random.normal(scale=1e-9, size=(5, 3)), np.zeros((1, 3))]
    )
    expected = Rotation.from_rotvec(vectors)
    np.testing.assert_allclose(r.axis_angle_to_matrix(vectors), expected.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(
        r.quaternion_to_matrix(r.axis_angle_to_quaternion(vectors)), expected.as_matrix(), atol=1e-12
    )
    np.testing.assert_allclose(
        r.quaternion_to_matrix(r.matrix_to_quaternion(expected.as_matrix())), expected.as_matrix(), atol=1e-12
    )
    np.testing.assert_allclose(r.quaternion_to_axis_angle(expected.as_quat()), expected.as_rotvec(), atol=1e-12)
    product = r.quaternion_to_matrix(r.multiply_quaternions(expected.as_quat(), expected.as_quat()[::-1]))
    np.testing.assert_allclose(product, (expected * expected[::-1]).as_matrix(), atol=1e-12)
    for k in range(20):
        pair = expected[[k, k + 20]]
        between = r.slerp(*r.axis_angle_to_quaternion(vectors[[k, k + 20]])[:, None], np.array([0.0, 0.3, 1]))
        np.testing.assert_allclose(
            r.quaternion_to_matrix(between), Slerp([0, 1], pair)([0, 0.3, 1]).as_matrix(), atol=1e-9
        )


def test_half_turns() -> None:
    """Rotations by exactly pi, where a division by the sine would fail."""
    for axis in np.concatenate([np.eye(3), [[0.6, 0.8, 0]]]):
        matrix = Rotation.from_rotvec(np.pi * axis).as_matrix()
        back = r.quaternion_to_axis_angle(r.matrix_to_quaternion(matrix))
        np.testing.assert_allclose(np.abs(back), np.pi * axis, atol=1e-7)


def test_skinning_batches() -> None:
    """Batched and single evaluation agree, whatever is batched."""
    random = np.random.default_rng(6)
    rotations = (
        Rotation.from_rotvec(np.random.default_rng(7).normal(scale=2, size=(24 * 3, 3)))
        .as_matrix()
        .reshape(3, 24, 3, 3)
    )
    joints, vertices = random.normal(size=(24, 3)), random.normal(size=(10, 3))
    weights = random.dirichlet(np.ones(24), 10)
    trans = random.normal(size=(3, 3))
    together = skin(vertices, weights, joint_transforms(rotations, joints, trans))
    for k in range(3):
        alone = skin(vertices, weights, joint_transforms(rotations[k], joints, trans[k]))
        np.testing.assert_allclose(together[k], alone, atol=1e-12)
        np.testing.assert_allclose(
            skin(vertices[None], weights, joint_transforms(rotations[k], joints, trans[k])[None])[0], alone, atol=1e-12
        )
