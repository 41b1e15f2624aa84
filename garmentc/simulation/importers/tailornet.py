"""TailorNet's dataset (Patel, Liao and Pons-Moll 2020) as published.

    garment_class_info.pkl                    {class: {"f": faces, "vert_indices": vertices of the fine SMPL}}
    skirt_weight.npz                          "w": skirt vertices as means of the body's; only for skirts
    smpl/smpl_hres_<gender>.npz               the fine SMPL, 27,554 vertices, as the dataset's scripts save it
    <class>_<gender>/shape/beta_<b>.npy       shape coefficients
    <class>_<gender>/style/gamma_<g>.npy      style coefficients
    <class>_<gender>/style_shape/beta<b>_gamma<g>.npy   displacements at rest
    <class>_<gender>/pose/<b>_<g>/poses_<s>.npz         "thetas" (T, 72)
    <class>_<gender>/pose/<b>_<g>/unposed_<s>.npy       displacements (T, N, 3)

Displacements are added to the unposed body, shape and pose correctives included, before it is skinned. The poses are
single ones, settled, not a motion: they are written at one frame a second.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.simulation.sequence import QualityTrack, Sequence, SequenceFacts
from garmentc.smpl.arrays import numbers, read_npz
from garmentc.smpl.body import BodyModel
from garmentc.smpl.correctives import COLUMNS, PoseCorrectives
from garmentc.smpl.inert_pickle import read_inert_pickle
from garmentc.smpl.pickle_arrays import to_array
from garmentc.smpl.pose_layout import shortest
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_COUNT, PARENTS
from garmentc.smpl.skinning import joint_transforms, skin

CATEGORIES = {
    "t-shirt": "top",
    "old-t-shirt": "top",
    "shirt": "top",
    "pant": "trousers",
    "short-pant": "trousers",
    "skirt": "skirt",
}
FPS = 1.0


@dataclass(frozen=True)
class TailorNetSequence:
    """Where one sequence lies: root/<garment>_<gender>/pose/<beta>_<gamma>/…_<part>."""

    root: Path
    garment: str
    gender: str
    beta: str
    gamma: str
    part: str

    @property
    def name(self) -> str:
        return f"{self.outfit}.{self.part}"

    @property
    def outfit(self) -> str:
        return f"{self.garment}_{self.gender}_{self.beta}_{self.gamma}"

    @property
    def folder(self) -> Path:
        return self.root / f"{self.garment}_{self.gender}"


def tailornet_sequences(root: Path) -> list[TailorNetSequence]:
    """All sequences below `root`, sorted by name. Raises GarmentcError where there is none."""
    found = []
    for garment in CATEGORIES:
        for gender in ("female", "male"):
            for path in (root / f"{garment}_{gender}" / "pose").glob("*/unposed_*.npy"):
                pair, part = re.fullmatch(r"(\d+)_(\d+)", path.parent.name), path.stem.removeprefix("unposed_")
                if pair is not None and re.fullmatch(r"[A-Za-z0-9_-]+", part):
                    found.append(TailorNetSequence(root, garment, gender, pair[1], pair[2], part))
    if not found:
        raise GarmentcError("holds no TailorNet data: no <class>_<gender>/pose/<shape>_<style>/unposed_*.npy", root)
    return sorted(found, key=lambda sequence: sequence.name)


def read_tailornet_sequence(sequence: TailorNetSequence) -> Sequence:
    """One sequence, its garment posed. Nothing in the files is executed.

    Raises GarmentcError where a file is missing or damaged, or arrays do not fit together.
    """
    folder, pair = sequence.folder, f"{sequence.beta}_{sequence.gamma}"
    on_body = _garment_on_body(sequence.root, sequence.garment, sequence.gender)
    count = len(on_body.weights)
    betas = _read_npy(folder / "shape" / f"beta_{sequence.beta}.npy", ("S",))[:10]
    gamma = _read_npy(folder / "style" / f"gamma_{sequence.gamma}.npy", ("G",))
    poses_path = folder / "pose" / pair / f"poses_{sequence.part}.npz"
    thetas = numbers(read_npz(poses_path, ["thetas"]), "thetas", ("T", 3 * JOINT_COUNT), poses_path)
    offsets = _read_npy(folder / "pose" / pair / f"unposed_{sequence.part}.npy", (len(thetas), count, 3))
    at_rest = _read_npy(folder / "style_shape" / f"beta{sequence.beta}_gamma{sequence.gamma}.npy", (count, 3))

    poses = thetas.reshape(-1, JOINT_COUNT, 3)
    vertices = np.stack([on_body.posed(pose, betas, offset) for pose, offset in zip(poses, offsets, strict=True)])
    frames = len(poses)
    return Sequence(
        facts=SequenceFacts(
            name=sequence.name,
            outfit=sequence.outfit,
            motion="poses_" + hashlib.sha256(thetas.astype(np.float32).tobytes()).hexdigest()[:12],
            category=CATEGORIES[sequence.garment],
            fabric="",
            body=on_body.body.name,
            gender=sequence.gender,
            fps=FPS,
            seed=0,
            parts=(sequence.garment,),
            tightness=(),
            parameters={"gamma": gamma.tolist()},
        ),
        template=(on_body.of_body(on_body.body.shaped(betas)) + at_rest).astype(np.float32),
        faces=on_body.faces,
        triangle_part=np.zeros(len(on_body.faces), np.int32),
        texcoords=None,
        betas=betas.astype(np.float32),
        poses=shortest(poses).astype(np.float32),
        trans=np.zeros((frames, 3), np.float32),
        vertices=vertices.astype(np.float32),
        quality=QualityTrack.unmeasured(frames),
    )


@dataclass(frozen=True)
class _GarmentOnBody:
    """A garment class tied to the fine body: each garment vertex is a body vertex, or for skirts a mean of some.

    `picked` (N,) or `means` (N, V), the other is None; faces (F, 3); weights (N, 24)
    """

    body: BodyModel
    picked: NDArray[np.intp] | None
    means: NDArray[np.float64] | None
    faces: NDArray[np.int32]

    @property
    def weights(self) -> NDArray[Any]:
        return self.of_body(self.body.weights)

    def of_body(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Rows (N, …) of the garment from rows (V, …) of the body."""
        chosen: NDArray[Any] = rows[self.picked] if self.means is None else self.means @ rows
        return chosen

    def posed(self, pose: NDArray[Any], betas: NDArray[Any], offset: NDArray[Any]) -> NDArray[Any]:
        """The garment (N, 3) with displacements (N, 3) on the body in `pose` (24, 3)."""
        rotations = axis_angle_to_matrix(pose)
        unposed = self.body.shaped(betas)
        self.body.correctives.add_to(unposed, rotations)
        return skin(self.of_body(unposed) + offset, self.weights, joint_transforms(rotations, self.body.joints(betas)))


