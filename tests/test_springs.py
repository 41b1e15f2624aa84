"""Edges as springs: what pulls and what does not, and which anchors they join."""

from __future__ import annotations

import numpy as np
from gltf_samples import make_rig

from garmentc.evaluation.metrics import edge_lengths
from garmentc.outfit.topology import edges
from garmentc.passes.anchors import Anchors
from garmentc.passes.springs import Springs
from garmentc.smpl.rotations import axis_angle_to_matrix

PATH = np.array([[0, 1], [1, 2]])


def in_one_pose(vertices: list[list[float]] | np.ndarray) -> np.ndarray:
    """(3, n, 1) from (n, 3)."""
    return np.array(vertices, np.float32).T[:, :, None]


def test_each_end_goes_half_of_an_edges_stretch_and_the_mean_over_its_edges() -> None:
    springs = Springs.of(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]]), PATH)
    pull = springs.pull(in_one_pose([[0, 0, 0], [3, 0, 0], [4, 0, 0]]))
    np.testing.assert_allclose(pull[0, :, 0], [1, -0.5, 0], atol=1e-6)
    squeezed = springs.pull(in_one_pose([[0, 0, 0], [0.5, 0, 0], [1.5, 0, 0]]))
    np.testing.assert_allclose(squeezed[0, :, 0], [-0.25, 0.125, 0], atol=1e-6)


def test_rigid_motion_does_not_pull() -> None:
    rig = make_rig()
    springs = Springs.of(rig.template, edges(rig.triangles))
    turned = rig.template @ axis_angle_to_matrix(np.array([0.3, -1.2, 0.5])).T + np.array([0.1, 2.0, -0.4])
    pull = springs.pull(in_one_pose(turned))
    assert np.abs(pull).max() < 1e-5


def test_roughness_leads_to_the_neighbours_mean() -> None:
    springs = Springs.of(np.zeros((4, 3)), PATH)
    values = in_one_pose([[1, 0, 0], [4, 0, 0], [3, 0, 0], [7, 0, 0]])
    np.testing.assert_allclose(springs.roughness(values)[0, :, 0], [3, -2, 1, 0], atol=1e-6)  # the last stands alone


def test_pulling_again_and_again_restores_the_lengths() -> None:
    rng = np.random.default_rng(3)
    rig = make_rig()
    pairs = edges(rig.triangles)
    springs = Springs.of(rig.template, pairs)
    rest = edge_lengths(rig.template, pairs)
    moved = (rig.template + 0.1 * rest.mean() * rng.standard_normal(rig.template.shape)).astype(np.float32)
    before = np.abs(edge_lengths(moved, pairs) - rest).mean()
    for _ in range(100):
        moved += springs.pull(in_one_pose(moved))[:, :, 0].T
    assert np.abs(edge_lengths(moved, pairs) - rest).mean() < 0.2 * before


def test_anchors_are_joined_where_the_cloth_between_them_is() -> None:
    rig = make_rig()
    pairs = edges(rig.triangles)
    everyone = Anchors.of(rig, rig.vertex_count)
    np.testing.assert_array_equal(everyone.joined(pairs), pairs)
    few = Anchors.of(rig, rig.vertex_count // 3)
    joined = few.joined(pairs)
    assert 0 < len(joined) < len(pairs)
    assert joined.max() < len(few.rows)
    assert (joined[:, 0] < joined[:, 1]).all()
    assert len(np.unique(joined, axis=0)) == len(joined)
