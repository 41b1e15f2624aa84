"""The body as a mesh on the outfits' skeleton, for previews and try-on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.asset import RiggedMesh
from garmentc.outfit.corners import CornerPrimitive
from garmentc.outfit.outfit import Material
from garmentc.outfit.topology import vertex_normals
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel

CLAY = Material("clay", base_color=(0.52, 0.43, 0.38, 1.0), roughness=0.9)
"""Neither skin nor cloth, so that nobody takes it for either."""


def body_mesh(body: BodyModel, betas: NDArray[Any] | None, name: str = "body") -> RiggedMesh:
    """The body with shape `betas`, skinned by its own weights.

    Its pose correctives are left out: they are functions of rotation matrices, which the pose-key network cannot be,
    and on the default body they move a vertex by half a millimetre on average. `left_out_correctives` measures them.
    """
    vertices = body.shaped(betas)
    every = np.arange(len(vertices), dtype=np.int32)
    skin = CornerPrimitive(
        material=0,
        vertices=every,
        obj_vertices=every,
        triangles=body.faces.astype(np.uint32),
        tri_index=np.arange(len(body.faces), dtype=np.int32),
        texcoords=None,
        normals=vertex_normals(vertices, body.faces).astype(np.float32),
        colors=None,
    )
    rig = Rig(
        template=vertices,
        triangles=body.faces,
        joints=body.joints(betas),
        weights=body.weights.astype(np.float32),
        blend_shapes=np.zeros((0, len(vertices), 3), dtype=np.float32),
        keys=None,
    )
    return RiggedMesh(name, rig, (skin,), (CLAY,), is_body=True)


def left_out_correctives(body: BodyModel, poses: NDArray[Any]) -> tuple[float, float]:
    """Metres that the body's pose correctives would move its vertices in poses (T, 24, 3): mean and largest."""
    sizes = [np.linalg.norm(body.posed(pose) - body.posed(pose, correctives=False), axis=-1) for pose in poses]
    return float(np.mean(sizes)), float(np.max(sizes))
