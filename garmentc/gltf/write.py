"""An asset to a .glb file."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from garmentc.errors import Diagnostic
from garmentc.gltf import meshopt, pose_keys, vrm
from garmentc.gltf.accessors import AccessorWriter
from garmentc.gltf.animation import add_animation
from garmentc.gltf.asset import Asset, Clip, RiggedMesh
from garmentc.gltf.glb import glb_writer
from garmentc.gltf.materials import MaterialWriter
from garmentc.gltf.meshopt import MeshoptWriter
from garmentc.gltf.positions import position_codec
from garmentc.gltf.primitives import add_mesh
from garmentc.gltf.role import BODY, ROLE
from garmentc.gltf.skeletons import VRM
from garmentc.gltf.skin import JOINT_GRID, add_joints, add_skin, left_out_share, on_grid
from garmentc.gltf.track_error import keyframe_error
from garmentc.gltf.tracks import Track, clip_tracks

QUANTIZATION = "KHR_mesh_quantization"


@dataclass(frozen=True)
class WrittenGlb:
    """What `write_glb` did.

    bytes            size of the file
    keyframes        written, over all animation channels
    all_keyframes    what they would be with every frame of every channel kept
    keyframe_error   metres that leaving out keyframes moves a vertex, at frames of the motions
    """

    path: Path
    bytes: int
    keyframes: int
    all_keyframes: int
    keyframe_error: float
    warnings: tuple[Diagnostic, ...]


def write_glb(asset: Asset, path: str | os.PathLike[str]) -> WrittenGlb:
    """Write `asset` as a .glb: 24 joints, one skin, its meshes, morph targets, materials, animations, pose keys.

    Equal assets give equal bytes. The file appears whole or not at all.
    Raises GarmentcError where the file cannot be written, or where the rig holds NaN.
    """
    root = on_grid(asset.rig.joints)[0]
    clips = [(clip, clip_tracks(clip, asset.rigs, root, asset.options.key_tolerance)) for clip in asset.clips]
    with glb_writer(path) as (document, chunk):
        compression = MeshoptWriter(document, chunk) if asset.options.meshopt else None
        _fill(document, AccessorWriter(document, chunk, compression), asset, clips)
    return WrittenGlb(
        path=Path(path),
        bytes=Path(path).stat().st_size,
        keyframes=sum(len(track.frames) for _, tracks in clips for track in tracks),
        all_keyframes=sum(len(clip.motion) * len(tracks) for clip, tracks in clips),
        keyframe_error=max((keyframe_error(clip, asset.rigs, tracks, root) for clip, tracks in clips), default=0.0),
        warnings=_warnings(asset),
    )


def _warnings(asset: Asset) -> tuple[Diagnostic, ...]:
    warnings = []
    left_out = max(left_out_share(rig.weights, asset.options.influences) for rig in asset.rigs)
    if left_out >= 1e-6:
        message = (
            f"some vertices are pulled by more than {asset.options.influences} joints; "
            f"up to {left_out:.1%} of a vertex's weight was left out"
        )
        warnings.append(Diagnostic("influences-left-out", message))
    if asset.options.skeleton is VRM:
        message = f"the file says it is by '{vrm.AUTHOR}' and grants nothing beyond VRM's licence; edit VRMC_vrm.meta"
        warnings.append(Diagnostic("vrm-meta", message))
        if asset.options.quantize:
            message = "UniVRM does not read these quantized vertices; compile with --no-quantize for it"
            warnings.append(Diagnostic("vrm-quantized", message))
    return tuple(warnings)


def _fill(
    document: Any,
    writer: AccessorWriter,
    asset: Asset,
    clips: list[tuple[Clip, tuple[Track, ...]]],
) -> None:
    from pygltflib import Asset as GltfAsset
    from pygltflib import Node, Scene

    document.asset = GltfAsset(generator=asset.generator, extras=dict(asset.extras))
    skeleton = asset.options.skeleton
    joints = add_joints(document, asset.rig.joints, skeleton.joints)
    above = Node(name=skeleton.root or f"{asset.name}_armature", children=[joints[0]])
    if skeleton.grounded:
        above.translation = [0.0, -float(np.floor(asset.ground / JOINT_GRID) * JOINT_GRID), 0.0]
    armature = _add_node(document, above)
    codec = position_codec(*asset.rigs, quantize=asset.options.quantize, compress=asset.options.meshopt)
    materials = MaterialWriter(writer)
    meshes = [add_mesh(writer, shown, asset.options, codec, _add_materials(materials, shown)) for shown in asset.meshes]
    skin = add_skin(writer, joints, asset.rig.joints, codec.matrix, skeleton.name)
    mesh_nodes = [
        _add_node(document, Node(name=shown.name, mesh=mesh, skin=skin, extras=_role(shown)))
        for shown, mesh in zip(asset.meshes, meshes, strict=True)
    ]
    document.scenes = [Scene(nodes=[armature, *mesh_nodes])]  # a skinned mesh belongs at the root (section 3.7.3.3)
    document.scene = 0

    extensions = set(materials.extensions)
    for shown, mesh, mesh_node in zip(asset.meshes, meshes, mesh_nodes, strict=True):
        if asset.options.pose_keys and shown.rig.keys is not None:
            extension = pose_keys.add_extension(writer, shown.rig.keys, joints)
            document.meshes[mesh].extensions = {pose_keys.EXTENSION: extension}
            document.nodes[mesh_node].extras[pose_keys.EXTENSION] = pose_keys.extras_string(
                shown.rig.keys, skeleton.joints
            )
            extensions.add(pose_keys.EXTENSION)
    required = {QUANTIZATION} if asset.options.quantize else set()
    for clip, tracks in clips:
        add_animation(writer, clip.motion.name, tracks, clip.motion.fps, joints, mesh_nodes)
    if writer.meshopt is not None and writer.meshopt.finish():
        required.add(meshopt.EXTENSION)
    document.extensionsRequired = sorted(required)
    extensions |= required
    if skeleton is VRM:
        document.extensions = {vrm.EXTENSION: vrm.vrm_extension(asset.name, joints)}
        extensions.add(vrm.EXTENSION)
    document.extensionsUsed = sorted(extensions)


def _add_materials(materials: MaterialWriter, shown: RiggedMesh) -> dict[int, int]:
    """Add the materials that a mesh uses; returns the index of each in the document."""
    return {
        primitive.material: materials.add(shown.materials[primitive.material], primitive.texcoords is not None)
        for primitive in shown.primitives
    }


def _role(shown: RiggedMesh) -> dict[str, str]:
    """Extras of the mesh's node: a string, for exporters crash on lists and objects there."""
    return {ROLE: BODY} if shown.is_body else {}


def _add_node(document: Any, node: Any) -> int:
    document.nodes.append(node)
    return len(document.nodes) - 1