@cache
def _garment_on_body(root: Path, garment: str, gender: str) -> _GarmentOnBody:
    body = _fine_body(root / "smpl" / f"smpl_hres_{gender}.npz", gender)
    path = root / "garment_class_info.pkl"
    classes = read_inert_pickle(path)
    entry = classes.get(garment) if isinstance(classes, dict) else None
    if not isinstance(entry, dict) or "f" not in entry:
        raise GarmentcError(f"does not describe the garment class '{garment}'", path)
    arrays = {key: to_array(entry[key], key, path) for key in ("f", "vert_indices") if entry.get(key) is not None}
    picked, means = None, None
    if garment == "skirt":
        weights = root / "skirt_weight.npz"
        means = numbers(read_npz(weights, ["w"]), "w", ("N", len(body.v_template)), weights)
    else:
        picked = numbers(arrays, "vert_indices", ("N",), path).astype(np.intp)
        _check_range(picked, len(body.v_template), "vert_indices", path)
    faces = numbers(arrays, "f", ("F", 3), path).astype(np.int32)
    _check_range(faces, len(picked) if means is None else len(means), "f", path)  # type: ignore[arg-type]
    return _GarmentOnBody(body, picked, means, faces)


def _fine_body(path: Path, gender: str) -> BodyModel:
    """The subdivided SMPL. Unlike SMPL's own files its `kintree_table` has the parents only."""
    keys = ("v_template", "f", "weights", "shapedirs", "posedirs", "J_regressor", "kintree_table")
    arrays = read_npz(path, keys)
    v_template = numbers(arrays, "v_template", ("V", 3), path)
    count = len(v_template)
    parents = numbers(arrays, "kintree_table", (JOINT_COUNT,), path).astype(np.int64)
    if (parents[1:] != PARENTS[1:]).any():
        raise GarmentcError("'kintree_table' is not SMPL's", path)
    regressor = numbers(arrays, "J_regressor", (JOINT_COUNT, count), path)
    shapedirs = numbers(arrays, "shapedirs", (count, 3, "S"), path)
    return BodyModel(
        name=path.stem,
        gender=gender,
        v_template=v_template,
        faces=numbers(arrays, "f", ("F", 3), path).astype(np.int32),
        weights=numbers(arrays, "weights", (count, JOINT_COUNT), path),
        shapedirs=shapedirs,
        J_template=regressor @ v_template,
        J_shapedirs=np.tensordot(regressor, shapedirs, 1),
        correctives=PoseCorrectives.from_dense(numbers(arrays, "posedirs", (count, 3, COLUMNS), path)),
    )


def _check_range(index: NDArray[Any], count: int, key: str, path: Path) -> None:
    if index.size and (index.min() < 0 or index.max() >= count):
        raise GarmentcError(f"'{key}' refers to vertex {index.max()} of {count}", path)


def _read_npy(path: Path, shape: tuple[int | str, ...]) -> NDArray[np.float64]:
    try:
        array = np.load(path, allow_pickle=False)
    except OSError as error:
        raise GarmentcError(f"cannot be read: {error.strerror or error}", path) from None
    except (ValueError, EOFError, MemoryError) as error:
        raise GarmentcError(f"is no plain .npy file ({error})", path) from None
    return numbers({path.stem: array}, path.stem, shape, path)
