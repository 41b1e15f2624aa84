"""Motion files of every kind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.smpl.motion import Motion

UP_AXES = ("y", "z")


def read_motion(path: Path, up: str | None = None, joints: NDArray[Any] | None = None) -> Motion:
    """The motion in an .npz (AMASS's layout) or .bvh file, Y up, for the body with rest joints (24, 3).

    up      the file's vertical axis, "y" or "z"; None detects it, and `Motion.source` says what was found
    joints  rest joints of the body that will move; None is the default neutral body

    Raises GarmentcError where the file cannot be read as a motion.
    """
    from garmentc.smpl.amass import read_amass
    from garmentc.smpl.default_body import load_default_body
    from garmentc.smpl.retarget import read_bvh_motion

    if up is not None and up not in UP_AXES:
        raise GarmentcError(f"unknown up axis '{up}'; use y or z")
    rest = load_default_body("neutral").joints() if joints is None else joints
    suffix = path.suffix.lower()
    if suffix == ".npz":
        return read_amass(path, up, rest[0])
    if suffix == ".bvh":
        return read_bvh_motion(path, rest, up)
    raise GarmentcError(f"unknown kind of motion '{path.suffix}'; use .npz (AMASS layout) or .bvh", path)
