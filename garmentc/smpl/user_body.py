"""A user's own SMPL, SMPL-H or SMPL-X model file as a body with the 24 SMPL joints.

The three models share joints 0 to 21. The rest is folded so that one skeleton serves all:

    SMPL    24 joints  as they are
    SMPL-H  52 joints  15 fingers a hand become left_hand and right_hand, at the root of the middle finger
    SMPL-X  55 joints  fingers likewise; jaw and eyes become part of the head

Folding is exact as long as fingers, jaw and eyes keep their rest rotation. Their pose correctives are left out.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.smpl.arrays import numbers, read_npz, shape_text
from garmentc.smpl.body import BodyModel
from garmentc.smpl.correctives import COLUMNS, PoseCorrectives
from garmentc.smpl.gender import parse_gender
from garmentc.smpl.inert_pickle import read_inert_pickle
from garmentc.smpl.pickle_arrays import to_array
from garmentc.smpl.pose_layout import BODY_JOINT_COUNT
from garmentc.smpl.skeleton import JOINT_COUNT, JOINT_NAMES, PARENTS

KEYS = ("v_template", "f", "weights", "shapedirs", "posedirs", "J_regressor", "kintree_table")

_HEAD, _LEFT_HAND, _RIGHT_HAND = (JOINT_NAMES.index(name) for name in ("head", "left_hand", "right_hand"))


@dataclass(frozen=True)
class _Layout:
    """Joints of one model: `folded[k]` is the SMPL joint that takes joint k; `hands` are the roots of the hands."""

    name: str
    folded: tuple[int, ...]
    hands: tuple[int, int]


_BODY = tuple(range(BODY_JOINT_COUNT))
_FINGERS = (_LEFT_HAND,) * 15 + (_RIGHT_HAND,) * 15  # index, middle, little, ring finger, thumb: three joints each

_LAYOUTS = {
    24: _Layout("SMPL", (*_BODY, _LEFT_HAND, _RIGHT_HAND), (22, 23)),
    52: _Layout("SMPL-H", (*_BODY, *_FINGERS), (25, 40)),
    55: _Layout("SMPL-X", (*_BODY, _HEAD, _HEAD, _HEAD, *_FINGERS), (28, 43)),
}


def read_user_body(path: Path, gender: str | None = None) -> BodyModel:
    """The body model in an SMPL, SMPL-H or SMPL-X file, .npz or .pkl, float64. Nothing in the file is executed.

    `gender` None takes the file's word, then its name's, then "neutral".
    Raises GarmentcError naming the array that is missing, misshapen or not finite.
    """
    arrays = _read_arrays(path)
    missing = [key for key in KEYS if key not in arrays]
    if missing:
        raise GarmentcError(f"lacks {', '.join(missing)}; a body model holds {', '.join(KEYS)}", path)
    joint_count = numbers(arrays, "kintree_table", (2, "joints"), path).shape[1]
    if joint_count not in _LAYOUTS:
        raise GarmentcError(
            f"'kintree_table' has {joint_count} joints, expected 24 (SMPL), 52 (SMPL-H) or 55 (SMPL-X)", path
        )
    layout = _LAYOUTS[joint_count]
    _check_hierarchy(arrays["kintree_table"], layout, path)

    v_template = numbers(arrays, "v_template", ("V", 3), path)
    count = len(v_template)
    shapedirs = _shape_columns(numbers(arrays, "shapedirs", (count, 3, "S"), path), layout)
    posedirs = numbers(arrays, "posedirs", (count, 3, 9 * (joint_count - 1)), path)
    regressor = numbers(arrays, "J_regressor", (joint_count, count), path)[[*_BODY, *layout.hands]]
    _check_sums(regressor, "J_regressor", path)
    body = BodyModel(
        name=path.stem,
        gender=gender or _gender(arrays, path),
        v_template=v_template,
        faces=_faces(arrays, count, path),
        weights=_weights(numbers(arrays, "weights", (count, joint_count), path), layout, path),
        shapedirs=shapedirs,
        J_template=regressor @ v_template,
        J_shapedirs=np.tensordot(regressor, shapedirs, 1),
        correctives=PoseCorrectives.from_dense(_body_columns(posedirs, layout)),
    )
    _check_stance(body, path)
    return body


def _read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    suffix = path.suffix.lower()
    if suffix == ".npz":
        return read_npz(path, (*KEYS, "gender"))
    if suffix not in (".pkl", ".pickle"):
        raise GarmentcError(f"unknown kind of body model '{path.suffix}'; use .npz or .pkl", path)
    content = read_inert_pickle(path)
    if not isinstance(content, dict):
        raise GarmentcError(f"holds a {type(content).__name__}, expected a dict with {', '.join(KEYS)}", path)
    return {key: to_array(content[key], key, path) for key in (*KEYS, "gender") if key in content}


def _check_hierarchy(table: NDArray[Any], layout: _Layout, path: Path) -> None:
    for joint, parent in enumerate(table[0].tolist()):
        ours = layout.folded[joint]
        if joint == 0:
            continue  # the root's parent is written as -1 or 4294967295
        if not 0 <= parent < joint or layout.folded[int(parent)] not in (ours, PARENTS[ours]):
            raise GarmentcError(
                f"'kintree_table' gives joint {joint} the parent {parent}; {layout.name} has another", path
            )


def _shape_columns(shapedirs: NDArray[np.float64], layout: _Layout) -> NDArray[np.float64]:
    """Without SMPL-X's expression columns, which follow 300 shape columns, or 10 in its smaller files."""
    columns = shapedirs.shape[2]
    if layout.name != "SMPL-X" or columns < 20:
        return shapedirs
    return shapedirs[:, :, : 300 if columns >= 400 else 10]


