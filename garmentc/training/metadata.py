"""What a network may be told about an outfit beside its mesh (Bertiche et al. 2021, Table 2): fabric and fit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.simulation.presets import FABRICS
from garmentc.simulation.sequence import SequenceFacts

METADATA = {"fabric": len(FABRICS), "tightness": 2}
"""Numbers of each kind: one-hot in the order of FABRICS; CLOTH3D's two numbers. All zero stands for unknown."""


def metadata_width(kinds: Iterable[str]) -> int:
    """Numbers in all."""
    return sum(METADATA[kind] for kind in kinds)


def metadata_names(kinds: Iterable[str]) -> list[str]:
    """What each of the numbers says, as a bundle's manifest has it."""
    values = {"fabric": FABRICS, "tightness": ("0", "1")}
    return [f"{kind}:{value}" for kind in kinds for value in values[kind]]


def encode_metadata(kinds: Sequence[str], fabric: str, tightness: Sequence[float]) -> NDArray[np.float32]:
    """The numbers of an outfit; zeros for a fabric that is unknown and for a missing tightness."""
    values: list[float] = []
    for kind in kinds:
        if kind == "fabric":
            values += [float(fabric == name) for name in FABRICS]
        else:
            values += list(tightness) if tightness else [0.0, 0.0]
    return np.array(values, np.float32)


def metadata_of(kinds: Sequence[str], facts: SequenceFacts) -> NDArray[np.float32]:
    """The numbers of a sequence's outfit. Raises GarmentcError where its dataset does not say."""
    missing = [kind for kind, known in (("fabric", facts.fabric), ("tightness", facts.tightness)) if not known]
    for kind in missing:
        if kind in kinds:
            raise GarmentcError(f"the sequence '{facts.name}' has no {kind}; leave '{kind}' out of the metadata")
    return encode_metadata(kinds, facts.fabric, facts.tightness)
