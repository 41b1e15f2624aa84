"""Is a dataset what its manifest says, and how good is it?"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.simulation.dataset import REJECTED, SEQUENCES, Dataset, Entry, dataset_hash
from garmentc.simulation.sequence import Sequence
from garmentc.simulation.splits import leaks


@dataclass(frozen=True)
class GroupStatistics:
    """Figures of some sequences, over their accepted frames unless said otherwise.

    sequences, outfits, motions, frames, accepted   counts
    penetration     share of all vertices deeper than 1 mm in the body
    crossings       cloth edges through cloth, mean of frames
    strain          length over rest length: 1st, 50th and 99th percentile and maximum of the edges, mean of frames
                    (the maximum: of all frames)
    bytes_per_frame of all frames stored
    """

    name: str
    sequences: int
    outfits: int
    motions: int
    frames: int
    accepted: int
    penetration: float
    crossings: float
    strain: tuple[float, float, float, float]
    bytes_per_frame: float

    @property
    def accepted_share(self) -> float:
        return self.accepted / max(self.frames, 1)


@dataclass(frozen=True)
class DatasetReport:
    """What `check_dataset` found. `problems` is empty where the dataset is sound."""

    name: str
    sha256: str
    complete: bool
    problems: tuple[str, ...]
    total: GroupStatistics
    groups: tuple[GroupStatistics, ...]
    rejected_sequences: int
    rejected_frames: dict[str, int]


@dataclass(frozen=True)
class _Measured:
    """The figures of one sequence that statistics are made of."""

    entry: Entry
    penetration: NDArray[Any]
    crossings: NDArray[Any]
    strain: NDArray[Any]
    rejections: dict[str, int]


def check_dataset(dataset: Dataset, progress: Callable[[str], None] = lambda name: None) -> DatasetReport:
    """Read every file: hashes, shapes, splits; and sum up the statistics, in total, by split and by category."""
    problems: list[str] = [] if dataset.complete else ["the dataset is unfinished; run the same command again"]
    measured = []
    for entry in dataset.entries:
        progress(entry.name)
        try:
            data = (dataset.folder / entry.file).read_bytes()
            sequence = dataset.sequence(entry)
        except OSError as error:
            problems.append(f"{entry.file}: cannot be read: {error.strerror or error}")
            continue
        except GarmentcError as error:
            problems.append(f"{entry.file}: {error.message}")
            continue
        if hashlib.sha256(data).hexdigest() != entry.sha256:
            problems.append(f"{entry.file}: is not the file that the manifest describes; its hash differs")
        problems += [f"{entry.file}: {said}" for said in _differences(entry, sequence, len(data))]
        kept = sequence.quality.accepted
        quality = sequence.quality
        arrays = (quality.penetration[kept], quality.crossings[kept], quality.strain[kept])
        measured.append(_Measured(entry, *arrays, quality.rejections()))
    problems += leaks((entry.outfit, entry.motion, entry.split) for entry in dataset.entries)
    problems += _strays(dataset)
    if dataset_hash((entry.name, entry.sha256) for entry in dataset.entries) != dataset.sha256:
        problems.append("the manifest's hash is not that of its sequences")
    reasons: Counter[str] = Counter()
    for one in measured:
        reasons.update(one.rejections)
    return DatasetReport(
        name=dataset.name,
        sha256=dataset.sha256,
        complete=dataset.complete,
        problems=tuple(problems),
        total=_statistics("all", measured),
        groups=(*_grouped(measured, "split"), *_grouped(measured, "category")),
        rejected_sequences=len(list((dataset.folder / REJECTED).glob("*.json"))),
        rejected_frames=dict(sorted(reasons.items(), key=lambda item: (-item[1], item[0]))),
    )


def _differences(entry: Entry, sequence: Sequence, size: int) -> list[str]:
    facts = sequence.facts
    found = {
        "name": facts.name,
        "outfit": facts.outfit,
        "motion": facts.motion,
        "category": facts.category,
        "fabric": facts.fabric,
        "gender": facts.gender,
        "bytes": size,
        "vertices": len(sequence.template),
        "faces": len(sequence.faces),
        "frames": len(sequence),
        "accepted": int(sequence.quality.accepted.sum()),
    }
    pairs = ((key, value, getattr(entry, key)) for key, value in found.items())
    return [f"its {key} is {value!r}, the manifest says {said!r}" for key, value, said in pairs if value != said]


def _strays(dataset: Dataset) -> list[str]:
    """Sequence files that the manifest doesn't know."""
    known = {entry.file for entry in dataset.entries}
    present = sorted(path.relative_to(dataset.folder).as_posix() for path in (dataset.folder / SEQUENCES).glob("*.npz"))
    return [f"{file}: the manifest does not list it" for file in present if file not in known and dataset.complete]


def _grouped(measured: list[_Measured], key: str) -> list[GroupStatistics]:
    names = sorted({getattr(one.entry, key) for one in measured})
    return [_statistics(name, [one for one in measured if getattr(one.entry, key) == name]) for name in names]


def _statistics(name: str, measured: list[_Measured]) -> GroupStatistics:
    entries = [one.entry for one in measured]
    accepted = sum(entry.accepted for entry in entries)
    vertices = sum(entry.accepted * entry.vertices for entry in entries)
    inside = sum(float(one.penetration.sum()) * one.entry.vertices for one in measured)
    strain = np.concatenate([one.strain for one in measured]) if accepted else np.ones((1, 4))
    low, middle, high = (float(value) for value in strain[:, :3].mean(axis=0))
    return GroupStatistics(
        name=name,
        sequences=len(entries),
        outfits=len({entry.outfit for entry in entries}),
        motions=len({entry.motion for entry in entries}),
        frames=sum(entry.frames for entry in entries),
        accepted=accepted,
        penetration=inside / max(vertices, 1),
        crossings=sum(int(one.crossings.sum()) for one in measured) / max(accepted, 1),
        strain=(low, middle, high, float(strain[:, 3].max())),
        bytes_per_frame=sum(entry.bytes for entry in entries) / max(sum(entry.frames for entry in entries), 1),
    )
