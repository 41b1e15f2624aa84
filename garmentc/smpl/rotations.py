"""Axis-angle, matrices and quaternions, batched, in the dtype of the input."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def axis_angle_to_matrix(axis_angle: NDArray[Any]) -> NDArray[Any]:
    """Rodrigues' formula. (..., 3) radians to (..., 3, 3)."""
    angle = np.linalg.norm(axis_angle, axis=-1, keepdims=True)[..., None]
    small = angle < 1e-8
    safe = np.where(small, 1, angle)
    x, y, z = np.moveaxis(axis_angle, -1, 0)
    zero = np.zeros_like(x)
    cross = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*axis_angle.shape, 3)
    sine = np.where(small, 1 - angle**2 / 6, np.sin(safe) / safe)
    cosine = np.where(small, 0.5 - angle**2 / 24, (1 - np.cos(safe)) / safe**2)
    matrix: NDArray[Any] = np.eye(3, dtype=axis_angle.dtype) + sine * cross + cosine * (cross @ cross)
    return matrix


def axis_angle_to_quaternion(axis_angle: NDArray[Any]) -> NDArray[Any]:
    """(..., 3) radians to unit quaternions (..., 4) in glTF's order x, y, z, w."""
    angle = np.linalg.norm(axis_angle, axis=-1, keepdims=True)
    half = angle / 2
    small = angle < 1e-8
    sine = np.where(small, 0.5 - angle**2 / 48, np.sin(half) / np.where(small, 1, angle))
    return np.concatenate([sine * axis_angle, np.cos(half)], axis=-1)


def quaternion_to_matrix(quaternion: NDArray[Any]) -> NDArray[Any]:
    """(..., 4) in the order x, y, z, w, normalised here, to (..., 3, 3)."""
    x, y, z, w = np.moveaxis(quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True), -1, 0)
    rows = [
        1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
        2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
        2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y),
    ]  # fmt: skip
    return np.stack(rows, axis=-1).reshape(*quaternion.shape[:-1], 3, 3)


def quaternion_to_axis_angle(quaternion: NDArray[Any]) -> NDArray[Any]:
    """(..., 4) in the order x, y, z, w to (..., 3), angle in [0, pi]."""
    q = quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
    q = np.where(q[..., 3:] < 0, -q, q)
    sine = np.linalg.norm(q[..., :3], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., 3:])
    small = sine < 1e-12
    scale: NDArray[Any] = np.where(small, 2.0, angle / np.where(small, 1, sine)).astype(q.dtype)
    axis_angle: NDArray[Any] = q[..., :3] * scale
    return axis_angle


def matrix_to_quaternion(matrix: NDArray[Any]) -> NDArray[Any]:
    """(..., 3, 3) rotations to (..., 4) in the order x, y, z, w, w >= 0.

    The largest of the four components is computed first (Shepperd 1978), so no division is by a small number.
    """
    m = matrix
    t = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    squares = np.stack([1 + t[0] - t[1] - t[2], 1 - t[0] + t[1] - t[2], 1 - t[0] - t[1] + t[2], 1 + t[0] + t[1] + t[2]])
    a, b, c = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    d, e, f = m[..., 1, 0] + m[..., 0, 1], m[..., 0, 2] + m[..., 2, 0], m[..., 2, 1] + m[..., 1, 2]
    candidates = np.stack(
        [
            np.stack([squares[0], d, e, a], axis=-1),
            np.stack([d, squares[1], f, b], axis=-1),
            np.stack([e, f, squares[2], c], axis=-1),
            np.stack([a, b, c, squares[3]], axis=-1),
        ]
    )
    best = np.argmax(squares, axis=0)
    largest = np.take_along_axis(candidates, best[None, ..., None], axis=0)[0]
    q = largest / np.linalg.norm(largest, axis=-1, keepdims=True)
    unit: NDArray[Any] = np.where(q[..., 3:] < 0, -q, q)
    return unit


def multiply_quaternions(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """The rotation b, then a; (..., 4) in the order x, y, z, w."""
    ax, ay, az, aw = np.moveaxis(a, -1, 0)
    bx, by, bz, bw = np.moveaxis(b, -1, 0)
    product = [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    ]
    return np.stack(product, axis=-1)


def slerp(start: NDArray[Any], end: NDArray[Any], share: NDArray[Any]) -> NDArray[Any]:
    """Unit quaternions a `share` (...) of the shorter way from `start` to `end` (..., 4) (Shoemake 1985)."""
    cosine = np.sum(start * end, axis=-1)
    near = np.where((cosine < 0)[..., None], -end, end)
    angle = np.arccos(np.clip(np.abs(cosine), 0, 1))
    sine = np.sin(angle)
    close = sine < 1e-6  # a chord instead of an arc: the difference is below rounding
    safe = np.where(close, 1, sine)
    first = np.where(close, 1 - share, np.sin((1 - share) * angle) / safe)
    second = np.where(close, share, np.sin(share * angle) / safe)
    mixed = first[..., None] * start + second[..., None] * near
    unit: NDArray[Any] = mixed / np.linalg.norm(mixed, axis=-1, keepdims=True)
    return unit
