"""One outfit of a dataset measured: every method in the same frames, against the simulated vertices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.evaluation.clean_frames import CleanFrames, touching_share
from garmentc.evaluation.evaluate import DEEP
from garmentc.evaluation.method import SIMULATION, Method, PosedTemplate
from garmentc.evaluation.metrics import MILLIMETRES, bend, depth_inside, edge_mm
from garmentc.outfit.topology import edge_lengths, edges
from garmentc.simulation.sequence import Sample, SequenceFacts
from garmentc.simulation.sequence import Sequence as OutfitSequence
from garmentc.smpl.body import BodyModel
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.load import load_body


@dataclass(frozen=True)
class MethodScores:
    """One method in T frames of an outfit of G garments.

    error_mm          (T,) mean distance to the simulated vertices
    garment_error_mm  (T, G) the same over the vertices of each garment
    edge_mm           (T,) mean |length - length in the template|
    bend              (T,) mean 1 - cos between neighbouring vertex normals
    collision         (T,) share of vertices inside the body
    deep              (T,) share of vertices deeper inside than DEEP
    """

    error_mm: NDArray[np.float64]
    garment_error_mm: NDArray[np.float64]
    edge_mm: NDArray[np.float64]
    bend: NDArray[np.float64]
    collision: NDArray[np.float64]
    deep: NDArray[np.float64]


@dataclass(frozen=True)
class OutfitScores:
    """One outfit in T frames.

    frames    (sequence, frame) of each
    garments  kinds of its G garments, innermost first
    clean     (T,) the body leaves room for cloth
    scores    by method; the simulation itself is one
    """

    outfit: str
    category: str
    fabric: str
    gender: str
    garments: tuple[str, ...]
    frames: tuple[tuple[str, int], ...]
    clean: NDArray[np.bool_]
    scores: Mapping[str, MethodScores]


def score_outfit(
    sequences: Sequence[OutfitSequence],
    methods: Sequence[Method],
    frames: int | None = None,
    bodies: Sequence[Path] = (),
) -> OutfitScores:
    """Measure all `methods` on sequences of one outfit.

    frames  of each sequence, spread evenly over the accepted ones; None takes all of these
    bodies  model files of the bodies that are not default ones
    Raises GarmentcError where a body is missing or the outfit cannot be compiled.
    """
    tracks: list[OutfitScores] = []
    fitting: _Fitting | None = None
    for sequence in map(trimmed, sequences):
        if fitting is None or not fitting.fits(
            sequence
        ):  # an outfit's sequences mostly share one, and compiling takes long
            fitting = _Fitting.of(sequence, methods, bodies)
        tracks.append(_score_sequence(sequence, fitting, frames))
    facts = sequences[0].facts
    return OutfitScores(
        facts.outfit,
        facts.category,
        facts.fabric,
        facts.gender,
        facts.parts,
        tuple(frame for track in tracks for frame in track.frames),
        np.concatenate([track.clean for track in tracks]),
        {name: _joined([track.scores[name] for track in tracks]) for name in tracks[0].scores},
    )


def _joined(parts: Sequence[MethodScores]) -> MethodScores:
    return MethodScores(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in MethodScores.__annotations__}
    )


def sample_frames(sequence: OutfitSequence, count: int | None) -> tuple[Sample, ...]:
    """`count` of the accepted frames, spread evenly, or all of them."""
    accepted = np.flatnonzero(sequence.quality.accepted)
    if count is not None and count < len(accepted):
        accepted = accepted[np.linspace(0, len(accepted) - 1, count + 2).round().astype(int)[1:-1]]
    return tuple(Sample(sequence, int(frame)) for frame in np.unique(accepted))


def simulated(sample: Sample) -> NDArray[np.float64]:
    """The simulated vertices (N, 3) of a frame with the pelvis where it is at rest, as methods give theirs."""
    return sample.vertices.astype(np.float64) - sample.trans


def trimmed(sequence: OutfitSequence) -> OutfitSequence:
    """The sequence without the vertices that no face uses: no file would hold them."""
    used, faces = np.unique(sequence.faces, return_inverse=True)
    if len(used) == len(sequence.template):
        return sequence
    return replace(
        sequence,
        template=sequence.template[used],
        faces=np.asarray(faces.reshape(-1, 3), np.int32),
        vertices=sequence.vertices[:, used],
    )


def body_of(facts: SequenceFacts, bodies: Sequence[Path]) -> tuple[BodyModel, Path | None]:
    """The body that a sequence was made on, and its file, where it is none of the default ones."""
    body = load_default_body(facts.gender)
    if body.name == facts.body:
        return body, None
    for path in bodies:
        body = load_body(path)
        if body.name == facts.body:
            return body, path
    raise GarmentcError(f"{facts.name} was made on the body '{facts.body}'; give its model file with --body")


@dataclass(frozen=True)
class _Fitting:
    """An outfit on its body, and what every frame of it is measured with.

    moved     by the name of each method
    pairs     (E, 2) edges, with their lengths (E,) in the template
    garments  vertices of each garment
    animated  whether what is moved are animations of this sequence
    """

    sequence: OutfitSequence
    body: BodyModel
    moved: Mapping[str, PosedTemplate]
    pairs: NDArray[np.int32]
    lengths: NDArray[np.float64]
    garments: tuple[NDArray[np.int32], ...]
    animated: bool

    @staticmethod
    def of(sequence: OutfitSequence, methods: Sequence[Method], bodies: Sequence[Path]) -> _Fitting:
        body, body_file = body_of(sequence.facts, bodies)
        moved = {method.name: method.posed_template(sequence, body, body_file) for method in methods}
        pairs = edges(sequence.faces)
        parts = (sequence.faces[sequence.triangle_part == part] for part in range(len(sequence.facts.parts)))
        garments = tuple(np.unique(part) for part in parts)
        animated = any(method.animated for method in methods)
        return _Fitting(sequence, body, moved, pairs, edge_lengths(sequence.template, pairs), garments, animated)

    def fits(self, other: OutfitSequence) -> bool:
        """Whether `other` is the same outfit on the same body, and the same serves to measure it."""
        if self.animated:
            return False
        same = (self.sequence.facts.body, self.sequence.facts.gender) == (other.facts.body, other.facts.gender)
        names = ("template", "faces", "triangle_part", "betas")
        return same and all(np.array_equal(getattr(self.sequence, name), getattr(other, name)) for name in names)


def _score_sequence(sequence: OutfitSequence, fitting: _Fitting, count: int | None) -> OutfitScores:
    facts, samples, body = sequence.facts, sample_frames(sequence, count), fitting.body
    skin = body.posed(np.array([sample.pose for sample in samples]), sequence.betas)
    frames = [_score_frame(sample, vertices, fitting) for sample, vertices in zip(samples, skin, strict=True)]
    scores = {
        name: MethodScores(*map(np.array, zip(*(frame[name] for frame in frames), strict=True)))
        for name in (SIMULATION, *fitting.moved)
    }
    clean = touching_share(body, sequence.betas, skin) <= CleanFrames.allowed
    numbers = tuple((facts.name, sample.frame) for sample in samples)
    return OutfitScores(facts.outfit, facts.category, facts.fabric, facts.gender, facts.parts, numbers, clean, scores)


def _score_frame(sample: Sample, skin: NDArray[Any], fitting: _Fitting) -> dict[str, tuple[Any, ...]]:
    """By method the metrics of one frame, in the order of MethodScores."""
    target = simulated(sample)
    cloths = {SIMULATION: target, **{name: posed(sample) for name, posed in fitting.moved.items()}}
    # All methods in one query: the tree over the body is made once.
    depths = np.split(depth_inside(np.concatenate(list(cloths.values())), skin, fitting.body.faces), len(cloths))
    rows = {}
    for (name, cloth), depth in zip(cloths.items(), depths, strict=True):
        error = MILLIMETRES * np.linalg.norm(cloth - target, axis=1)
        rows[name] = (
            error.mean(),
            [error[garment].mean() for garment in fitting.garments],
            edge_mm(cloth, fitting.lengths, fitting.pairs),
            bend(cloth, sample.sequence.faces, fitting.pairs),
            (depth > 0).mean(),
            (depth > DEEP).mean(),
        )
    return rows
