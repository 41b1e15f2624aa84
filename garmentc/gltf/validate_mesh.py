"""Checks of meshes: blend weights, morph targets, seams."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.bind import dense_weights
from garmentc.gltf.finding import Finding, error, warning
from garmentc.gltf.glb_asset import GlbAsset, Mesh, Primitive

_SUM_TOLERANCE = 1e-5

_LEFT_OUT = 0.01
"""Share of a vertex's weight that an engine may leave out unseen."""

_MORPH_LIMITS = ((1000, "three.js"), (256, "Filament"), (128, "Babylon.js and Blender, as far as tested"))
"""Morph targets that engines take, the most generous first."""


def mesh_findings(asset: GlbAsset) -> Iterator[Finding]:
    for index, mesh in enumerate(asset.meshes):
        where = f"meshes/{index}"
        yield from _morphs(mesh, where)
        for number, primitive in enumerate(mesh.primitives):
            yield from _weights(primitive, f"{where}/primitives/{number}")
        yield from _seams(asset, mesh, where)


def _morphs(mesh: Mesh, where: str) -> Iterator[Finding]:
    count = mesh.morph_count
    if any(mesh.weights):
        yield error("morph-rest", where, "morph weights are not 0 at rest, so the mesh at rest is not the authored one")
    if count and not mesh.target_names:
        yield warning("target-names", where, "the morph targets have no names (extras.targetNames)")
    elif len(mesh.target_names) != count:
        yield error("target-names", where, f"{len(mesh.target_names)} names for {count} morph targets")
    elif len(set(mesh.target_names)) < count:
        yield error("target-names", where, "two morph targets have the same name")
    for limit, engine in _MORPH_LIMITS:
        if count > limit:
            yield warning("morph-limit", where, f"{count} morph targets are more than {engine} can take: {limit}")
            break


def _weights(primitive: Primitive, where: str) -> Iterator[Finding]:
    weights = primitive.weights
    if weights is None:
        yield error("no-weights", where, "there are no blend weights, so the mesh does not follow the body")
        return
    off = np.abs(weights.sum(axis=1, dtype=np.float64) - 1)
    if off.max() > _SUM_TOLERANCE:
        yield error(
            "weight-sum", where, f"blend weights of vertex {off.argmax()} sum to {weights[off.argmax()].sum():.6g}"
        )
    if weights.min() < 0:
        yield error("weight-negative", where, f"blend weight {weights.min():.3g} is negative")
    if np.any(np.diff(weights, axis=1) > 0):
        vertex = int(np.argmax((np.diff(weights, axis=1) > 0).any(axis=1)))
        message = (
            f"blend weights of vertex {vertex} are not largest first; engines that read four would take wrong ones"
        )
        yield error("weight-order", where, message)
    left = weights[:, 4:].sum(axis=1)
    if left.max() > _LEFT_OUT:
        message = (
            f"three.js and VTK read four influences; they would leave out up to {left.max():.0%} of a vertex's weight"
        )
        yield warning("influence-limit", where, message)


def _seams(asset: GlbAsset, mesh: Mesh, where: str) -> Iterator[Finding]:
    """Vertices at one place must move alike, or the surface tears there."""
    first, again = _repeats(np.concatenate([primitive.positions for primitive in mesh.primitives]))
    if not len(again):
        return
    joint_count = 1 + max((int(p.joints.max()) for p in mesh.primitives if p.joints is not None), default=0)
    weights = np.concatenate([dense_weights(primitive, joint_count) for primitive in mesh.primitives])
    torn = np.abs(weights[first] - weights[again]).max(axis=1) > _SUM_TOLERANCE
    for morph in range(mesh.morph_count):
        deltas = np.concatenate([primitive.morph_positions[morph] for primitive in mesh.primitives])
        torn |= (deltas[first] != deltas[again]).any(axis=1)
    if torn.any():
        at = np.concatenate([primitive.positions for primitive in mesh.primitives])[again[torn][0]]
        message = f"{torn.sum()} vertices do not move with another at the same place, the first at ({at[0]:.4g}, "
        yield error("torn-seam", where, message + f"{at[1]:.4g}, {at[2]:.4g}): the surface tears there")


def _repeats(positions: NDArray[np.float32]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Vertices whose position came before, and the first vertex at that position: (first, again)."""
    rows = np.ascontiguousarray(positions + np.float32(0)).view("V12")[:, 0]  # + 0 makes -0 equal to 0
    _, first, inverse = np.unique(rows, return_index=True, return_inverse=True)
    again = np.flatnonzero(first[inverse] != np.arange(len(rows)))
    return first[inverse][again], again
