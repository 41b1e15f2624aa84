"""The skeleton as nodes, the skin, and joint/weight attributes (glTF 2.0 section 3.7.3)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.accessors import AccessorWriter
from garmentc.smpl.skeleton import JOINT_COUNT, JOINT_NAMES, PARENTS

JOINT_GRID = 2.0**-22
"""Metres. Joints are written on this grid (0.24 micrometres): sums of bone offsets are then exact in float32, so that
joint matrices at rest are exactly the identity, and the resting asset is exactly the authored mesh."""

_BLOCK = 1 << 16


def on_grid(joints: NDArray[Any]) -> NDArray[np.float64]:
    """Joints (24, 3) as they are written."""
    return np.round(joints.astype(np.float64) / JOINT_GRID) * JOINT_GRID


def add_joints(document: Any, joints: NDArray[Any], names: tuple[str, ...] = JOINT_NAMES) -> list[int]:
    """Add 24 nodes with the rest offsets between `joints` (24, 3), and identity rotations; returns their indices."""
    from pygltflib import Node

    placed = on_grid(joints)
    first = len(document.nodes)
    for joint, parent in enumerate(PARENTS):
        offset = placed[joint] - placed[parent] if parent >= 0 else placed[joint]
        children = [first + int(child) for child in np.flatnonzero(joint == PARENTS)]
        document.nodes.append(Node(name=names[joint], translation=offset.tolist(), children=children))
    return list(range(first, first + JOINT_COUNT))


def add_skin(
    writer: AccessorWriter, nodes: list[int], joints: NDArray[Any], dequantize: NDArray[Any], name: str = "smpl"
) -> int:
    """Add a skin over `nodes`; returns its index.

    dequantize  (4, 4) takes written positions to metres: it is folded into the inverse bind matrices
    """
    from pygltflib import Skin

    inverse_bind = np.tile(np.eye(4), (JOINT_COUNT, 1, 1))
    inverse_bind[:, :3, 3] = -on_grid(joints)
    column_major = (inverse_bind @ dequantize).transpose(0, 2, 1).reshape(JOINT_COUNT, 16)
    matrices = writer.plain(column_major.astype(np.float32), label="the inverse bind matrices")
    writer.document.skins.append(Skin(name=name, joints=nodes, inverseBindMatrices=matrices, skeleton=nodes[0]))
    return len(writer.document.skins) - 1


def largest_influences(weights: NDArray[Any], count: int) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """The `count` largest blend weights of each vertex, largest first, scaled to sum to 1, and their joints.

    weights  (N, 24)
    returns  joints (N, count) and weights (N, count)
    """
    joints = np.empty((len(weights), count), dtype=np.uint8)
    largest = np.empty((len(weights), count))
    for start in range(0, len(weights), _BLOCK):
        block = weights[start : start + _BLOCK].astype(np.float64)
        order = np.argsort(-block, axis=1, kind="stable")[:, :count]
        kept = np.take_along_axis(block, order, axis=1)
        joints[start : start + _BLOCK] = order
        largest[start : start + _BLOCK] = kept / kept.sum(axis=1, keepdims=True)
    return joints, largest


def left_out_share(weights: NDArray[Any], count: int) -> float:
    """The largest share of a vertex's blend weights (N, 24) that is not among its `count` largest."""
    share = 0.0
    for start in range(0, len(weights), _BLOCK):
        block = weights[start : start + _BLOCK].astype(np.float64)
        smaller = np.partition(block, -count, axis=1)[:, :-count]
        share = max(share, float((smaller.sum(axis=1) / block.sum(axis=1)).max()))
    return share


def to_unorm16(weights: NDArray[np.float64]) -> NDArray[np.uint16]:
    """Weights (N, K), largest first and rows summing to 1, as 16-bit fractions whose rows sum to exactly 65535.

    All are rounded down, and what is left goes, one each, to the first ones: order and zeros are kept.
    """
    fractions = np.floor(weights * 65535).astype(np.int64)
    left = 65535 - fractions.sum(axis=1, keepdims=True)
    exact: NDArray[np.uint16] = (fractions + (np.arange(weights.shape[1]) < left)).astype(np.uint16)
    return exact


def add_influences(
    writer: AccessorWriter, attributes: Any, joints: NDArray[np.uint8], weights: NDArray[np.float64], quantize: bool
) -> None:
    """Write JOINTS_0/WEIGHTS_0, and further sets of four, into `attributes`; joint 0 where the weight is 0."""
    stored = to_unorm16(weights) if quantize else weights.astype(np.float32)
    used = np.where(stored > 0, joints, 0).astype(np.uint8)
    for index in range(weights.shape[1] // 4):
        columns = slice(4 * index, 4 * index + 4)
        joint_set = writer.attribute(used[:, columns], label="the joints")
        weight_set = writer.attribute(stored[:, columns], normalized=quantize, label="the blend weights")
        setattr(attributes, f"JOINTS_{index}", joint_set)
        setattr(attributes, f"WEIGHTS_{index}", weight_set)
