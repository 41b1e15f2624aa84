"""Keys from a network's first hidden layer: the outfit moves as before, and poses are told apart better."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_samples import make_rig

from garmentc.families.bundle import load_bundle
from garmentc.passes.hidden_keys import HiddenKeys, hidden_keys
from garmentc.passes.key_regression import KeyRegression
from garmentc.passes.pose_set import plausible_poses
from garmentc.resting_layer import resting_layer
from garmentc.rig import DenseLayer, KeyNetwork, Rig

POSES = plausible_poses(fit=600, check=24)
UNITS = 40


def with_layers(*layers: DenseLayer) -> Rig:
    """A rig whose keys are those of these layers, less what they are at rest."""
    hidden = KeyNetwork(layers)
    at_rest = hidden(np.zeros((24, 3)))
    network = KeyNetwork((*layers, resting_layer(np.eye(len(at_rest)), at_rest)))
    return replace(make_rig(morphs=len(at_rest)), keys=network)


def layer(inputs: int, outputs: int, activation: str, size: float = 1.2) -> DenseLayer:
    random = np.random.default_rng([inputs, outputs])
    weight = random.normal(0, size / np.sqrt(inputs), (outputs, inputs)).astype(np.float32)
    return DenseLayer(weight, random.normal(0, 0.1, outputs).astype(np.float32), activation)


@pytest.fixture(scope="module")
def rig() -> Rig:
    """All that its later layers do is to mix the units of the first."""
    return with_layers(layer(72, UNITS, "relu"), layer(UNITS, UNITS, "linear"))


def test_what_is_a_mixture_of_hidden_units_moves_as_before(rig: Rig) -> None:
    hidden, report = hidden_keys(rig, HiddenKeys(ridge=1e-7), POSES)
    moved = np.linalg.norm(rig.posed(POSES.check) - rig.posed(np.zeros((24, 3))), axis=-1)
    assert hidden is not rig
    np.testing.assert_allclose(hidden.posed(POSES.check), rig.posed(POSES.check), atol=1e-3 * moved.mean())
    assert report.error is not None
    assert report.error.mean_mm < moved.mean()  # millimetres against metres: a thousandth


def test_one_hidden_layer_is_left_and_the_rest_pose_has_no_keys(rig: Rig) -> None:
    hidden, _ = hidden_keys(rig, HiddenKeys(), POSES)
    assert hidden.keys is not None
    assert rig.keys is not None
    assert [each.activation for each in hidden.keys.layers] == ["relu", "linear"]
    assert hidden.keys.layers[0] is rig.keys.layers[0]
    assert hidden.morph_count == rig.morph_count
    assert np.abs(hidden.pose_keys(np.zeros((24, 3)))).max() < 1e-6


def test_later_layers_that_do_more_are_kept() -> None:
    """Many units that bend sharply, made from four: no mixture of the four does that."""
    deep = with_layers(layer(72, 4, "relu"), layer(4, 64, "relu", size=8), layer(64, 24, "normalized_relu", size=8))
    kept, report = hidden_keys(deep, HiddenKeys(), POSES)
    assert kept is deep
    assert "kept" in report.detail


def test_nothing_to_gain_changes_nothing(rig: Rig) -> None:
    assert rig.keys is not None
    first, _, last = rig.keys.layers
    still = replace(last, weight=np.zeros_like(last.weight), bias=np.zeros(UNITS, np.float32))
    networks = KeyNetwork((first, last)), replace(rig.keys, layers=(*rig.keys.layers[:-1], still))
    for unchanged in (make_rig(morphs=0), *(replace(rig, keys=network) for network in networks)):
        assert hidden_keys(unchanged, HiddenKeys(), POSES)[0] is unchanged


def test_the_shipped_network_has_more_to_say_that_way() -> None:
    """Principal combinations that a regression can use, on poses of which there are enough."""
    network = load_bundle(None).network
    rig = replace(make_rig(morphs=network.output_size), keys=network)
    hidden, _ = hidden_keys(rig, HiddenKeys(), POSES)
    assert hidden is not rig
    before, after = (len(KeyRegression.on(each.pose_keys(POSES.fit), 0.2).kept) for each in (rig, hidden))
    assert after > 2 * before
