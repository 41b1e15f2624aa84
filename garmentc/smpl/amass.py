"""Motions in AMASS's layout: one .npz with poses, trans and a frame rate (Mahmood et al. 2019)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import Diagnostic, GarmentcError
from garmentc.smpl.arrays import numbers, read_npz, shape_text
from garmentc.smpl.gender import parse_gender
from garmentc.smpl.motion import Motion
from garmentc.smpl.pose_layout import LAYOUTS, dropped_joints, to_smpl_pose
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.up_axis import detect_up, turn_to_y_up

RATE_KEYS = ("mocap_framerate", "mocap_frame_rate", "fps")
"""SMPL-H files of AMASS use the first name, its SMPL-X files the second, other tools the third."""


def read_amass(path: Path, up: str | None = None, rest_pelvis: NDArray[Any] | None = None) -> Motion:
    """A motion from an .npz in AMASS's layout.

    poses         (T, 72 | 156 | 165) or (T, 66), axis-angle; fingers, jaw and eyes are left out
    trans         (T, 3); betas, gender and up_axis ("y" or "z") may be missing
    up            "y" or "z": the file's vertical axis; None takes the file's word or looks at the poses
    rest_pelvis   (3,) pelvis at rest of the body that will move; the default body's is the origin

    A Z-up motion, as AMASS's own are, is turned to Y up. The pelvis path is exact where the body's rest pelvis is
    that of the recorded body; otherwise the whole motion stands off by the difference.
    Raises GarmentcError where an array is missing or has a wrong shape.
    """
    arrays = read_npz(path, ("poses", "trans", "betas", "gender", "up_axis", *RATE_KEYS))
    warnings: list[Diagnostic] = []
    flat = numbers(arrays, "poses", ("T", "72 or 156 or 165"), path)
    if flat.shape[1] not in LAYOUTS or not len(flat):
        raise GarmentcError(
            f"'poses' has shape {shape_text(flat.shape)}, expected T x 72 (SMPL), 156 (SMPL-H) or 165 (SMPL-X)", path
        )
    if dropped_joints(flat):
        warnings.append(Diagnostic("fingers-dropped", "finger and face rotations are left out", str(path)))
    if "trans" not in arrays:
        warnings.append(
            Diagnostic("no-translation", "the array 'trans' is missing; the body stays in place", str(path))
        )
        arrays["trans"] = np.zeros((len(flat), 3))
    poses, trans = to_smpl_pose(flat), numbers(arrays, "trans", (len(flat), 3), path)

    axis, reason = _up_axis(arrays, up, poses[:, 0], path, warnings)
    if axis == "z":
        poses, trans = turn_to_y_up(poses, trans, np.zeros(3) if rest_pelvis is None else np.asarray(rest_pelvis))
    betas = numbers(arrays, "betas", ("S",), path) if "betas" in arrays and arrays["betas"].ndim == 1 else None
    return Motion(
        name=path.stem,
        poses=poses,
        trans=trans,
        fps=_frame_rate(arrays, path),
        betas=betas,
        gender=parse_gender(arrays["gender"], path) if "gender" in arrays else None,
        source=f"AMASS layout, {LAYOUTS[flat.shape[1]]}, {axis.upper()} up ({reason})",
        warnings=tuple(warnings),
    )


def _frame_rate(arrays: dict[str, NDArray[Any]], path: Path) -> float:
    key = next((key for key in RATE_KEYS if key in arrays), None)
    if key is None:
        raise GarmentcError(f"has no frame rate; add a number named '{RATE_KEYS[0]}'", path)
    fps = float(numbers({key: arrays[key].reshape(-1)}, key, (1,), path)[0])
    if fps <= 0:
        raise GarmentcError(f"'{key}' is {fps:g}; a frame rate is positive", path)
    return fps


def _up_axis(
    arrays: dict[str, NDArray[Any]], up: str | None, root: NDArray[Any], path: Path, warnings: list[Diagnostic]
) -> tuple[str, str]:
    """The axis and why; a guess that is not sure is a warning."""
    if up is not None:
        return up, "as asked"
    if "up_axis" in arrays:
        stated = str(arrays["up_axis"].reshape(-1)[0]).strip().lower() if arrays["up_axis"].size == 1 else ""
        if stated not in ("y", "z"):
            raise GarmentcError(f"'up_axis' is '{stated[:20]}', expected y or z", path)
        return stated, "stated in the file"
    found = detect_up(axis_angle_to_matrix(root))
    reason = f"the body's up direction is {found.y:.2f} along Y and {found.z:.2f} along Z on average"
    if not found.sure:
        warnings.append(
            Diagnostic(
                "motion-up-unsure",
                f"{found.axis.upper()} is taken as up, but that is not sure: {reason}; say which with --motion-up",
                str(path),
            )
        )
    return found.axis, f"detected: {reason}"


def write_amass(motion: Motion, path: Path) -> None:
    """Write a motion in AMASS's layout: poses (T, 72), Y up (stated as `up_axis`). Same motion, same bytes."""
    with path.open("wb") as file:
        np.savez_compressed(
            file,
            poses=motion.poses.reshape(len(motion), -1),
            trans=motion.trans,
            betas=np.zeros(10) if motion.betas is None else motion.betas,
            gender=np.array(motion.gender or "neutral"),
            mocap_framerate=np.array(motion.fps),
            up_axis=np.array("y"),
        )
