"""Fewer blend shapes: optimal, zero at rest, sensible sliders, the same bytes on any machine."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gltf_samples import make_keys, make_rig

from garmentc.errors import GarmentcError
from garmentc.passes.pose_set import plausible_poses
from garmentc.passes.reduce_blend_shapes import ReduceBlendShapes, reduce_blend_shapes
from garmentc.rig import Rig

POSES = plausible_poses(fit=300, check=16)


def displacements(rig: Rig, poses: np.ndarray) -> np.ndarray:
    """(P, 3 N), float64."""
    return rig.pose_keys(poses) @ rig.blend_shapes.reshape(rig.morph_count, -1).astype(np.float64)


@pytest.fixture(scope="module")
def rig() -> Rig:
    return make_rig(morphs=24)


@pytest.mark.parametrize("count", [1, 4, 12])
def test_no_other_shapes_of_that_number_are_better(rig: Rig, count: int) -> None:
    """Eckart and Young: the best rank-r approximation of the displacements is their truncated SVD."""
    reduced, _ = reduce_blend_shapes(rig, ReduceBlendShapes(count=count), POSES)
    exact = displacements(rig, POSES.fit)
    left, sizes, right = np.linalg.svd(exact, full_matrices=False)
    best = (left[:, :count] * sizes[:count]) @ right[:count]
    ours = np.linalg.norm(exact - displacements(reduced, POSES.fit))
    assert reduced.morph_count == count
    assert ours <= 1.001 * np.linalg.norm(exact - best)


def test_keys_are_zero_at_rest_and_reach_one(rig: Rig) -> None:
    reduced, _ = reduce_blend_shapes(rig, ReduceBlendShapes(count=6), POSES)
    keys = reduced.pose_keys(POSES.fit)
    assert np.abs(reduced.pose_keys(np.zeros((24, 3)))).max() < 1e-6
    np.testing.assert_allclose(np.percentile(np.abs(keys), 99, axis=0), 1, rtol=1e-4)
    assert (keys.mean(axis=0) > 0).all()


def test_shapes_come_in_order_of_the_movement_they_explain(rig: Rig) -> None:
    reduced, _ = reduce_blend_shapes(rig, ReduceBlendShapes(count=8), POSES)
    keys = reduced.pose_keys(POSES.fit)
    energy = (keys**2).mean(axis=0) * (reduced.blend_shapes.astype(np.float64) ** 2).sum(axis=(1, 2))
    assert (np.diff(energy) < 0).all()


def test_the_fewest_shapes_within_a_tolerance(rig: Rig) -> None:
    tolerance = 0.0005
    reduced, report = reduce_blend_shapes(rig, ReduceBlendShapes(tolerance=tolerance), POSES)

    def p99(count: int) -> float:
        lost = displacements(rig, POSES.fit) - displacements(
            reduce_blend_shapes(rig, ReduceBlendShapes(count=count), POSES)[0], POSES.fit
        )
        return float(np.percentile(np.linalg.norm(lost.reshape(len(lost), -1, 3), axis=-1), 99))

    assert 0 < reduced.morph_count < rig.morph_count
    assert p99(reduced.morph_count) <= 1.02 * tolerance
    assert p99(reduced.morph_count - 1) > tolerance
    assert report.error is not None
    assert report.error.p99_mm < 1.5 * 1000 * tolerance  # on poses that it has not seen


def test_errors_fall_as_shapes_are_added(rig: Rig) -> None:
    errors = [reduce_blend_shapes(rig, ReduceBlendShapes(count=n), POSES)[1].error for n in (0, 2, 8, 20)]
    means = [error.mean_mm for error in errors if error is not None]
    assert means == sorted(means, reverse=True)
    assert len(means) == 4


def test_dependent_and_unused_keys_do_no_harm(rig: Rig) -> None:
    """Half of the shapes repeat the others, one key never moves: nothing is divided by zero, nothing is lost."""
    assert rig.keys is not None
    last = rig.keys.layers[-1]
    weight, bias = np.concatenate([last.weight, last.weight]), np.concatenate([last.bias, last.bias])
    weight[5], bias[5] = 0, 0
    keys = replace(rig.keys, layers=(*rig.keys.layers[:-1], replace(last, weight=weight, bias=bias)))
    doubled = replace(rig, keys=keys, blend_shapes=np.concatenate([rig.blend_shapes, rig.blend_shapes]))
    _, report = reduce_blend_shapes(doubled, ReduceBlendShapes(count=24), POSES)
    assert report.error is not None
    assert report.error.max_mm < 0.01


def test_a_network_that_does_not_end_in_a_linear_layer_gets_one(rig: Rig) -> None:
    assert rig.keys is not None
    network = make_keys(24, np.random.default_rng(1))
    curved = replace(rig, keys=replace(network, layers=network.layers[:-1]))  # ends in normalized_relu
    reduced, _ = reduce_blend_shapes(curved, ReduceBlendShapes(count=3), POSES)
    assert reduced.keys is not None
    assert [layer.activation for layer in reduced.keys.layers] == ["relu", "normalized_relu", "linear"]
    assert np.abs(reduced.pose_keys(np.zeros((24, 3)))).max() < 1e-6


def test_nothing_to_remove_changes_nothing(rig: Rig) -> None:
    for options in (ReduceBlendShapes(), ReduceBlendShapes(count=24), ReduceBlendShapes(count=99)):
        assert reduce_blend_shapes(rig, options, POSES)[0] is rig


def test_no_blend_shapes_at_all(rig: Rig) -> None:
    reduced, report = reduce_blend_shapes(rig, ReduceBlendShapes(count=0), POSES)
    assert reduced.morph_count == 0
    assert reduced.keys is None
    assert report.error is not None
    assert report.error.mean_mm > 0


@pytest.mark.parametrize("given", [{"count": -1}, {"tolerance": 0.0}, {"count": 3, "tolerance": 0.001}])
def test_settings_that_cannot_be_kept_are_refused(given: dict[str, float]) -> None:
    with pytest.raises(GarmentcError):
        ReduceBlendShapes(**given)


_SCRIPT = """
import hashlib, sys
import numpy as np
from gltf_samples import make_rig
from garmentc.passes.pose_set import plausible_poses
from garmentc.passes.reduce_blend_shapes import ReduceBlendShapes, reduce_blend_shapes
rig, report = reduce_blend_shapes(
    make_rig(morphs=64, columns=60, rows=40), ReduceBlendShapes(count=60), plausible_poses(fit=300, check=4)
)
arrays = [rig.blend_shapes, *(value for layer in rig.keys.layers for value in (layer.weight, layer.bias))]
print(hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)).hexdigest(), report)
"""


def test_bytes_do_not_depend_on_the_number_of_threads() -> None:
    def run(threads: int) -> str:
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
        paths = [str(Path(__file__).parent), str(Path(__file__).parents[1]), *sys.path]
        environment = os.environ | dict.fromkeys(names, str(threads)) | {"PYTHONPATH": os.pathsep.join(paths)}
        command = [sys.executable, "-c", _SCRIPT]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout

    assert run(1) == run(2) != ""
