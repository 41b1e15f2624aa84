"""Outfits that can be posed, whatever they are: a rig in memory, or a .glb as an engine sees it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.gltf.evaluate import world_mesh
from garmentc.gltf.glb_asset import GlbAsset
from garmentc.gltf.posing import placement, smpl_joints, state_at_pose, state_at_time
from garmentc.gltf.read import read_glb
from garmentc.gltf.state import State, rest_state
from garmentc.rig import Rig
from garmentc.smpl.rotations import quaternion_to_axis_angle


class PosedOutfit(Protocol):
    """rest (N, 3) metres; triangles (F, 3) on the same vertices, each of which stands for one place on the cloth."""

    @property
    def rest(self) -> NDArray[np.float64]: ...

    @property
    def triangles(self) -> NDArray[np.int32]: ...

    def posed(self, pose: NDArray[Any]) -> NDArray[np.float64]:
        """Vertices (N, 3) in a pose (24, 3)."""


@dataclass(frozen=True)
class RigOutfit:
    """A rig, evaluated in float64."""

    rig: Rig

    @property
    def rest(self) -> NDArray[np.float64]:
        return self.rig.template.astype(np.float64)

    @property
    def triangles(self) -> NDArray[np.int32]:
        return self.rig.triangles

    def posed(self, pose: NDArray[Any]) -> NDArray[np.float64]:
        return self.rig.posed(pose)


@dataclass(frozen=True)
class GlbOutfit:
    """The outfits of a .glb together, skinned from their own attributes, and morphed by their own pose-key networks or
    as its animations say.

    corner   (N,) the first written vertex of each place: seams split vertices, and a seam must not count twice
    to_body  (4, 4) from the scene to the body's axes and origin
    """

    asset: GlbAsset
    rest: NDArray[np.float64]
    triangles: NDArray[np.int32]
    corner: NDArray[np.intp]
    to_body: NDArray[Any]

    def posed(self, pose: NDArray[Any]) -> NDArray[np.float64]:
        return self._vertices(state_at_pose(self.asset, pose))

    def animated(self, animation: int, seconds: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The pose (24, 3) at a time of an animation, and the vertices (N, 3), the pelvis where it is at rest."""
        state, joints = state_at_time(self.asset, seconds, animation), smpl_joints(self.asset)
        state.translation[joints[0]] = rest_state(self.asset).translation[joints[0]]
        return quaternion_to_axis_angle(state.rotation[joints]), self._vertices(state)

    def _vertices(self, state: State) -> NDArray[np.float64]:
        return _outfit_mesh(self.asset, state, self.to_body)[0][self.corner]


def read_outfit(path: Path) -> GlbOutfit:
    """The outfits in a .glb that has the SMPL joints, without the body.

    Written vertices of one mesh at one place at rest are one vertex.
    Raises GarmentcError where the file cannot be read or shows nothing.
    """
    asset = read_glb(path)
    to_body = np.linalg.inv(placement(asset))
    rest, triangles = _outfit_mesh(asset, rest_state(asset), to_body)
    if not len(triangles):
        raise GarmentcError("has no triangles; there is nothing to evaluate", path)
    # To float32: the way through the skin rounds float64 differently where a seam lists the joints in another order.
    places = np.column_stack([rest.astype(np.float32) + np.float32(0), _mesh_numbers(asset)])
    _, corner, place = np.unique(places, axis=0, return_index=True, return_inverse=True)
    welded = place.reshape(-1)[triangles].astype(np.int32)
    proper = (welded != np.roll(welded, 1, axis=1)).all(axis=1)
    return GlbOutfit(asset, rest[corner], welded[proper], corner, to_body)


def _outfit_mesh(asset: GlbAsset, state: State, to_body: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Written vertices (S, 3) of all outfits in the body's axes, and their triangles (F, 3)."""
    positions, triangles = world_mesh(asset, state, asset.outfit_nodes)
    return positions @ to_body[:3, :3].T + to_body[:3, 3], triangles


def _mesh_numbers(asset: GlbAsset) -> NDArray[np.float32]:
    """(S,) for each written vertex of the outfits, the number of its mesh: layers that touch stay apart."""
    meshes = [asset.meshes[asset.nodes[index].mesh or 0] for index in asset.outfit_nodes]
    sizes = [sum(len(primitive.positions) for primitive in mesh.primitives) for mesh in meshes]
    return np.repeat(np.arange(len(sizes), dtype=np.float32), sizes)
