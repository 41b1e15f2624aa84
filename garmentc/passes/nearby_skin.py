"""Contacts of an outfit with its body in many poses, looked for only where they have been found in some."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.body_contacts import POSES_AT_ONCE, Planes, Skin, in_contact
from garmentc.passes.covering import Covering
from garmentc.passes.pose_blocks import over_blocks
from garmentc.passes.posed_skinning import PosedVertices, posed_body, posed_outfit
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel

_CANDIDATES = 8

_REACH = 0.12
"""Metres to the centres of triangles, with what is added where they face elsewhere."""


@dataclass(frozen=True)
class NearbySkin:
    """For each of n vertices of an outfit the K triangles of its body that were nearest in some poses.

    Nearest is meant among those on the side of the cloth at rest: what the front of a skirt has to come out of is the
    front of a raised thigh, though the back may be nearer.

    In other poses one of them is the nearest too, but for about one contact in a hundred, or one in twenty where cloth
    is loose. Looking at these few takes a tenth of the time that a search tree takes.

    body        the body, with only the vertices and faces that these triangles need
    betas       its shape
    candidates  (n, K) rows of its faces
    joined      (n, K) whether vertex and triangle hang on the same or neighbouring joints
    turned      (n, K) float32 square metres that are added to their squared distance where they face different ways
    depths      (n, K) float32 metres: how deep inside the vertex may be for a contact to count
    """

    body: BodyModel
    betas: NDArray[Any] | None
    candidates: NDArray[np.intp]
    joined: NDArray[np.bool_]
    turned: NDArray[np.float32]
    depths: NDArray[np.float32]

    @classmethod
    def of(
        cls, rig: Rig, normals: NDArray[Any], body: BodyModel, betas: NDArray[Any] | None, poses: NDArray[Any]
    ) -> NearbySkin:
        """The triangles that are nearest in `poses` (P, 24, 3) to the rig, which has unit `normals` (n, 3) at rest."""
        skin = Skin.of(body, rig)
        covering = Covering.of(rig.template, normals, body.shaped(betas), skin.faces)

        def find(block: NDArray[Any]) -> NDArray[np.intp]:
            planes = Planes.of(posed_body(body, betas, block), skin.faces)
            return planes.nearest(posed_outfit(rig, block).vertices, _REACH, covering.marks)

        found = np.concatenate(over_blocks(find, poses, POSES_AT_ONCE), axis=1)
        frequent = _most_frequent(found, len(skin.faces))
        faces, candidates = np.unique(frequent, return_inverse=True)
        vertices, corners = np.unique(skin.faces[faces], return_inverse=True)
        part = replace(body.of_vertices(vertices), faces=corners.reshape(-1, 3).astype(np.int32))
        joined = skin.joined(np.repeat(np.arange(len(found)), _CANDIDATES), frequent.ravel()).reshape(frequent.shape)
        candidates = candidates.reshape(frequent.shape)
        return cls(part, betas, candidates, joined, covering.turned(frequent), covering.depths(frequent))

    def planes(self, poses: NDArray[Any]) -> Planes:
        """Of the triangles that may be touched, in `poses` (P, 24, 3)."""
        return Planes.of(posed_body(self.body, self.betas, poses), self.body.faces)

    def contacts(self, outfit: PosedVertices, planes: Planes) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Clearances (n, P) of the outfit in the P poses of `planes`, metres, and the skin's normals (3, n, P).

        Both are 0 where there is no contact.
        """
        rows, depths, counts = self._nearest(outfit.vertices, planes)
        clearance, normals = planes.offset(outfit.vertices, rows)
        counts &= in_contact(clearance, depths)
        return clearance * counts, normals * counts

    def path(
        self, vertices: NDArray[np.float32], before: Planes, after: Planes
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """The skin that `vertices` (3, n, P) are near in the planes `before`: where it is there, and in those `after`.

        Returns the skin's normals afterwards (3, n, P), 0 where there is none to care about, and the centres of its
        triangles before and after (3, n, P). All skin within _REACH counts: cloth may come to it in between.
        """
        rows, depths, counts = self._nearest(vertices, before)
        counts &= before.offset(vertices, rows)[0] > -depths
        place = rows * before.centers.shape[2] + np.arange(before.centers.shape[2])
        normals, start, end = (
            np.take(array.reshape(3, -1), place, axis=1) for array in (after.normals, before.centers, after.centers)
        )
        return normals * counts, start, end

    def _nearest(
        self, vertices: NDArray[np.float32], planes: Planes
    ) -> tuple[NDArray[np.intp], NDArray[np.float32], NDArray[np.bool_]]:
        """Of the candidates of each vertex the nearest in each pose (n, P), how deep in it a vertex may be, and
        whether it is near at all and on the same limb."""
        squared = np.full(vertices.shape[1:], _REACH**2, dtype=np.float32)
        chosen = np.full(squared.shape, _CANDIDATES, dtype=np.uint8)
        for column, rows in enumerate(self.candidates.T):
            apart = vertices - np.take(planes.centers, rows, axis=1)
            distance = np.einsum("inp,inp->np", apart, apart)
            distance += self.turned[:, column, None]
            np.copyto(chosen, column, where=distance < squared)
            np.minimum(squared, distance, out=squared)
        found = chosen < _CANDIDATES
        chosen[~found] = 0
        found &= np.take_along_axis(self.joined, chosen, axis=1)
        rows = np.take_along_axis(self.candidates, chosen, axis=1)
        return rows, np.take_along_axis(self.depths, chosen, axis=1), found


def _most_frequent(found: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    """The numbers below `count` that are most frequent in each row of `found` (n, S); returns (n, _CANDIDATES).

    Where a row has fewer, the rest is 0: a triangle more does no harm.
    """
    pairs, times = np.unique(np.arange(len(found))[:, None] * (count + 1) + found, return_counts=True)
    row, number = np.divmod(pairs, count + 1)
    order = np.lexsort((-times * (number < count), row))  # what was not found comes last
    row, number = row[order], number[order]
    rank = np.arange(len(row)) - np.searchsorted(row, row)
    taken = (rank < _CANDIDATES) & (number < count)
    result = np.zeros((len(found), _CANDIDATES), dtype=np.intp)
    result[row[taken], rank[taken]] = number[taken]
    return result
