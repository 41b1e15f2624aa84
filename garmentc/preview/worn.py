"""An outfit and the body inside it, as surfaces to be drawn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.evaluate import world_positions
from garmentc.gltf.glb_asset import GlbAsset, Primitive
from garmentc.gltf.posing import placement
from garmentc.gltf.state import State
from garmentc.outfit.topology import first_equal, vertex_normals
from garmentc.preview.material import Material, read_material
from garmentc.preview.moments import body_pose
from garmentc.preview.surface import Surface
from garmentc.smpl.body import BodyModel

CLAY = Material(base_color=(0.56, 0.50, 0.455, 1.0), roughness=0.75)
"""What the body is made of in pictures."""


@dataclass(frozen=True)
class Worn:
    """An asset that is ready to be drawn in any state.

    primitives  of all outfits, in the order of `world_positions`
    materials   one for each primitive
    smooth      (S,) over all primitives: the first vertex that shares its place and its normal, so that texture seams
                do not show in the shading, and sharp edges do
    to_body     (4, 4) from the file's scene to the body's axes and origin, where everything is drawn
    body        what wears it, or None
    """

    asset: GlbAsset
    primitives: tuple[Primitive, ...]
    materials: tuple[Material, ...]
    smooth: NDArray[np.int64]
    to_body: NDArray[np.float64]
    body: BodyModel | None
    betas: NDArray[Any] | None

    def outfit(self, state: State) -> tuple[Surface, ...]:
        """The posed outfit, one surface for each primitive."""
        turn, shift = self.to_body[:3, :3], self.to_body[:3, 3]
        scene = world_positions(self.asset, state, self.asset.outfit_nodes)
        positions = [part @ turn.T + shift for part in scene]
        starts = np.cumsum([0, *(len(part) for part in positions)])
        triangles = [
            self.smooth[primitive.triangles.astype(np.int64) + start]
            for primitive, start in zip(self.primitives, starts[:-1], strict=True)
        ]
        normals = vertex_normals(np.concatenate(positions), np.concatenate(triangles))[self.smooth]
        return tuple(
            Surface(
                positions=positions[k],
                normals=normals[starts[k] : starts[k + 1]],
                triangles=primitive.triangles,
                material=self.materials[k],
                texcoords=primitive.texcoords,
            )
            for k, primitive in enumerate(self.primitives)
        )

    def skin(self, state: State) -> Surface | None:
        """The posed body."""
        if self.body is None:
            return None
        pose, translation = body_pose(self.asset, state)
        vertices = self.body.posed(pose, self.betas, translation)
        return Surface(vertices, vertex_normals(vertices, self.body.faces), self.body.faces, CLAY)


def prepare(asset: GlbAsset, body: BodyModel | None, betas: NDArray[Any] | None) -> Worn:
    """Read the materials and find the seams.

    A body in the file is left out: `body` has pose correctives, which such a body lacks.
    Raises GarmentcError where an image cannot be read, or the file has no SMPL joints.
    """
    primitives = tuple(
        primitive for node in asset.outfit_nodes for primitive in asset.meshes[asset.nodes[node].mesh or 0].primitives
    )
    places = [np.zeros((0, 6))]
    for primitive in primitives:
        normals = np.zeros_like(primitive.positions) if primitive.normals is None else primitive.normals
        places.append(np.concatenate([primitive.positions, normals], axis=1).astype(np.float64))
    materials = {index: read_material(asset, index) for index in {primitive.material for primitive in primitives}}
    return Worn(
        asset,
        primitives,
        tuple(materials[primitive.material] for primitive in primitives),
        first_equal(np.concatenate(places)),
        np.linalg.inv(placement(asset)).astype(np.float64),
        body,
        betas,
    )
