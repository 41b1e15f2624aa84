"""Simulated outfits in memory: what the data loss compares with."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from collections.abc import Sequence as Ordered
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.simulation.dataset import Dataset
from garmentc.simulation.sequence import Sequence
from garmentc.simulation.sequence_file import STEP
from garmentc.smpl.body import BodyModel
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.load import load_body
from garmentc.training.metadata import metadata_of
from garmentc.training.outfit_sample import OutfitSample, PosableBody, make_sample


@dataclass(frozen=True)
class SimulatedOutfit:
    """One outfit on one body, in every accepted frame of its sequences.

    sample      the outfit at rest
    category    of garments
    metadata    (metadata_width,) float32
    poses       (T, 24, 3) float32 axis-angle
    transforms  (T, 24, 3, 4) float32: of the joints, without the root's translation
    steps       (T, N, 3) int16: posed vertices without the root's translation, in multiples of STEP; float32 metres
                where 16 bits do not reach
    """

    sample: OutfitSample
    category: str
    metadata: NDArray[np.float32]
    poses: NDArray[np.float32]
    transforms: NDArray[np.float32]
    steps: NDArray[Any]

    def __len__(self) -> int:
        return len(self.poses)

    def targets(self, chosen: NDArray[np.intp], rows: NDArray[np.intp] | None = None) -> NDArray[np.float32]:
        """Posed vertices (B, n, 3) in the poses `chosen` (B,), metres: all of them or those in `rows` (n,)."""
        taken = self.steps[chosen] if rows is None else self.steps[chosen[:, None], rows]
        scale = STEP if taken.dtype == np.int16 else 1.0
        return taken.astype(np.float32) * np.float32(scale)


def read_outfits(
    dataset: Dataset,
    split: str,
    metadata: Ordered[str] = (),
    bodies: Ordered[Path] = (),
    progress: Callable[[str], None] = lambda name: None,
) -> list[SimulatedOutfit]:
    """The outfits of a split, in the manifest's order. Sequences of one outfit at rest on one body are one outfit.

    metadata  kinds of `garmentc.training.metadata.METADATA` to hold
    bodies    model files of the bodies that the dataset was simulated on; none for the default body

    Raises GarmentcError where files are missing or damaged, or their bodies are not given.
    """
    models = [load_body(path) for path in bodies]
    outfits: dict[bytes, SimulatedOutfit] = {}
    for entry in dataset.of_split(split):
        sequence = dataset.sequence(entry)
        if sequence.quality.accepted.any():
            key = _identity(sequence)
            if key in outfits:
                outfits[key] = _with_frames(outfits[key], sequence)
            else:
                outfits[key] = simulated_outfit(sequence, metadata, _body(sequence, models))
        progress(entry.name)
    return list(outfits.values())


def validation_split(outfits: list[SimulatedOutfit], count: int) -> tuple[list[SimulatedOutfit], list[SimulatedOutfit]]:
    """Outfits to learn from, and `count` of them, spread evenly, that are not."""
    chosen = {index * len(outfits) // count for index in range(count)} if count else set()
    kept = [outfit for index, outfit in enumerate(outfits) if index not in chosen]
    return kept, [outfits[index] for index in sorted(chosen)]


def simulated_outfit(sequence: Sequence, metadata: Ordered[str], body: BodyModel) -> SimulatedOutfit:
    """The outfit of one sequence, on the body that it was simulated on."""
    sample = make_sample(sequence.facts.outfit, sequence.template, sequence.faces, PosableBody.of(body, sequence.betas))
    outfit = SimulatedOutfit(
        sample,
        sequence.facts.category,
        metadata_of(metadata, sequence.facts),
        np.zeros((0, 24, 3), np.float32),
        np.zeros((0, 24, 3, 4), np.float32),
        np.zeros((0, *sequence.template.shape), np.int16),
    )
    return _with_frames(outfit, sequence)


def _with_frames(outfit: SimulatedOutfit, sequence: Sequence) -> SimulatedOutfit:
    good = sequence.quality.accepted
    moved = compact(sequence.vertices[good] - sequence.trans[good, None])
    ours = outfit.steps
    if moved.dtype != ours.dtype:
        ours, moved = (part if part.dtype == np.float32 else part * np.float32(STEP) for part in (ours, moved))
    poses = sequence.poses[good].astype(np.float32)
    transforms = outfit.sample.body.transforms(poses)[:, :, :3]
    return replace(
        outfit,
        poses=np.concatenate([outfit.poses, poses]),
        transforms=np.concatenate([outfit.transforms, transforms]),
        steps=np.concatenate([ours, moved]),
    )


def _identity(sequence: Sequence) -> bytes:
    facts = sequence.facts
    text = "\n".join((facts.outfit, facts.body, facts.gender, facts.fabric))
    arrays = (sequence.template, sequence.faces, sequence.betas)
    return hashlib.sha256(text.encode() + b"".join(array.tobytes() for array in arrays)).digest()


def _body(sequence: Sequence, models: Iterable[BodyModel]) -> BodyModel:
    facts = sequence.facts
    default = load_default_body(facts.gender) if facts.gender else load_default_body()
    for model in (default, *models):
        if facts.body == model.name and facts.gender in (model.gender, ""):
            return model
    raise GarmentcError(f"the sequence '{facts.name}' is of the body '{facts.body}'; give its model file with --body")


def compact(vertices: NDArray[Any]) -> NDArray[Any]:
    """Posed vertices (T, N, 3) without translation, metres, as `SimulatedOutfit.steps`.

    int16 multiples of STEP where they reach; a sequence's file has no more digits than that.
    """
    if np.abs(vertices).max(initial=0.0) >= STEP * np.iinfo(np.int16).max:
        return vertices.astype(np.float32)
    return np.rint(vertices / STEP).astype(np.int16)
