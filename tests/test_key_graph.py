"""The ONNX form of the pose-key network, run by onnxruntime, against the network in numpy."""

from __future__ import annotations

import numpy as np
import onnxruntime
import pytest

from garmentc.key_graph import key_graph
from garmentc.rig import DenseLayer, KeyNetwork
from garmentc.smpl.pose_sampler import sample_poses


@pytest.fixture(params=["linear", "nonnegative"])
def network(request: pytest.FixtureRequest) -> KeyNetwork:
    rng = np.random.default_rng(0)

    def layer(inputs: int, outputs: int, activation: str) -> DenseLayer:
        weight = rng.normal(scale=inputs**-0.5, size=(outputs, inputs))
        return DenseLayer(weight.astype(np.float32), rng.normal(size=outputs).astype(np.float32), activation)

    return KeyNetwork((layer(72, 40, "relu"), layer(40, 30, "normalized_relu"), layer(30, 8, request.param)))


def run(network: KeyNetwork, poses: np.ndarray) -> np.ndarray:
    session = onnxruntime.InferenceSession(key_graph(network), providers=["CPUExecutionProvider"])
    return session.run(["keys"], {"pose": poses.astype(np.float32)})[0]


def test_equals_the_network_in_numpy(network: KeyNetwork) -> None:
    poses = sample_poses(200, seed=3)
    poses[:, 0] = np.random.default_rng(1).normal(scale=2, size=(200, 3))  # any heading and tilt, beyond half a turn
    poses[0] = 0
    np.testing.assert_allclose(run(network, poses), network(poses), atol=2e-6)


def test_a_turn_of_the_whole_body_about_the_vertical_changes_nothing(network: KeyNetwork) -> None:
    poses = sample_poses(1, seed=4).repeat(8, axis=0)
    poses[:, 0] = [[0, angle, 0] for angle in np.linspace(-3, 3, 8)]
    keys = run(network, poses)
    np.testing.assert_allclose(keys, keys[:1].repeat(8, axis=0), atol=1e-6)


def test_equal_networks_give_equal_bytes(network: KeyNetwork) -> None:
    assert key_graph(network) == key_graph(network)
