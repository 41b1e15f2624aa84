"""The edges of a garment as springs, which pull it back to the lengths that it was cut to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.compiled import compiled
from garmentc.outfit.topology import edge_lengths

_Floats = NDArray[np.float32]

_FEW = 4
"""Poses: as many fit into registers no better than one."""

_SHORTEST = np.float32(1e-9)
"""Metres: a spring that is shorter has no direction."""


@dataclass(frozen=True)
class Springs:
    """E springs between n vertices.

    pairs    (E, 2) vertices that they join
    lengths  (E,) float32 metres, unstretched
    begins   (n + 1,) int32: the springs of vertex i are those from begins[i] to begins[i + 1] of
    others   (2E,) int32 the vertices at their other ends, and
    apart    (2E,) float32 their lengths
    """

    pairs: NDArray[np.intp]
    lengths: _Floats
    begins: NDArray[np.int32]
    others: NDArray[np.int32]
    apart: _Floats

    @classmethod
    def of(cls, template: NDArray[Any], edges: NDArray[Any]) -> Springs:
        """Springs along `edges` (E, 2), unstretched where vertices are at `template` (n, 3)."""
        pairs = np.asarray(edges, np.intp)
        lengths = edge_lengths(template, pairs).astype(np.float32)
        own, others = np.concatenate([pairs, pairs[:, ::-1]]).T
        order = np.argsort(own, kind="stable")
        begins = np.searchsorted(own[order], np.arange(len(template) + 1)).astype(np.int32)
        return cls(pairs, lengths, begins, others[order].astype(np.int32), np.tile(lengths, 2)[order])

    def pull(self, vertices: _Floats) -> _Floats:
        """Where to vertices (3, n, P) in P poses are pulled, (3, n, P): half an edge's stretch, the mean over edges."""
        pulled = np.empty_like(vertices)
        pulled_along(vertices, self.begins, self.others, self.apart, np.ones(vertices.shape[1], np.float32), pulled)
        pulled -= vertices
        return pulled

    def sag(self, vertices: _Floats, normals: _Floats) -> _Floats:
        """How far skin rises between vertices (3, n, P) that touch it, (n, P): the mean over each vertex's edges.

        Over an edge along which the skin's normal turns by an angle a, the skin rises by a/8 of its length, where it
        bulges. A cylinder's edges turn half as much on average as those across it, so twice that is taken: across a
        limb the full height. `normals` (3, n, P) are the skin's at the vertices, 0 where they do not touch it.
        """
        sag = np.empty(vertices.shape[1:], np.float32)
        _sag(vertices, normals, self.begins, self.others, sag)
        return sag

    @property
    def mean_lengths(self) -> _Floats:
        """(n,) metres: the mean over each vertex's edges, unstretched; 0 where there are none."""
        return _means(self.pairs, self.lengths, len(self.begins) - 1)

    def roughness(self, values: _Floats) -> _Floats:
        """How far `values` (3, n, P) are from the mean of their neighbours', with the opposite sign; (3, n, P)."""
        result = np.empty_like(values)
        smoothed(values, self.begins, self.others, np.float32(1), result)
        result -= values
        return result


@compiled
def _pull_one_by_one(
    vertices: _Floats,
    begins: NDArray[np.int32],
    others: NDArray[np.int32],
    apart: _Floats,
    share: _Floats,
    out: _Floats,
) -> None:
    """`pulled_along`, pose by pose: sums stay in registers."""
    _, count, poses = vertices.shape
    x, y, z = vertices[0], vertices[1], vertices[2]
    for i in range(count):
        part = share[i] * np.float32(0.5) / np.float32(max(1, begins[i + 1] - begins[i]))
        for p in range(poses):
            right, up, front = np.float32(0), np.float32(0), np.float32(0)
            for k in range(begins[i], begins[i + 1]):
                j = others[k]
                dx, dy, dz = x[j, p] - x[i, p], y[j, p] - y[i, p], z[j, p] - z[i, p]
                stretch = np.float32(1) - apart[k] / max(np.sqrt(dx * dx + dy * dy + dz * dz), _SHORTEST)
                right += stretch * dx
                up += stretch * dy
                front += stretch * dz
            out[0, i, p] = x[i, p] + part * right
            out[1, i, p] = y[i, p] + part * up
            out[2, i, p] = z[i, p] + part * front


@compiled
def _pull_side_by_side(
    vertices: _Floats,
    begins: NDArray[np.int32],
    others: NDArray[np.int32],
    apart: _Floats,
    share: _Floats,
    out: _Floats,
) -> None:
    """`pulled_along`, all poses at once: they lie side by side in registers."""
    _, count, poses = vertices.shape
    x, y, z = vertices[0], vertices[1], vertices[2]
    right, up, front = out[0], out[1], out[2]
    for i in range(count):
        for p in range(poses):
            right[i, p] = up[i, p] = front[i, p] = 0
        for k in range(begins[i], begins[i + 1]):
            j, length = others[k], apart[k]
            for p in range(poses):
                dx, dy, dz = x[j, p] - x[i, p], y[j, p] - y[i, p], z[j, p] - z[i, p]
                stretch = np.float32(1) - length / max(np.sqrt(dx * dx + dy * dy + dz * dz), _SHORTEST)
                right[i, p] += stretch * dx
                up[i, p] += stretch * dy
                front[i, p] += stretch * dz
        part = share[i] * np.float32(0.5) / np.float32(max(1, begins[i + 1] - begins[i]))
        for p in range(poses):
            right[i, p] = x[i, p] + part * right[i, p]
            up[i, p] = y[i, p] + part * up[i, p]
            front[i, p] = z[i, p] + part * front[i, p]


