"""Pieces of an outfit that do not bend: hats, badges, soles. They are no cloth, and hold themselves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import components, edge_lengths, edges
from garmentc.passes.part_of_rig import spread_vertices, take_vertices
from garmentc.passes.pose_set import PoseSet
from garmentc.rig import Rig

_POSES = 16
_EDGES = 20_000
"""Edges that are looked at, at most."""

_STIFF = 0.02
"""Mean change of length that makes a piece cloth: the networks move a hat with 1 %, tight trousers with 3 %."""


def rigid_pieces(rig: Rig, poses: PoseSet) -> NDArray[np.bool_]:
    """(N,) the vertices of pieces whose edges all but keep their lengths as the networks move them, in `poses`."""
    pairs = edges(rig.triangles)
    pairs = pairs[spread_vertices(len(pairs), _EDGES)]
    used, corners = np.unique(pairs, return_inverse=True)
    corners = corners.reshape(-1, 2)
    part = take_vertices(rig, used.astype(np.intp))
    rest = edge_lengths(part.template, corners)
    changed = np.mean([np.abs(edge_lengths(posed, corners) - rest) for posed in part.posed(poses.some(_POSES))], axis=0)
    piece = components(rig.triangles, rig.vertex_count)
    count = int(piece.max()) + 1
    change, length = (np.bincount(piece[pairs[:, 0]], values, count) for values in (changed, rest))
    rigid: NDArray[np.bool_] = ((change < _STIFF * length) & (length > 0))[piece]
    return rigid
