"""What the glTF back end writes: rigs on their corner vertices, materials, and perhaps motions."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

import garmentc
from garmentc.gltf.skeletons import SMPL, Skeleton
from garmentc.outfit.corners import CornerPrimitive
from garmentc.outfit.outfit import Material
from garmentc.rig import Rig
from garmentc.smpl.motion import Motion


@dataclass(frozen=True)
class GltfOptions:
    """How an asset is laid out.

    influences       4, or 8: joints that may pull a vertex; the largest are kept, in sets of four, largest first
    quantize         KHR_mesh_quantization: int16 positions, int8 normals, uint16 weights and texture coordinates
    sparse           write a blend shape as a sparse accessor where that is smaller
    pose_keys        write the pose-key network, as extension and in the extras of the mesh node
    skeleton         names of the joints
    meshopt          EXT_meshopt_compression of everything but the pose-key network and images
    key_tolerance    metres that leaving out the keyframes of one animation channel may move a vertex; 0 keeps all
    """

    influences: int = 4
    quantize: bool = False
    sparse: bool = True
    pose_keys: bool = True
    skeleton: Skeleton = SMPL
    meshopt: bool = False
    key_tolerance: float = 1e-4

    def __post_init__(self) -> None:
        if self.influences not in (4, 8):
            raise ValueError(f"influences must be 4 or 8, not {self.influences}")


@dataclass(frozen=True)
class Clip:
    """A motion and the morph weights along it.

    keys  (T, M) of each of the asset's meshes; where there are none, its pose-key network is evaluated
    """

    motion: Motion
    keys: tuple[NDArray[Any] | None, ...] = ()


@dataclass(frozen=True)
class RiggedMesh:
    """A mesh on the skeleton: an outfit, or the body.

    rig          on welded vertices
    primitives   corner vertices and triangles, one primitive per material
    materials    what `CornerPrimitive.material` counts in
    morph_names  one for each blend shape; None numbers them
    is_body      what wears the outfits, and is none itself
    """

    name: str
    rig: Rig
    primitives: tuple[CornerPrimitive, ...]
    materials: tuple[Material, ...]
    morph_names: tuple[str, ...] | None = None
    is_body: bool = False

    @property
    def target_names(self) -> tuple[str, ...]:
        """One name for each morph target: those of poses and those that only animations use are numbered apart."""
        if self.morph_names is not None:
            return self.morph_names
        driven, count = self.rig.driven_count, self.rig.morph_count
        return (
            *(f"pose_key_{number:03d}" for number in range(driven)),
            *(f"animation_{number:03d}" for number in range(count - driven)),
        )


@dataclass(frozen=True)
class Asset:
    """A finished outfit.

    rig          on welded vertices
    primitives   corner vertices and triangles, one primitive per material
    materials    what `CornerPrimitive.material` counts in
    clips        become animations
    morph_names  one for each blend shape; None numbers them
    extras       plain JSON for `asset.extras`
    also         further meshes with the same joints; all names differ
    ground       height of the lowest vertex at rest, metres: what a skeleton that stands on the ground is raised by
    """

    name: str
    rig: Rig
    primitives: tuple[CornerPrimitive, ...]
    materials: tuple[Material, ...]
    clips: tuple[Clip, ...] = ()
    morph_names: tuple[str, ...] | None = None
    options: GltfOptions = GltfOptions()
    generator: str = f"garmentc {garmentc.__version__}"
    extras: dict[str, Any] = field(default_factory=dict)
    also: tuple[RiggedMesh, ...] = ()
    ground: float = 0.0

    @property
    def meshes(self) -> tuple[RiggedMesh, ...]:
        """All meshes, in the order in which they are written."""
        own = RiggedMesh(self.name, self.rig, self.primitives, self.materials, self.morph_names)
        return (own, *self.also)

    @property
    def rigs(self) -> tuple[Rig, ...]:
        """One for each of `meshes`."""
        return tuple(mesh.rig for mesh in self.meshes)
