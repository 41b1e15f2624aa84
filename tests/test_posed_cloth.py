"""Cloth in a pose: out of the skin, back to its edges' lengths, and how that looks at rest."""

from __future__ import annotations

import numpy as np

from garmentc.passes.posed_cloth import PosedCloth
from garmentc.passes.posed_skinning import PosedVertices
from garmentc.passes.springs import Springs
from garmentc.smpl.rotations import axis_angle_to_matrix

TURN = axis_angle_to_matrix(np.array([0.4, -1.1, 0.7]))
REST = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]])
SPRINGS = Springs.of(REST, np.array([[0, 1], [1, 2]]))


def cloth(posed: np.ndarray, turn: np.ndarray, normals: np.ndarray, least: list[float]) -> PosedCloth:
    """In one pose: vertices (3, 3), which skinning turns alike."""
    vertices = PosedVertices(
        np.float32(posed.T[:, :, None]), np.float32(np.repeat(turn[:, :, None, None], len(posed), axis=2))
    )
    return PosedCloth(vertices, np.float32(normals.T[:, :, None]), np.float32(least)[:, None])


def still(count: int) -> np.ndarray:
    return np.zeros((3, count, 1), np.float32)


def test_what_is_too_close_goes_out_along_the_normal_and_nothing_else_moves() -> None:
    """Planes along x at -0.01, 0.11 and nowhere: the middle vertex alone is behind one."""
    along_x = TURN @ [1, 0, 0]
    normals = np.array([along_x, along_x, np.zeros(3)])
    way = cloth(REST @ TURN.T, TURN, normals, [-0.01, 0.11, 0]).way(still(3), SPRINGS, 0, 1, 0)[:, :, 0].T
    np.testing.assert_allclose(way, [[0, 0, 0], [0.01, 0, 0], [0, 0, 0]], atol=1e-6)


def test_what_has_moved_far_enough_stays() -> None:
    normals = np.repeat([TURN @ [1, 0, 0]], 3, axis=0)
    moved = still(3)
    moved[0] = 0.02
    way = cloth(REST @ TURN.T, TURN, normals, [0.02, 0.11, 0.21]).way(moved, SPRINGS, 0, 1, 0)
    np.testing.assert_allclose(way, 0, atol=1e-6)


def test_where_skinning_shrinks_a_movement_it_is_larger_at_rest() -> None:
    """Between joints that turn against each other, skinning makes less of a displacement."""
    shrunk = 0.5 * TURN
    normals = np.repeat([TURN @ [1, 0, 0]], 3, axis=0)
    start = cloth(REST @ TURN.T, shrunk, normals, [0.01, 0.11, 0.21])
    way = start.way(still(3), SPRINGS, 0, 1, 0)
    np.testing.assert_allclose((shrunk @ way[:, :, 0]).T, 0.01 * normals, atol=1e-6)


def test_a_stretched_chain_goes_back_to_its_length_in_front_of_a_wall() -> None:
    """The chain is stretched by a half, and its first vertex may not leave x >= 0.05."""
    posed = 1.5 * REST + [0.05, 0, 0]
    wall = np.array([[1.0, 0, 0], [0, 0, 0], [0, 0, 0]])
    start = cloth(posed @ TURN.T, TURN, wall @ TURN.T, [0.05, 0, 0])
    way = start.way(still(3), SPRINGS, 100, 1.2, 0.8)[:, :, 0].T
    settled = posed + way
    np.testing.assert_allclose(np.diff(settled[:, 0]), [0.1, 0.1], atol=1e-4)
    assert settled[0, 0] > 0.05 - 1e-5
