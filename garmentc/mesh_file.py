"""Writing plain meshes for other tools to look at: OBJ and binary PLY."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.output import written_whole

MESH_SUFFIXES = (".obj", ".ply")


def check_mesh_suffix(path: Path) -> None:
    """Raise GarmentcError unless `path` ends in .obj or .ply."""
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise GarmentcError(f"cannot write a mesh as '{path.suffix}'; name the file .obj or .ply", path)


def write_mesh(
    path: str | PathLike[str],
    vertices: NDArray[Any],
    triangles: NDArray[Any],
    texcoords: NDArray[Any] | None = None,
) -> None:
    """Write `vertices` (N, 3) in metres and `triangles` (F, 3) as the suffix of `path` says.

    texcoords  (N, 2) with v upwards, or None; only OBJ keeps them

    Numbers are float32 and written so that reading gives them back exactly.
    Raises GarmentcError where the suffix is another or the file cannot be written.
    """
    check_mesh_suffix(Path(path))
    points = np.asarray(vertices, np.float32)
    with written_whole(path) as file:
        if Path(path).suffix.lower() == ".obj":
            _write_obj(file, points, np.asarray(triangles), texcoords)
        else:
            _write_ply(file, points, np.asarray(triangles))


def _write_obj(
    file: BinaryIO, points: NDArray[np.float32], triangles: NDArray[Any], texcoords: NDArray[Any] | None
) -> None:
    np.savetxt(file, points, fmt="v %.9g %.9g %.9g")
    corners = triangles + 1
    if texcoords is None:
        np.savetxt(file, corners, fmt="f %d %d %d")
        return
    np.savetxt(file, np.asarray(texcoords, np.float32), fmt="vt %.9g %.9g")
    np.savetxt(file, np.repeat(corners, 2, axis=1), fmt="f %d/%d %d/%d %d/%d")


def _write_ply(file: BinaryIO, points: NDArray[np.float32], triangles: NDArray[Any]) -> None:
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("vertices", "<i4", 3)])
    faces["count"] = 3
    faces["vertices"] = triangles
    file.write(header.encode("ascii"))
    file.write(points.astype("<f4").tobytes())
    file.write(faces.tobytes())
