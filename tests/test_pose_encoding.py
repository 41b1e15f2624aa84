"""Encodings of poses, in numpy and as an ONNX graph, against rotations composed by scipy."""

from __future__ import annotations

import numpy as np
import onnxruntime
import pytest
from scipy.spatial.transform import Rotation

from garmentc.key_graph import key_graph
from garmentc.rig import (
    ENCODING_GRAVITY_JOINTS,
    ENCODING_WIDTHS,
    DenseLayer,
    KeyNetwork,
    encode_pose,
)
from garmentc.smpl.skeleton import JOINT_COUNT, PARENTS

UP = np.array([0.0, 1.0, 0.0])


@pytest.fixture(scope="module")
def poses() -> np.ndarray:
    """(60, 24, 3): angles to beyond whole turns, joints at rest among them, and tiny angles."""
    drawn = np.random.default_rng(0).normal(scale=2, size=(60, JOINT_COUNT, 3))
    assert np.linalg.norm(drawn, axis=-1).max() > 2 * np.pi
    drawn[0] = 0
    drawn[1, ::2] = 0
    drawn[2] *= 1e-4
    drawn[3, 0] = 0
    drawn[4, 1:] = 0
    return drawn.astype(np.float32).astype(np.float64)


def in_full(pose: np.ndarray, encoding: str) -> np.ndarray:
    """The encoding by composing whole rotations from the pelvis down."""
    local = [Rotation.from_rotvec(vector) for vector in pose]
    world = local[:1]
    for joint in range(1, JOINT_COUNT):
        world.append(world[PARENTS[joint]] * local[joint])
    numbers = [world[0].inv().apply(UP) - UP]
    for joint in range(1, JOINT_COUNT):
        if encoding == ENCODING_GRAVITY_JOINTS:
            numbers.append(world[joint].inv().apply(UP) - UP)
        numbers.append(local[joint].as_rotvec())
    return np.concatenate(numbers)


def by_onnxruntime(network: KeyNetwork, poses: np.ndarray) -> np.ndarray:
    session = onnxruntime.InferenceSession(key_graph(network), providers=["CPUExecutionProvider"])
    return session.run(["keys"], {"pose": poses.astype(np.float32)})[0]


@pytest.mark.parametrize("encoding", ENCODING_WIDTHS)
def test_encodings_are_those_of_composed_rotations(poses: np.ndarray, encoding: str) -> None:
    expected = np.array([in_full(pose, encoding) for pose in poses])
    assert expected.shape[1] == ENCODING_WIDTHS[encoding]
    np.testing.assert_allclose(encode_pose(poses, encoding), expected, atol=1e-11)
    batched = encode_pose(poses.reshape(3, 20, JOINT_COUNT, 3), encoding)
    np.testing.assert_array_equal(batched.reshape(60, -1), encode_pose(poses, encoding))
    np.testing.assert_allclose(encode_pose(poses.astype(np.float32), encoding), expected, atol=1e-5)
    assert encode_pose(poses.astype(np.float32), encoding).dtype == np.float32


@pytest.mark.parametrize("encoding", ENCODING_WIDTHS)
def test_the_graph_encodes_alike(poses: np.ndarray, encoding: str) -> None:
    width = ENCODING_WIDTHS[encoding]
    same = KeyNetwork((DenseLayer(np.eye(width, dtype=np.float32), np.zeros(width, np.float32)),), encoding)
    np.testing.assert_allclose(by_onnxruntime(same, poses), encode_pose(poses, encoding), atol=5e-6)
