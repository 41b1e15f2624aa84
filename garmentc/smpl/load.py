"""One place to get a body: the default one, or the user's own model file."""

from __future__ import annotations

from pathlib import Path

from garmentc.smpl.body import BodyModel
from garmentc.smpl.default_body import load_default_body


def load_body(path: Path | None = None, gender: str | None = None) -> BodyModel:
    """The body model in `path` (SMPL, SMPL-H or SMPL-X, .npz or .pkl), or the default body where it is None.

    `gender` is "female", "male" or "neutral". For the default body None means neutral; for a model file it means
    what the file says.
    Raises GarmentcError where the file is no body model.
    """
    if path is None:
        return load_default_body(gender or "neutral")
    from garmentc.smpl.user_body import read_user_body

    return read_user_body(path, gender)
