"""Datasets of others as datasets of garmentc's."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path

from garmentc.errors import GarmentcError
from garmentc.simulation.dataset import (
    REJECTED_LIST,
    Dataset,
    make_entry,
    make_folders,
    sequence_path,
    write_file,
    write_manifest,
)
from garmentc.simulation.importers.cloth3d import cloth3d_samples, read_cloth3d_sample
from garmentc.simulation.importers.tailornet import read_tailornet_sequence, tailornet_sequences
from garmentc.simulation.sequence import Sequence as OutfitSequence
from garmentc.simulation.sequence_file import read_facts, sequence_bytes
from garmentc.simulation.splits import split_pairs
from garmentc.smpl.load import load_body

Reader = tuple[str, Callable[[], OutfitSequence]]


def import_dataset(
    layout: str,
    source: Path,
    out: Path,
    body_files: Sequence[Path] = (),
    seed: int = 0,
    progress: Callable[[str], None] = lambda name: None,
) -> Dataset:
    """Make a dataset in `out` of the data in `source`, which has the layout "cloth3d" or "tailornet".

    body_files  SMPL's model files, for CLOTH3D; TailorNet's data brings its own
    seed        of the split: a fifth of the outfits and of the motions is held out

    Sequences that are in `out` already are kept, so an import that was stopped goes on. Those that cannot be read are
    listed in rejected.jsonl with the reason.
    Raises GarmentcError where there is nothing to import, or nothing of it can be read.
    """
    if layout == "cloth3d":
        readers: Iterable[Reader] = _cloth3d(source, body_files)
    elif layout == "tailornet":
        readers = [(one.name, partial(read_tailornet_sequence, one)) for one in tailornet_sequences(source)]
    else:
        raise GarmentcError(f"unknown layout '{layout}'; the layouts are cloth3d, tailornet")
    make_folders(out)
    names, notes = [], []
    for name, read in readers:
        progress(name)
        path = sequence_path(out, name)
        if not path.exists():
            try:
                data = sequence_bytes(read())
            except (GarmentcError, ValueError) as error:
                notes.append({"sequence": name, "reason": "unreadable", "detail": str(error)})
                continue
            write_file(path, data)
        names.append(name)
    if not names:
        raise GarmentcError(f"nothing in it can be read; the first reason: {notes[0]['detail']}", source)
    pairs = {name: (facts.outfit, facts.motion) for name in names for facts in [read_facts(sequence_path(out, name))]}
    splits = split_pairs(pairs.values(), seed)
    write_file(out / REJECTED_LIST, "".join(json.dumps(note) + "\n" for note in notes).encode())
    return write_manifest(out, layout, (make_entry(out, name, splits[pairs[name]]) for name in names))


def _cloth3d(source: Path, body_files: Sequence[Path]) -> list[Reader]:
    if not body_files:
        raise GarmentcError("CLOTH3D's shapes are SMPL's; give its models: --body female.pkl --body male.pkl")
    bodies = {body.gender: body for body in map(load_body, body_files)}
    return [(folder.name, partial(read_cloth3d_sample, folder, bodies)) for folder in cloth3d_samples(source)]
