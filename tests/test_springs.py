"""Edges as springs: what pulls and what does not, and which anchors they join."""

from __future__ import annotations

import numpy as np
from gltf_samples import make_rig

from garmentc.outfit.topology import edge_lengths, edges
from garmentc.passes.anchors import Anchors
from garmentc.passes.body_contacts import CLOSEST
from garmentc.passes.bulging import Bulging
from garmentc.passes.springs import Springs, mean_edge_lengths
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


RADIUS, ACROSS = 0.05, 12
"""A tube: its rings have so many vertices, as far apart as the rings."""


def lattice(index: np.ndarray) -> np.ndarray:
    """Edges (E, 2) along and across a tube of vertices with numbers (rings, around)."""
    across = np.stack([index, np.roll(index, -1, axis=1)], axis=-1).reshape(-1, 2)
    along = np.stack([index[:-1], index[1:]], axis=-1).reshape(-1, 2)
    return np.concatenate([across, along])


def tube() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (N, 3), edges (E, 2) and outward normals (N, 3)."""
    angle = 2 * np.pi * np.arange(ACROSS) / ACROSS
    normals = np.stack([np.cos(angle), np.zeros(ACROSS), np.sin(angle)], axis=1)
    ring = np.linalg.norm(RADIUS * (normals[0] - normals[1]))
    vertices = np.concatenate([RADIUS * normals + [0, ring * row, 0] for row in range(5)])
    return vertices, lattice(np.arange(5 * ACROSS).reshape(5, ACROSS)), np.tile(normals, (5, 1))


def test_sag_is_how_far_a_limb_rises_over_the_edges_across_it() -> None:
    vertices, pairs, normals = tube()
    sag = Springs.of(vertices, pairs).sag(in_one_pose(vertices), in_one_pose(normals))[:, 0]
    rise = RADIUS * (1 - np.cos(np.pi / ACROSS))
    np.testing.assert_allclose(sag[ACROSS:-ACROSS], rise, rtol=0.02)  # not at the ends, where edges are fewer


def test_nothing_rises_where_skin_is_hollow_or_not_touched() -> None:
    vertices, pairs, normals = tube()
    springs = Springs.of(vertices, pairs)
    assert not springs.sag(in_one_pose(vertices), in_one_pose(-normals)).any()
    touched = normals * (np.arange(len(normals)) % 2)[:, None]
    only_along = springs.sag(in_one_pose(vertices), in_one_pose(touched))
    assert np.abs(only_along).max() < 1e-6


def test_few_anchors_do_not_make_skin_rise_more() -> None:
    """It rises between the vertices of the outfit, whatever stands for them."""
    vertices, pairs, normals = tube()
    rows = np.arange(len(vertices)).reshape(5, ACROSS)[::2, ::2].ravel()
    few = Springs.of(vertices[rows], lattice(np.arange(len(rows)).reshape(3, -1)))

    def mean_height(rows: np.ndarray, springs: Springs) -> float:
        bulging = Bulging.of(vertices, pairs, rows, springs, most=0.1)
        return float(bulging.height(in_one_pose(vertices[rows]), in_one_pose(normals[rows])).mean())

    everyone = mean_height(np.arange(len(vertices)), Springs.of(vertices, pairs))
    assert few.sag(in_one_pose(vertices[rows]), in_one_pose(normals[rows])).mean() > 3 * everyone
    np.testing.assert_allclose(mean_height(rows, few), everyone, rtol=0.2)


def test_cloth_of_short_edges_needs_no_measuring() -> None:
    vertices, pairs, normals = tube()
    fine = Bulging.of(0.3 * vertices, pairs, np.arange(len(vertices)), Springs.of(0.3 * vertices, pairs), 0.005)
    np.testing.assert_array_equal(fine.height(in_one_pose(vertices), in_one_pose(normals)), np.float32(CLOSEST))
    coarse = Bulging.of(vertices, pairs, np.arange(len(vertices)), Springs.of(vertices, pairs), 0.0015)
    height = coarse.height(in_one_pose(vertices), in_one_pose(normals))
    assert height.min() >= np.float32(CLOSEST)
    assert height.max() == np.float32(0.0015)


def test_mean_edge_lengths_are_those_of_the_springs() -> None:
    rig = make_rig()
    pairs = edges(rig.triangles)
    mean = mean_edge_lengths(rig.template, pairs)
    np.testing.assert_allclose(mean, Springs.of(rig.template, pairs).mean_lengths, rtol=1e-5)
    first = np.linalg.norm(rig.template[np.setdiff1d(pairs[(pairs == 0).any(axis=1)], 0)] - rig.template[0], axis=1)
    np.testing.assert_allclose(mean[0], first.mean(), rtol=1e-5)


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


def test_poses_side_by_side_are_pulled_as_one_by_one() -> None:
    rng = np.random.default_rng(2)
    rig = make_rig()
    springs = Springs.of(rig.template, edges(rig.triangles))
    moved = rig.template.T[:, :, None] + 0.05 * rng.standard_normal((3, rig.vertex_count, 9))
    together = moved.astype(np.float32)
    for work in (springs.pull, springs.roughness):
        alone = [work(np.ascontiguousarray(together[:, :, p : p + 1])) for p in range(9)]
        np.testing.assert_array_equal(work(together), np.concatenate(alone, axis=2))
