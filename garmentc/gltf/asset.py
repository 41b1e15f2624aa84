"""What the glTF back end writes: a rig on its corner vertices, materials, and perhaps a motion."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from numpy.typing import NDArray

import garmentc
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
    key_tolerance    metres that leaving out the keyframes of one animation channel may move a vertex; 0 keeps all
    """

    influences: int = 4
    quantize: bool = False
    sparse: bool = True
    pose_keys: bool = True
    key_tolerance: float = 1e-4

    def __post_init__(self) -> None:
        if self.influences not in (4, 8):
            raise ValueError(f"influences must be 4 or 8, not {self.influences}")


@dataclass(frozen=True)
class Clip:
    """A motion and the morph weights along it.

    keys  (T, M); None evaluates the rig's pose-key network
    """

    motion: Motion
    keys: NDArray[Any] | None = None


@dataclass(frozen=True)
class Asset:
    """A finished outfit.

    rig          on welded vertices
    primitives   corner vertices and triangles, one primitive per material
    materials    what `CornerPrimitive.material` counts in
    clips        become animations
    morph_names  one for each blend shape; None numbers them
    extras       plain JSON for `asset.extras`
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

    @property
    def target_names(self) -> tuple[str, ...]:
        """One name for each morph target."""
        if self.morph_names is not None:
            return self.morph_names
        return tuple(f"pose_key_{index:03d}" for index in range(self.rig.morph_count))
