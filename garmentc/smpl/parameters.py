"""SMPL parameters of one body: the `--params` file."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.schema import check_schema
from garmentc.smpl.arrays import numbers, read_npz, shape_text
from garmentc.smpl.gender import parse_gender
from garmentc.smpl.pose_layout import LAYOUTS, to_smpl_pose
from garmentc.smpl.skeleton import JOINT_COUNT


@dataclass(frozen=True)
class Parameters:
    """What a file says about one body; None where it says nothing.

    gender  "female", "male" or "neutral"
    betas   (S,) float64 shape coefficients
    pose    (24, 3) float64 axis-angle, radians, relative to the parent
    """

    gender: str | None = None
    betas: NDArray[np.float64] | None = None
    pose: NDArray[np.float64] | None = None


def read_parameters(path: Path) -> Parameters:
    """SMPL parameters from .json (schemas/parameters.schema.json) or .npz (arrays gender, betas, pose or poses).

    A pose of SMPL-H or SMPL-X is cut to SMPL's joints.
    Raises GarmentcError naming the value that is wrong.
    """
    suffix = path.suffix.lower()
    if suffix == ".json":
        return _read_json(path)
    if suffix == ".npz":
        return _read_npz(path)
    raise GarmentcError(f"unknown kind of parameter file '{path.suffix}'; use .json or .npz", path)


def _read_json(path: Path) -> Parameters:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise GarmentcError(f"cannot be read: {error.strerror}", path) from None
    except UnicodeDecodeError:
        raise GarmentcError("is not JSON: it is not UTF-8 text", path) from None
    except json.JSONDecodeError as error:
        raise GarmentcError(f"is not JSON: {error.msg}", path, error.lineno) from None
    except (ValueError, RecursionError) as error:  # an integer of thousands of digits; brackets thousands deep
        raise GarmentcError(f"is not usable JSON: {error}", path) from None
    check_schema(document, "parameters", path)
    given: dict[str, Any] = {key: np.array(document[key]) for key in ("betas", "pose") if key in document}
    pose = numbers({"pose": given["pose"].reshape(-1)}, "pose", (3 * JOINT_COUNT,), path) if "pose" in given else None
    return Parameters(
        gender=document.get("gender"),
        betas=numbers(given, "betas", ("S",), path) if "betas" in given else None,
        pose=None if pose is None else to_smpl_pose(pose),
    )


def _read_npz(path: Path) -> Parameters:
    arrays = read_npz(path, ("gender", "betas", "pose", "poses"))
    if not arrays:
        raise GarmentcError("holds none of the arrays gender, betas, pose", path)
    if "betas" in arrays and arrays["betas"].ndim == 2 and len(arrays["betas"]) == 1:
        arrays["betas"] = arrays["betas"][0]
    key = "pose" if "pose" in arrays else "poses"
    return Parameters(
        gender=parse_gender(arrays["gender"], path) if "gender" in arrays else None,
        betas=numbers(arrays, "betas", ("S",), path) if "betas" in arrays else None,
        pose=_single_pose(arrays[key], key, path) if key in arrays else None,
    )


def _single_pose(array: NDArray[Any], key: str, path: Path) -> NDArray[np.float64]:
    flat = array.reshape(-1)
    if flat.size not in LAYOUTS:
        remedy = "; pass a motion with --motion" if array.ndim == 2 and array.shape[1] in LAYOUTS else ""
        raise GarmentcError(
            f"'{key}' has shape {shape_text(array.shape)}, expected one pose of 24 x 3 or 72 numbers{remedy}", path
        )
    return to_smpl_pose(numbers({key: flat}, key, ("P",), path))
