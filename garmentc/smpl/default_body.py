"""The body that comes with garmentc: CC0 data, SMPL's joints and interface, not SMPL's shape space.

`default_body.npz` is written by `garmentc.smpl.build_body`; default_body.LICENSE.md says what it was made from.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.smpl.body import BodyModel
from garmentc.smpl.correctives import PoseCorrectives
from garmentc.smpl.gender import GENDERS
from garmentc.smpl.skeleton import JOINT_COUNT

DEFAULT_BODY_PATH = Path(__file__).with_name("default_body.npz")


@lru_cache(maxsize=len(GENDERS))
def load_default_body(gender: str = "neutral") -> BodyModel:
    """The default body of a gender, float64: 7,002 vertices, 10 shape coefficients in standard deviations.

    The body is shared between callers, so its arrays are read-only; `astype` makes a copy.
    Raises GarmentcError where there is no such gender.
    """
    if gender not in GENDERS:
        raise GarmentcError(f"unknown gender '{gender}'; the default body is {', '.join(GENDERS)}")
    with np.load(DEFAULT_BODY_PATH, allow_pickle=False) as file:
        v_template = file[f"{gender}_v_template"].astype(np.float64)
        body = BodyModel(
            name=f"default {gender}",
            gender=gender,
            v_template=v_template,
            faces=file["faces"].astype(np.int32),
            weights=_dense_weights(file["weights_idx"], file["weights_val"].astype(np.float64)),
            shapedirs=file[f"{gender}_shapedirs"].astype(np.float64),
            J_template=file[f"{gender}_J"].astype(np.float64),
            J_shapedirs=file[f"{gender}_J_shapedirs"].astype(np.float64),
            correctives=_correctives(file["posedirs_v"], file["posedirs_j"], file["posedirs_d"].astype(np.float64)),
        )
    for value in (*vars(body).values(), *body.correctives.vertices, *body.correctives.directions):
        if isinstance(value, np.ndarray):
            value.setflags(write=False)
    return body


def _dense_weights(joints: NDArray[np.uint8], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """(V, 24) from the four largest weights of each vertex (V, 4), which sum to 1 in float64 too."""
    weights = np.zeros((len(joints), JOINT_COUNT))
    np.put_along_axis(weights, joints.astype(np.intp), values / values.sum(axis=1, keepdims=True), axis=1)
    return weights


def _correctives(vertex: NDArray[np.uint16], joint: NDArray[np.uint8], delta: NDArray[Any]) -> PoseCorrectives:
    """From blocks: `delta[k]` (3, 9) moves vertex `vertex[k]` by the rotation of joint `joint[k]` + 1."""
    of_joint = [np.flatnonzero(joint == j) for j in range(JOINT_COUNT - 1)]
    return PoseCorrectives(
        tuple(vertex[k].astype(np.intp) for k in of_joint),
        tuple(np.ascontiguousarray(delta[k].transpose(2, 0, 1)) for k in of_joint),
    )
