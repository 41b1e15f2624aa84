"""Mirrored outfits move as the mirror image of the outfit moves."""

from __future__ import annotations

import numpy as np
import pytest
from simulation_stand_in import skinned_patch

from garmentc.outfit.topology import vertex_normals
from garmentc.rig import encode_pose
from garmentc.simulation.plan import make_plan
from garmentc.simulation.presets import PRESETS
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import MIRROR
from garmentc.smpl.skinning import joint_transforms, skin

torch = pytest.importorskip("torch")

from garmentc.training.mirroring import (  # noqa: E402
    mirrored_poses,
    mirrored_sample,
    mirrored_transforms,
    mirrored_vertices,
)
from garmentc.training.outfit_sample import PosableBody, make_sample  # noqa: E402

FLIP = np.array([-1, 1, 1])


@pytest.fixture(scope="module")
def poses() -> np.ndarray:
    drawn = sample_poses(6, seed=2)
    drawn[:, 0] += np.random.default_rng(0).normal(size=(6, 3))  # any heading
    return drawn


def test_transforms_are_those_of_the_mirrored_skeleton(poses: np.ndarray) -> None:
    joints = load_default_body("female").joints(np.array([1.0, -1.0, 0.5]))
    ours = mirrored_transforms(joint_transforms(axis_angle_to_matrix(poses), joints)[:, :, :3])
    other_side = joints[MIRROR] * FLIP
    expected = joint_transforms(axis_angle_to_matrix(mirrored_poses(poses)), other_side)[:, :, :3]
    np.testing.assert_allclose(ours, expected, atol=1e-6)


def test_skinning_commutes_with_mirroring(poses: np.ndarray) -> None:
    sequence = skinned_patch(next(make_plan(PRESETS["small"], seed=1, outfits=1).tasks))
    body = PosableBody.of(load_default_body(sequence.facts.gender), sequence.betas)
    sample = make_sample("patch", sequence.template, sequence.faces, body)
    other = mirrored_sample(sample)
    transforms = body.transforms(poses)[:, :, :3]
    posed = skin(np.broadcast_to(sample.vertices.numpy(), (6, *sample.vertices.shape)), sample.skin.numpy(), transforms)
    mirrored = skin(
        np.broadcast_to(other.vertices.numpy(), (6, *other.vertices.shape)),
        other.skin.numpy(),
        mirrored_transforms(transforms),
    )
    np.testing.assert_allclose(mirrored, mirrored_vertices(posed), atol=1e-5)
    normals = vertex_normals(other.vertices.numpy().astype(np.float64), other.triangles.numpy())
    np.testing.assert_allclose(other.normals.numpy(), normals, atol=1e-4)


def test_mirroring_twice_changes_nothing_and_gravity_stays(poses: np.ndarray) -> None:
    np.testing.assert_array_equal(mirrored_poses(mirrored_poses(poses)), poses)
    np.testing.assert_allclose(encode_pose(mirrored_poses(poses))[:, :3], encode_pose(poses)[:, :3] * FLIP, atol=1e-12)
