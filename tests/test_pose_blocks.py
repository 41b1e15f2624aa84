"""Blocks of poses: all of them, once, in order, whatever the threads do."""

from __future__ import annotations

import numpy as np
import pytest

from garmentc.passes.pose_blocks import over_blocks


@pytest.mark.parametrize("size", [1, 3, 7, 100])
def test_every_pose_is_worked_on_once_and_in_order(size: int) -> None:
    poses = np.arange(7 * 72.0).reshape(7, 24, 3)
    blocks = over_blocks(lambda block: 2 * block, poses, size)
    assert max(map(len, blocks)) <= size
    np.testing.assert_array_equal(np.concatenate(blocks), 2 * poses)


def test_what_goes_wrong_in_a_block_is_raised() -> None:
    def work(block: np.ndarray) -> None:
        raise ValueError(f"{len(block)} poses")

    with pytest.raises(ValueError, match="3 poses"):
        over_blocks(work, np.zeros((3, 24, 3)), 4)
