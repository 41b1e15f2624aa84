"""Which pieces of an outfit are no cloth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from worn import JOINTS, trousers, tube

from garmentc.passes.pose_set import plausible_poses
from garmentc.passes.rigid_pieces import rigid_pieces
from garmentc.rig import Rig
from garmentc.smpl.skeleton import JOINT_NAMES

POSES = plausible_poses(fit=64, check=8)
HEAD, SHOULDER = JOINT_NAMES.index("head"), JOINT_NAMES.index("left_shoulder")


def with_hat(weights: np.ndarray) -> tuple[Rig, np.ndarray]:
    """Trousers, and a tube around the head that moves with `weights` (n, 24); and which vertices are its."""
    rig = trousers()
    vertices, triangles = tube(JOINTS[HEAD], JOINTS[HEAD, 1] + 0.2, 0.1, 0.12)
    count = rig.vertex_count
    both = replace(
        rig,
        template=np.concatenate([rig.template, vertices]),
        triangles=np.concatenate([rig.triangles, triangles + count]).astype(np.int32),
        weights=np.concatenate([rig.weights, np.broadcast_to(weights, (len(vertices), 24))]).astype(np.float32),
        blend_shapes=np.zeros((rig.morph_count, count + len(vertices), 3), np.float32),
    )
    return both, np.arange(both.vertex_count) >= count


def test_a_hat_is_rigid_and_trousers_are_not() -> None:
    rig, hat = with_hat(np.eye(24)[HEAD])
    np.testing.assert_array_equal(rigid_pieces(rig, POSES), hat)


def test_what_bends_with_two_joints_is_cloth() -> None:
    share = np.linspace(0, 1, 12 * 48)[:, None]
    rig, _ = with_hat(share * np.eye(24)[HEAD] + (1 - share) * np.eye(24)[SHOULDER])
    assert not rigid_pieces(rig, POSES).any()
