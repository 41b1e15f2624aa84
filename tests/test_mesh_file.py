"""Plain mesh files, read back by trimesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from garmentc.errors import GarmentcError
from garmentc.mesh_file import write_mesh


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".PLY"])
def test_another_library_reads_the_same_mesh(tmp_path: Path, suffix: str) -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(50, 3)).astype(np.float32)
    triangles = np.stack([rng.permutation(50)[:3] for _ in range(90)])
    write_mesh(tmp_path / f"a{suffix}", points, triangles)
    read = trimesh.load(tmp_path / f"a{suffix}", process=False, file_type=suffix[1:].lower())
    np.testing.assert_array_equal(np.asarray(read.vertices, np.float32), points)
    np.testing.assert_array_equal(read.faces, triangles)


def test_obj_keeps_texture_coordinates(tmp_path: Path) -> None:
    points = np.eye(3)
    texcoords = np.array([[0, 0], [1, 0], [0.25, 1 / 3]])
    write_mesh(tmp_path / "a.obj", points, np.array([[0, 1, 2]]), texcoords)
    read = trimesh.load(tmp_path / "a.obj", process=False)
    np.testing.assert_array_equal(np.asarray(read.visual.uv, np.float32), texcoords.astype(np.float32))


def test_another_suffix_is_refused(tmp_path: Path) -> None:
    with pytest.raises(GarmentcError, match=r"name the file \.obj or \.ply"):
        write_mesh(tmp_path / "a.stl", np.eye(3), np.array([[0, 1, 2]]))
