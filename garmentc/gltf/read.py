"""Reading a .glb back, whoever wrote it. Nothing in the file is trusted: whatever is wrong raises GarmentcError."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.cursor import Cursor
from garmentc.gltf.glb import read_chunks
from garmentc.gltf.glb_asset import Animation, Channel, GlbAsset, Image, Mesh, Node, Skin
from garmentc.gltf.meshopt import EXTENSION
from garmentc.gltf.read_accessors import AccessorReader
from garmentc.gltf.read_materials import read_materials
from garmentc.gltf.read_mesh import read_mesh
from garmentc.gltf.read_pose_keys import network_in_extras
from garmentc.gltf.role import BODY, ROLE

_READABLE = {"KHR_mesh_quantization", "KHR_texture_transform", "KHR_materials_specular", EXTENSION}
_PATHS = {"translation": 3, "rotation": 4, "scale": 3}


def read_glb(path: str | os.PathLike[str]) -> GlbAsset:
    """The contents of a .glb, in memory as a whole.

    Raises GarmentcError where the file is missing, damaged, not glTF 2.0, needs other files, or is compressed.
    """
    chunks = read_chunks(path)
    root = Cursor(chunks.document, "", path)
    version = root.get("asset").get("version").text("missing")
    if version != "2.0":
        raise root.get("asset").error(f"has glTF version {version}", "export the file as glTF 2.0")
    required = tuple(root.get("extensionsRequired"))
    for name in required:
        if name.text() not in _READABLE and not name.text().startswith("KHR_materials_"):
            raise name.error(f"is {name.text()}, which garmentc does not read", "export the file without it")
    reader = AccessorReader(root, chunks.binary)
    skins = tuple(_read_skin(skin, reader, root) for skin in root.get("skins"))
    meshes = tuple(read_mesh(mesh, reader, root) for mesh in root.get("meshes"))
    nodes = _read_nodes(root, meshes, skins)
    animations = tuple(_read_animation(entry, reader, nodes, meshes) for entry in root.get("animations"))
    images = tuple(_read_image(image, reader) for image in root.get("images"))
    materials = read_materials(root, len(images))
    return GlbAsset(
        path=Path(path),
        generator=root.get("asset").get("generator").text(""),
        extensions_used=tuple(name.text() for name in root.get("extensionsUsed")),
        extensions_required=tuple(name.text() for name in required),
        extras=root.get("asset").get("extras").value,
        nodes=nodes,
        meshes=meshes,
        skins=skins,
        animations=animations,
        images=images,
        materials=materials,
        file_bytes=Path(path).stat().st_size,
        json_bytes=chunks.json_bytes,
        view_uses=tuple((where, reader.view_size(view)) for view, where in reader.view_uses.items()),
    )


def _read_nodes(root: Cursor, meshes: tuple[Mesh, ...], skins: tuple[Skin, ...]) -> tuple[Node, ...]:
    entries = list(root.get("nodes"))
    names = tuple(entry.get("name").text("") for entry in entries)
    parents = _parents(entries)
    nodes = []
    for entry, name, parent in zip(entries, names, parents, strict=True):
        mesh = entry.get("mesh").index(len(meshes)) if entry.get("mesh").given else None
        weights, matrix = entry.get("weights"), entry.get("matrix")
        skin = entry.get("skin").index(len(skins)) if entry.get("skin").given else None
        node = Node(
            name=name,
            parent=parent,
            translation=entry.get("translation").numbers(3, (0, 0, 0)),
            rotation=entry.get("rotation").numbers(4, (0, 0, 0, 1)),
            scale=entry.get("scale").numbers(3, (1, 1, 1)),
            matrix=np.array(matrix.numbers(16)).reshape(4, 4).T if matrix.given else None,
            mesh=mesh,
            skin=skin,
            weights=weights.numbers(0 if mesh is None else meshes[mesh].morph_count) if weights.given else None,
            pose_keys=network_in_extras(entry.get("extras"), names, () if skin is None else skins[skin].joints),
            is_body=isinstance(entry.get("extras").value, dict) and entry.get("extras").get(ROLE).value == BODY,
        )
        if node.mesh is not None and node.skin is not None:
            _check_joints(entry, meshes[node.mesh], skins[node.skin])
        nodes.append(node)
    return tuple(nodes)


def _parents(entries: list[Cursor]) -> list[int | None]:
    """Parent of each node; the graph must be a forest (glTF 2.0 section 3.5.2)."""
    parents: list[int | None] = [None] * len(entries)
    for index, entry in enumerate(entries):
        for child in entry.get("children"):
            number = child.index(len(entries))
            if parents[number] is not None:
                raise child.error("has more than one parent")
            parents[number] = index
    settled = [False] * len(entries)
    for index, entry in enumerate(entries):
        path: list[int] = []
        at: int | None = index
        while at is not None and not settled[at]:
            settled[at] = True
            path.append(at)
            at = parents[at]
        if at is not None and at in path:
            raise entry.error("is its own ancestor")
    return parents


def _check_joints(entry: Cursor, mesh: Mesh, skin: Skin) -> None:
    for primitive in mesh.primitives:
        if primitive.joints is not None and primitive.joints.max() >= len(skin.joints):
            raise entry.error(f"has a mesh with joint {primitive.joints.max()} in a skin of {len(skin.joints)} joints")


def _read_skin(entry: Cursor, reader: AccessorReader, root: Cursor) -> Skin:
    node_count = len(list(root.get("nodes")))
    joints = tuple(joint.index(node_count) for joint in entry.get("joints"))
    if not joints:
        raise entry.error("has no joints")
    matrices: NDArray[np.float32] = np.tile(np.eye(4, dtype=np.float32), (len(joints), 1, 1))
    if entry.get("inverseBindMatrices").given:
        values = reader.array(entry.get("inverseBindMatrices"), ("MAT4",))
        if len(values) < len(joints):
            raise entry.error(f"has {len(values)} inverse bind matrices for {len(joints)} joints")
        matrices = values[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)
    return Skin(name=entry.get("name").text(""), joints=joints, inverse_bind_matrices=matrices)


def _read_animation(
    entry: Cursor, reader: AccessorReader, nodes: tuple[Node, ...], meshes: tuple[Mesh, ...]
) -> Animation:
    samplers = list(entry.get("samplers"))
    channels = []
    for channel in entry.get("channels"):
        target = channel.get("target")
        path = target.get("path").text()
        if not target.get("node").given or path not in (*_PATHS, "weights"):
            continue  # an extension's business
        node = target.get("node").index(len(nodes))
        sampler = samplers[channel.get("sampler").index(len(samplers))]
        interpolation = sampler.get("interpolation").text("LINEAR")
        if interpolation not in ("LINEAR", "STEP", "CUBICSPLINE"):
            raise sampler.error(f"has interpolation {interpolation}, which glTF does not know")
        times = reader.array(sampler.get("input"), ("SCALAR",))
        if times.dtype != np.float32 or times[0] < 0 or np.any(times[1:] <= times[:-1]):
            raise sampler.get("input").error("must be increasing times in seconds")
        width = _PATHS.get(path) or _morph_count(nodes[node], meshes, target)
        rows = len(times) * (3 if interpolation == "CUBICSPLINE" else 1)
        kinds = {"weights": "SCALAR", "rotation": "VEC4"}.get(path, "VEC3")
        size = rows * width if path == "weights" else rows
        values = reader.array(sampler.get("output"), (kinds,), count=size).reshape(rows, width)
        channels.append(Channel(node, path, interpolation, times, values.astype(np.float32, copy=False)))
    return Animation(name=entry.get("name").text(""), channels=tuple(channels))


def _morph_count(node: Node, meshes: tuple[Mesh, ...], where: Cursor) -> int:
    count = 0 if node.mesh is None else meshes[node.mesh].morph_count
    if count == 0:
        raise where.error("animates the weights of a node without morph targets")
    return count


def _read_image(entry: Cursor, reader: AccessorReader) -> Image:
    if not entry.get("bufferView").given:
        raise entry.error("is not embedded in the file", "pack the images into the .glb")
    return Image(
        name=entry.get("name").text(""),
        mime_type=entry.get("mimeType").text(),
        data=reader.view_bytes(entry.get("bufferView")),
    )
