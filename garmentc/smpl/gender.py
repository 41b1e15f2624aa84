"""The genders of body models, as files spell them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from garmentc.errors import GarmentcError

GENDERS = ("female", "male", "neutral")

_SPELLINGS = {"f": "female", "m": "male", "n": "neutral"} | {gender: gender for gender in GENDERS}


def parse_gender(value: Any, file: Path | None = None) -> str:
    """ "female", "male" or "neutral" from a string, bytes or a numpy array of one.

    Raises GarmentcError for anything else.
    """
    if isinstance(value, np.ndarray):
        value = value.reshape(-1)[0] if value.size == 1 and not value.dtype.hasobject else repr(value)
    text = value.decode("latin-1") if isinstance(value, bytes) else str(value)
    gender = _SPELLINGS.get(text.strip("\0 ").lower())
    if gender is None:
        raise GarmentcError(f"unknown gender '{text[:40]}'; use female, male or neutral", file)
    return gender
