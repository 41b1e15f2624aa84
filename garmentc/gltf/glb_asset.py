"""A .glb in memory: what reading one back gives, as numpy arrays, sparse and quantized storage resolved."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.rig import DenseLayer

_DEFAULT_FPS = 30.0
"""Where an animation does not say how many frames a second it has."""


@dataclass(frozen=True)
class Storage:
    """How an accessor lies in the file.

    bytes   of its buffer views, padding included
    sparse  number of sparse entries, or None where it is dense
    """

    component: str  # numpy's name: "float32", "int16", ...
    normalized: bool
    bytes: int
    sparse: int | None = None


@dataclass(frozen=True)
class Primitive:
    """Attributes as stored, integers scaled to fractions where normalised; not yet through the skin.

    positions        (S, 3) float32
    triangles        (F, 3) uint32
    joints           (S, 4 * sets) int32 positions in `Skin.joints`, or None
    weights          (S, 4 * sets) float32, or None
    morph_positions  (M, S, 3) float32
    morph_normals    (M, S, 3) float32, or None
    storage          by attribute: "POSITION", "indices", "targets/0/POSITION", ...
    """

    positions: NDArray[np.float32]
    triangles: NDArray[np.uint32]
    normals: NDArray[np.float32] | None
    tangents: NDArray[np.float32] | None
    texcoords: NDArray[np.float32] | None
    colors: NDArray[np.float32] | None
    joints: NDArray[np.int32] | None
    weights: NDArray[np.float32] | None
    morph_positions: NDArray[np.float32]
    morph_normals: NDArray[np.float32] | None
    material: int | None
    storage: dict[str, Storage] = field(default_factory=dict)


@dataclass(frozen=True)
class PoseKeyNetwork:
    """The pose-key network of a mesh: local rotations of `joints` to morph weights.

    joints  nodes, in the order of the encoding
    """

    encoding: str
    joints: tuple[int, ...]
    layers: tuple[DenseLayer, ...]


@dataclass(frozen=True)
class Mesh:
    name: str
    primitives: tuple[Primitive, ...]
    weights: tuple[float, ...]
    target_names: tuple[str, ...]
    pose_keys: PoseKeyNetwork | None

    @property
    def morph_count(self) -> int:
        return len(self.primitives[0].morph_positions)


@dataclass(frozen=True)
class Node:
    """A node. `matrix` is None unless the file gives one instead of translation, rotation and scale.

    rotation   quaternion x, y, z, w
    pose_keys  the network in the node's extras
    is_body    shows the body, not an outfit
    """

    name: str
    parent: int | None
    translation: tuple[float, ...]
    rotation: tuple[float, ...]
    scale: tuple[float, ...]
    matrix: NDArray[np.float64] | None
    mesh: int | None
    skin: int | None
    weights: tuple[float, ...] | None
    pose_keys: PoseKeyNetwork | None
    is_body: bool = False


@dataclass(frozen=True)
class Skin:
    """joints are nodes; inverse_bind_matrices (J, 4, 4) float32, row-major."""

    name: str
    joints: tuple[int, ...]
    inverse_bind_matrices: NDArray[np.float32]


@dataclass(frozen=True)
class Channel:
    """One animated property: keyframe times (K,), seconds, and values (K, C), or (3 K, C) for CUBICSPLINE."""

    node: int
    path: str
    interpolation: str
    times: NDArray[np.float32]
    values: NDArray[np.float32]


@dataclass(frozen=True)
class Animation:
    name: str
    channels: tuple[Channel, ...]

    @property
    def duration(self) -> float:
        return max((float(channel.times[-1]) for channel in self.channels), default=0.0)


@dataclass(frozen=True)
class Image:
    name: str
    mime_type: str
    data: bytes


@dataclass(frozen=True)
class GlbMaterial:
    """values: numbers, strings and flags by their path in the JSON; images: index into `GlbAsset.images` by path."""

    name: str
    values: dict[str, Any]
    images: dict[str, int]


@dataclass(frozen=True)
class GlbAsset:
    """A whole file.

    extras     of the asset, whatever they are
    view_uses  (place in the document, bytes) of each buffer view that something was read from
    """

    path: Path
    generator: str
    extensions_used: tuple[str, ...]
    extensions_required: tuple[str, ...]
    extras: Any
    nodes: tuple[Node, ...]
    meshes: tuple[Mesh, ...]
    skins: tuple[Skin, ...]
    animations: tuple[Animation, ...]
    images: tuple[Image, ...]
    materials: tuple[GlbMaterial, ...]
    file_bytes: int
    json_bytes: int
    view_uses: tuple[tuple[str, int], ...] = ()

    def frame_rate(self, animation: int) -> float:
        """Frames a second that an animation was made with, as the compiler wrote it into the extras."""
        if isinstance(self.extras, dict) and animation < len(self.animations):
            written = self.extras.get(f"fps:{self.animations[animation].name}")
            if isinstance(written, (int, float)) and written > 0:
                return float(written)
        return _DEFAULT_FPS

    @property
    def mesh_nodes(self) -> tuple[int, ...]:
        """Nodes that show a mesh, in the file's order."""
        return tuple(index for index, node in enumerate(self.nodes) if node.mesh is not None)

    @property
    def outfit_nodes(self) -> tuple[int, ...]:
        """Those of `mesh_nodes` that show an outfit, not the body."""
        return tuple(index for index in self.mesh_nodes if not self.nodes[index].is_body)