@compiled
def _smooth_one_by_one(
    values: _Floats, begins: NDArray[np.int32], others: NDArray[np.int32], share: np.float32, out: _Floats
) -> None:
    """`smoothed`, pose by pose."""
    _, count, poses = values.shape
    for i in range(count):
        number = begins[i + 1] - begins[i]
        theirs, kept = share / np.float32(max(1, number)), np.float32(1) - share if number else np.float32(1)
        for p in range(poses):
            x, y, z = np.float32(0), np.float32(0), np.float32(0)
            for k in range(begins[i], begins[i + 1]):
                x += values[0, others[k], p]
                y += values[1, others[k], p]
                z += values[2, others[k], p]
            out[0, i, p] = kept * values[0, i, p] + theirs * x
            out[1, i, p] = kept * values[1, i, p] + theirs * y
            out[2, i, p] = kept * values[2, i, p] + theirs * z


@compiled
def _smooth_side_by_side(
    values: _Floats, begins: NDArray[np.int32], others: NDArray[np.int32], share: np.float32, out: _Floats
) -> None:
    """`smoothed`, all poses at once."""
    _, count, poses = values.shape
    for i in range(count):
        number = begins[i + 1] - begins[i]
        theirs, kept = share / np.float32(max(1, number)), np.float32(1) - share if number else np.float32(1)
        for p in range(poses):
            out[0, i, p] = out[1, i, p] = out[2, i, p] = 0
        for k in range(begins[i], begins[i + 1]):
            j = others[k]
            for p in range(poses):
                out[0, i, p] += values[0, j, p]
                out[1, i, p] += values[1, j, p]
                out[2, i, p] += values[2, j, p]
        for p in range(poses):
            out[0, i, p] = kept * values[0, i, p] + theirs * out[0, i, p]
            out[1, i, p] = kept * values[1, i, p] + theirs * out[1, i, p]
            out[2, i, p] = kept * values[2, i, p] + theirs * out[2, i, p]


@compiled
def pulled_along(
    vertices: _Floats,
    begins: NDArray[np.int32],
    others: NDArray[np.int32],
    apart: _Floats,
    share: _Floats,
    out: _Floats,
) -> None:
    """Fill `out` (3, n, P) with where springs pull `vertices` (3, n, P) to, a `share` (n,) of the way that would be
    right for an edge alone."""
    if vertices.shape[2] <= _FEW:
        _pull_one_by_one(vertices, begins, others, apart, share, out)
    else:
        _pull_side_by_side(vertices, begins, others, apart, share, out)


@compiled
def smoothed(
    values: _Floats, begins: NDArray[np.int32], others: NDArray[np.int32], share: np.float32, out: _Floats
) -> None:
    """Fill `out` (3, n, P) with `values` (3, n, P), a `share` of the way to the mean of their neighbours'."""
    if values.shape[2] <= _FEW:
        _smooth_one_by_one(values, begins, others, share, out)
    else:
        _smooth_side_by_side(values, begins, others, share, out)


@compiled
def _sag(
    vertices: _Floats, normals: _Floats, begins: NDArray[np.int32], others: NDArray[np.int32], out: _Floats
) -> None:
    """Fill `out` (n, P), see `Springs.sag`."""
    _, count, poses = vertices.shape
    x, y, z = vertices[0], vertices[1], vertices[2]
    right, up, front = normals[0], normals[1], normals[2]
    for i in range(count):
        for p in range(poses):
            out[i, p] = 0
        for k in range(begins[i], begins[i + 1]):
            j = others[k]
            for p in range(poses):
                here = right[i, p] != 0 or up[i, p] != 0 or front[i, p] != 0
                there = right[j, p] != 0 or up[j, p] != 0 or front[j, p] != 0
                rise = (right[j, p] - right[i, p]) * (x[j, p] - x[i, p])
                rise += (up[j, p] - up[i, p]) * (y[j, p] - y[i, p])
                rise += (front[j, p] - front[i, p]) * (z[j, p] - z[i, p])
                if here and there and rise > 0:
                    out[i, p] += rise
        part = np.float32(0.25) / np.float32(max(1, begins[i + 1] - begins[i]))
        for p in range(poses):
            out[i, p] *= part


def mean_edge_lengths(template: NDArray[Any], edges: NDArray[Any]) -> _Floats:
    """The mean length (N,) of the `edges` (E, 2) at each vertex of `template` (N, 3); 0 where there are none."""
    return _means(edges, edge_lengths(template, edges), len(template))


def _means(edges: NDArray[Any], values: NDArray[Any], count: int) -> _Floats:
    """The mean (n,) over each vertex's `edges` (E, 2) of their `values` (E,); 0 where there are none."""
    total = sum(np.bincount(ends, values, count) for ends in edges.T)
    result: _Floats = (total / np.maximum(np.bincount(edges.ravel(), minlength=count), 1)).astype(np.float32)
    return result
