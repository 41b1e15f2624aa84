"""A dataset: a folder of sequences with a manifest. docs/dataset.md describes the format.

    dataset = open_dataset(folder)
    for sample in dataset.samples("train"): ...

Every file appears whole or not at all, so a folder is sound whenever the work on it is stopped. What has been done
is read off the sequence files themselves; `write_manifest` sums them up.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from garmentc.errors import GarmentcError
from garmentc.output import cannot_write, written_whole
from garmentc.schema import check_schema
from garmentc.simulation.sequence import Sample, Sequence
from garmentc.simulation.sequence_file import STEP, read_sequence, sequence_bytes
from garmentc.simulation.splits import SPLITS

MANIFEST = "manifest.json"
SEQUENCES = "sequences"
REJECTED = "rejected"
REJECTED_LIST = "rejected.jsonl"


@dataclass(frozen=True)
class Entry:
    """What the manifest says about one sequence. `file` is relative to the folder; `faces` counts triangles."""

    name: str
    file: str
    sha256: str
    bytes: int
    split: str
    outfit: str
    motion: str
    category: str
    fabric: str
    gender: str
    vertices: int
    faces: int
    frames: int
    accepted: int


@dataclass(frozen=True)
class Dataset:
    """A dataset folder whose manifest has been read; sequences are read when asked for.

    complete  nothing of what was planned is missing
    plan      how it was made, as JSON values; empty for imported data
    sha256    of all sequences together, whatever their order
    """

    folder: Path
    name: str
    complete: bool
    plan: dict[str, Any]
    entries: tuple[Entry, ...]
    sha256: str

    def of_split(self, split: str) -> tuple[Entry, ...]:
        """The sequences of a split. Raises GarmentcError where there is no such split."""
        if split not in SPLITS:
            raise GarmentcError(f"unknown split '{split}'; the splits are {', '.join(SPLITS)}")
        return tuple(entry for entry in self.entries if entry.split == split)

    def sequence(self, entry: Entry) -> Sequence:
        """Raises GarmentcError where the file is missing or damaged."""
        return read_sequence(self.folder / entry.file)

    def sequences(self, split: str) -> Iterator[Sequence]:
        """The split's sequences in the manifest's order, one in memory at a time."""
        for entry in self.of_split(split):
            yield self.sequence(entry)

    def samples(self, split: str, shuffle_seed: int | None = None) -> Iterator[Sample]:
        """Every accepted frame of a split exactly once: the same frames for training and for evaluation.

        shuffle_seed  None: in order. Otherwise sequences are shuffled, and the frames within each, by this seed.
        """
        entries = self.of_split(split)
        if shuffle_seed is None:
            for entry in entries:
                yield from self.sequence(entry).samples()
            return
        rng = np.random.default_rng(shuffle_seed)
        for index in rng.permutation(len(entries)):
            samples = list(self.sequence(entries[index]).samples())
            for at in rng.permutation(len(samples)):
                yield samples[at]


def open_dataset(folder: Path) -> Dataset:
    """The dataset in `folder`. Raises GarmentcError where there is none."""
    path = folder / MANIFEST
    try:
        document = json.loads(path.read_bytes())
    except FileNotFoundError:
        raise GarmentcError(f"is no dataset: it has no {MANIFEST}", folder) from None
    except OSError as error:
        raise GarmentcError(f"cannot be read: {error.strerror or error}", path) from None
    except ValueError as error:
        raise GarmentcError(f"is no JSON ({error})", path) from None
    check_schema(document, "dataset", path)
    entries = tuple(Entry(**entry) for entry in document["sequences"])
    return Dataset(folder, document["name"], document["complete"], document["plan"], entries, document["sha256"])


def dataset_hash(files: Iterable[tuple[str, str]]) -> str:
    """SHA-256 over (name, SHA-256) of all files, whatever their order."""
    lines = sorted(f"{sha256}  {name}\n" for name, sha256 in files)
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def sequence_path(folder: Path, name: str) -> Path:
    """Where the sequence `name` lies."""
    return folder / SEQUENCES / f"{name}.npz"


def append_sequence(folder: Path, sequence: Sequence) -> None:
    """Write the sequence's file, whole or not at all; one of the same name is replaced.

    Raises GarmentcError where it cannot be written, ValueError where it holds NaN or infinity.
    """
    write_file(sequence_path(folder, sequence.facts.name), sequence_bytes(sequence))


def make_folders(folder: Path) -> None:
    """The folder and those in it, made where missing. Raises GarmentcError where they cannot be."""
    for path in (folder, folder / SEQUENCES, folder / REJECTED):
        try:
            path.mkdir(parents=True, exist_ok=True)
        except FileExistsError:
            raise GarmentcError("is a file, and a dataset is a folder; name another place", path) from None
        except OSError as error:
            raise cannot_write(path, error) from error


def write_file(path: Path, data: bytes) -> None:
    """Write `path` whole or not at all. Raises GarmentcError where it cannot be written.

    The bytes are on the disk before the file gets its name: after a power cut, a file that is there is whole.
    """
    with written_whole(path) as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def make_entry(folder: Path, name: str, split: str) -> Entry:
    """What the manifest says about the sequence `name`, read off its file. Raises GarmentcError as `read_sequence`."""
    path = sequence_path(folder, name)
    sequence = read_sequence(path)
    facts, data = sequence.facts, path.read_bytes()
    return Entry(
        name=facts.name,
        file=path.relative_to(folder).as_posix(),
        sha256=hashlib.sha256(data).hexdigest(),
        bytes=len(data),
        split=split,
        outfit=facts.outfit,
        motion=facts.motion,
        category=facts.category,
        fabric=facts.fabric,
        gender=facts.gender,
        vertices=len(sequence.template),
        faces=len(sequence.faces),
        frames=len(sequence),
        accepted=int(sequence.quality.accepted.sum()),
    )


def write_manifest(
    folder: Path, name: str, entries: Iterable[Entry], complete: bool = True, plan: dict[str, Any] | None = None
) -> Dataset:
    """Write the manifest, whole or not at all, and return the dataset that it describes."""
    ordered = tuple(entries)
    document = {
        "schema": 1,
        "name": name,
        "complete": complete,
        "units": "metre",
        "up": "y",
        "position_error_mm": 1000 * STEP / 2,
        "plan": plan or {},
        "sequences": [asdict(entry) for entry in ordered],
        "sha256": dataset_hash((entry.name, entry.sha256) for entry in ordered),
    }
    check_schema(document, "dataset", folder / MANIFEST)
    write_file(folder / MANIFEST, (json.dumps(document, indent=1, allow_nan=False) + "\n").encode())
    return Dataset(folder, name, complete, document["plan"], ordered, document["sha256"])  # type: ignore[arg-type]
