"""What is in a .glb: counts, sizes and what engines will make of it, ready to be printed as tables or as JSON."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np

from garmentc.gltf.bind import morph_sizes
from garmentc.gltf.finding import Finding
from garmentc.gltf.glb_asset import GlbAsset, Image, Primitive, Storage
from garmentc.gltf.posing import pose_key_network
from garmentc.gltf.validate import validate_glb


@dataclass(frozen=True)
class PrimitiveSummary:
    """attributes: stored type of each by name, as "int16 normalised"; influences: joints that pull a vertex at most."""

    mesh: str
    material: str
    vertices: int
    triangles: int
    influences: int
    attributes: dict[str, str]


@dataclass(frozen=True)
class MorphSummary:
    """vertices: of all primitives, that the target moves; largest_mm: the farthest one at weight 1."""

    mesh: str
    name: str
    vertices: int
    largest_mm: float
    bytes: int


@dataclass(frozen=True)
class AnimationSummary:
    name: str
    seconds: float
    channels: int
    keyframes: int


@dataclass(frozen=True)
class PoseKeySummary:
    """layers: sizes from the inputs to the outputs; parameters: numbers in the network."""

    mesh: str
    encoding: str
    layers: tuple[int, ...]
    parameters: int


@dataclass(frozen=True)
class ImageSummary:
    """width and height in pixels, 0 where the header cannot be read."""

    name: str
    mime_type: str
    bytes: int
    width: int
    height: int


@dataclass(frozen=True)
class GlbSummary:
    """bytes_by_kind: where the bytes go; the parts add up to `bytes`."""

    file: str
    bytes: int
    generator: str
    extensions: tuple[str, ...]
    joints: int
    bytes_by_kind: dict[str, int]
    primitives: tuple[PrimitiveSummary, ...]
    morphs: tuple[MorphSummary, ...]
    animations: tuple[AnimationSummary, ...]
    pose_keys: tuple[PoseKeySummary, ...]
    images: tuple[ImageSummary, ...]
    findings: tuple[Finding, ...]


def inspect_glb(asset: GlbAsset) -> GlbSummary:
    return GlbSummary(
        file=str(asset.path),
        bytes=asset.file_bytes,
        generator=asset.generator,
        extensions=asset.extensions_used,
        joints=max((len(skin.joints) for skin in asset.skins), default=0),
        bytes_by_kind=_bytes_by_kind(asset),
        primitives=tuple(
            _primitive(asset, mesh.name, primitive) for mesh in asset.meshes for primitive in mesh.primitives
        ),
        morphs=tuple(morph for index in asset.mesh_nodes for morph in _morphs(asset, index)),
        animations=tuple(
            AnimationSummary(
                name=animation.name,
                seconds=animation.duration,
                channels=len(animation.channels),
                keyframes=sum(len(channel.times) for channel in animation.channels),
            )
            for animation in asset.animations
        ),
        pose_keys=tuple(network for index in asset.mesh_nodes for network in _pose_keys(asset, index)),
        images=tuple(_image(image) for image in asset.images),
        findings=validate_glb(asset),
    )


def _bytes_by_kind(asset: GlbAsset) -> dict[str, int]:
    kinds = {"json": asset.json_bytes}
    for where, size in asset.view_uses:
        kind = _kind(where)
        kinds[kind] = kinds.get(kind, 0) + size
    kinds["other"] = asset.file_bytes - sum(kinds.values())
    return kinds


def _kind(where: str) -> str:
    """What a buffer view is for, from the place in the document that refers to it."""
    parts = where.split("/")
    if "extensions" in parts:
        return "pose keys"
    if parts[1] in ("skins", "animations", "images"):
        return parts[1]
    if "targets" in parts:
        return "morph targets"
    return "indices" if parts[-1] == "indices" else "vertices"


def _primitive(asset: GlbAsset, mesh: str, primitive: Primitive) -> PrimitiveSummary:
    weights = primitive.weights
    return PrimitiveSummary(
        mesh=mesh,
        material="" if primitive.material is None else asset.materials[primitive.material].name,
        vertices=len(primitive.positions),
        triangles=len(primitive.triangles),
        influences=0 if weights is None else int((weights > 0).sum(axis=1).max()),
        attributes={
            name: _stored(storage) for name, storage in primitive.storage.items() if not name.startswith("targets/")
        },
    )


def _stored(storage: Storage) -> str:
    return storage.component + (" normalised" if storage.normalized else "") + (" sparse" if storage.sparse else "")


def _morphs(asset: GlbAsset, mesh_node: int) -> list[MorphSummary]:
    mesh = asset.meshes[asset.nodes[mesh_node].mesh or 0]
    sizes = morph_sizes(asset, mesh_node)
    return [
        MorphSummary(
            mesh=mesh.name,
            name=mesh.target_names[morph] if morph < len(mesh.target_names) else "",
            vertices=sum(int((p.morph_positions[morph] != 0).any(axis=1).sum()) for p in mesh.primitives),
            largest_mm=float(sizes[morph]) * 1000,
            bytes=sum(
                storage.bytes
                for primitive in mesh.primitives
                for name, storage in primitive.storage.items()
                if name.startswith(f"targets/{morph}/")
            ),
        )
        for morph in range(mesh.morph_count)
    ]


def _pose_keys(asset: GlbAsset, mesh_node: int) -> list[PoseKeySummary]:
    network = pose_key_network(asset, mesh_node)
    if network is None:
        return []
    sizes = (network.layers[0].weight.shape[1], *(len(layer.bias) for layer in network.layers))
    parameters = sum(int(np.size(layer.weight) + np.size(layer.bias)) for layer in network.layers)
    return [PoseKeySummary(asset.nodes[mesh_node].name, network.encoding, sizes, parameters)]


def _image(image: Image) -> ImageSummary:
    width, height = _size(image.data)
    return ImageSummary(image.name, image.mime_type, len(image.data), width, height)


def _size(data: bytes) -> tuple[int, int]:
    """Pixels of a PNG (its IHDR chunk) or a JPEG (its first start-of-frame segment)."""
    if data[:8] == b"\x89PNG\r\n\x1a\n" and len(data) >= 24:
        width, height = struct.unpack_from(">II", data, 16)
        return width, height
    at = 2
    while data[:2] == b"\xff\xd8" and at + 9 <= len(data) and data[at] == 0xFF:
        marker, length = data[at + 1], struct.unpack_from(">H", data, at + 2)[0]
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        at += 2 + length
    return 0, 0