def _body_columns(posedirs: NDArray[np.float64], layout: _Layout) -> NDArray[np.float64]:
    """(V, 3, 207): the columns of joints 1..23, those of folded joints zero."""
    if layout.name == "SMPL":
        return posedirs
    kept = 9 * (BODY_JOINT_COUNT - 1)
    columns = np.zeros((*posedirs.shape[:2], COLUMNS))
    columns[:, :, :kept] = posedirs[:, :, :kept]
    return columns


def _weights(weights: NDArray[np.float64], layout: _Layout, path: Path) -> NDArray[np.float64]:
    if weights.min() < -1e-4:
        raise GarmentcError(f"'weights' holds negative weights (least {weights.min():g})", path)
    _check_sums(weights, "weights", path)
    positive = np.maximum(weights, 0)
    folded: NDArray[np.float64] = positive @ np.eye(JOINT_COUNT)[list(layout.folded)]
    folded /= positive.sum(axis=1, keepdims=True)
    return folded


def _check_sums(rows: NDArray[np.float64], key: str, path: Path) -> None:
    sums = rows.sum(axis=1)
    worst = int(np.argmax(np.abs(sums - 1)))
    if abs(sums[worst] - 1) > 0.01:
        raise GarmentcError(f"row {worst} of '{key}' sums to {sums[worst]:.3g}, expected 1", path)


def _faces(arrays: dict[str, NDArray[Any]], count: int, path: Path) -> NDArray[np.int32]:
    faces = numbers(arrays, "f", ("F", 3), path)
    if not len(faces) or faces.min() < 0 or faces.max() >= count or (faces != np.floor(faces)).any():
        raise GarmentcError(f"'f' ({shape_text(faces.shape)}) holds indices outside 0 to {count - 1}", path)
    return faces.astype(np.int32)


def _gender(arrays: dict[str, NDArray[Any]], path: Path) -> str:
    if "gender" in arrays:
        return parse_gender(arrays["gender"], path)
    for word in re.split(r"[^a-z]+", path.stem.lower()):
        if word in ("female", "male", "neutral", "f", "m", "n"):
            return parse_gender(word)
    return "neutral"


def _check_stance(body: BodyModel, path: Path) -> None:
    """The body must stand in metres, Y up, with its left side at +X, as SMPL's do."""
    left, right, head = (
        body.J_template[JOINT_NAMES.index(name)] for name in ("left_shoulder", "right_shoulder", "head")
    )
    height = head[1] - body.J_template[0, 1]
    if not 0.2 < height < 1.5 or left[0] <= right[0]:
        raise GarmentcError(
            f"the body does not stand as SMPL does (metres, Y up, left at +X): its head is {height:.3g} above its "
            f"pelvis, its left shoulder at x = {left[0]:.3g}; convert the model first",
            path,
        )
