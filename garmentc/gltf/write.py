"""An asset to a .glb file."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from garmentc.errors import Diagnostic
from garmentc.gltf import pose_keys
from garmentc.gltf.accessors import AccessorWriter
from garmentc.gltf.animation import add_animation
from garmentc.gltf.asset import Asset
from garmentc.gltf.glb import glb_writer
from garmentc.gltf.materials import MaterialWriter
from garmentc.gltf.positions import position_codec
from garmentc.gltf.primitives import add_mesh
from garmentc.gltf.skin import add_joints, add_skin, on_grid
from garmentc.gltf.tracks import Track, clip_tracks

QUANTIZATION = "KHR_mesh_quantization"


@dataclass(frozen=True)
class WrittenGlb:
    """What `write_glb` did.

    bytes            size of the file
    keyframes        written, over all animation channels
    motion_frames    what they would be with every frame of every channel kept
    """

    path: Path
    bytes: int
    keyframes: int
    motion_frames: int
    warnings: tuple[Diagnostic, ...] = ()


def write_glb(asset: Asset, path: str | os.PathLike[str]) -> WrittenGlb:
    """Write `asset` as a .glb: one skinned mesh, 24 joints, morph targets, materials, animations, pose keys.

    Equal assets give equal bytes. The file appears whole or not at all.
    Raises GarmentcError where the file cannot be written, or where the rig holds NaN.
    """
    with glb_writer(path) as (document, chunk):
        tracks = _fill(document, AccessorWriter(document, chunk), asset)
    return WrittenGlb(
        path=Path(path),
        bytes=Path(path).stat().st_size,
        keyframes=sum(len(track.frames) for clip in tracks for track in clip),
        motion_frames=sum(len(clip.motion) * len(kept) for clip, kept in zip(asset.clips, tracks, strict=True)),
    )


def _fill(document: Any, writer: AccessorWriter, asset: Asset) -> list[tuple[Track, ...]]:
    from pygltflib import Asset as GltfAsset
    from pygltflib import Node, Scene

    document.asset = GltfAsset(generator=asset.generator, extras=dict(asset.extras))
    joints = add_joints(document, asset.rig.joints)
    armature = _add_node(document, Node(name=f"{asset.name}_armature", children=[joints[0]]))
    codec = position_codec(asset.rig, asset.options.quantize)
    materials = MaterialWriter(writer)
    used = {
        primitive.material: materials.add(asset.materials[primitive.material], primitive.texcoords is not None)
        for primitive in asset.primitives
    }
    mesh = add_mesh(writer, asset, codec, used)
    skin = add_skin(writer, joints, asset.rig.joints, codec.matrix)
    mesh_node = _add_node(document, Node(name=asset.name, mesh=mesh, skin=skin))
    document.scenes = [Scene(nodes=[armature, mesh_node])]  # a skinned mesh belongs at the root (section 3.7.3.3)
    document.scene = 0

    extensions = set(materials.extensions)
    if asset.options.pose_keys and asset.rig.keys is not None:
        extension = pose_keys.add_extension(writer, asset.rig.keys, joints)
        document.meshes[mesh].extensions = {pose_keys.EXTENSION: extension}
        document.nodes[mesh_node].extras = {pose_keys.EXTENSION: pose_keys.extras_string(asset.rig.keys)}
        extensions.add(pose_keys.EXTENSION)
    if asset.options.quantize:
        extensions.add(QUANTIZATION)
        document.extensionsRequired = [QUANTIZATION]
    document.extensionsUsed = sorted(extensions)

    tracks = []
    for clip in asset.clips:
        kept = clip_tracks(clip, asset.rig, on_grid(asset.rig.joints)[0], asset.options.key_tolerance)
        add_animation(writer, clip.motion.name, kept, clip.motion.fps, joints, mesh_node)
        tracks.append(kept)
    return tracks


def _add_node(document: Any, node: Any) -> int:
    document.nodes.append(node)
    return len(document.nodes) - 1
