"""The last stage: finished outfits, and perhaps the body, to a .glb."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from garmentc.gltf.asset import Asset, Clip, GltfOptions, RiggedMesh
from garmentc.gltf.body_mesh import body_mesh
from garmentc.gltf.names import unique_names
from garmentc.gltf.reorder import reordered
from garmentc.gltf.skeletons import SKELETONS
from garmentc.gltf.write import WrittenGlb, write_glb
from garmentc.key_graph import write_key_graph
from garmentc.layer import Layer
from garmentc.options import CompileOptions
from garmentc.rig import Rig
from garmentc.smpl.motion import Motion


def emit(layers: Sequence[Layer], options: CompileOptions, output: Path) -> WrittenGlb:
    """Write the .glb and, where asked for, the pose-key network as ONNX."""
    settings, first = options.settings, layers[0]
    alignment, motions = first.dressed.alignment, first.dressed.motions
    betas = () if alignment.betas is None else alignment.betas
    meshes = file_meshes(layers, options)
    asset = Asset(
        name=meshes[0].name,
        rig=meshes[0].rig,
        primitives=meshes[0].primitives,
        materials=meshes[0].materials,
        clips=_clips(motions, meshes),
        options=GltfOptions(
            influences=settings.influences,
            quantize=settings.quantize,
            sparse=settings.sparse == "auto",
            pose_keys=options.pose_keys,
            skeleton=SKELETONS[options.skeleton],
            meshopt=options.meshopt,
        ),
        extras={
            "body": alignment.body.name,
            "gender": alignment.gender,
            "betas": ",".join(repr(float(beta)) for beta in betas),
            "bundle": first.source.bundle.name,
            "profile": options.profile,
            **{f"fps:{motion.name}": float(motion.fps) for motion in motions},
        },
        also=meshes[1:],
        ground=min(float(alignment.body.shaped(alignment.betas)[:, 1].min()), *(_lowest(mesh.rig) for mesh in meshes)),
    )
    written = write_glb(asset, output)
    if options.keys_onnx is not None and first.rig.keys is not None:
        write_key_graph(first.rig.keys, options.keys_onnx)
    return written


def _clips(motions: Sequence[Motion], meshes: Sequence[RiggedMesh]) -> tuple[Clip, ...]:
    """The motions, each with the keys that the meshes have for its frames."""
    ends = np.cumsum([len(motion) for motion in motions])[:-1]
    keys = [mesh.rig.animation_keys for mesh in meshes]
    parts = [[None] * len(motions) if all_keys is None else np.split(all_keys, ends) for all_keys in keys]
    return tuple(map(Clip, motions, zip(*parts, strict=True)))


def _lowest(rig: Rig) -> float:
    return float(rig.template[:, 1].min())


def file_meshes(layers: Sequence[Layer], options: CompileOptions) -> tuple[RiggedMesh, ...]:
    """The outfits and, where asked for, the body, under different names."""
    wanted = [options.name or layer.source.outfit.path.stem for layer in layers]
    *names, body_name = unique_names([*wanted, "body"], SKELETONS[options.skeleton].joints)
    meshes = [
        RiggedMesh(name, layer.rig, layer.dressed.corners.primitives, layer.dressed.outfit.materials)
        for name, layer in zip(names, layers, strict=True)
    ]
    if options.with_body:
        alignment = layers[0].dressed.alignment
        meshes.append(body_mesh(alignment.body, alignment.betas, body_name))
    if options.meshopt:
        meshes = [replace(mesh, primitives=tuple(map(reordered, mesh.primitives))) for mesh in meshes]
    return tuple(meshes)
