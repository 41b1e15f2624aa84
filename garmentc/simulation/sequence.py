"""An outfit in motion: what one file of a dataset holds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class SequenceFacts:
    """What a sequence is, in words and numbers: everything that is no array.

    name        unique in its dataset, a plain file name
    outfit      the outfit; sequences of one outfit share it
    motion      the motion; sequences that move alike share it
    category    as of `outfit_parameters.CATEGORIES`, or what an imported dataset calls it
    fabric      cotton, silk, denim, leather, or ""
    body        name of the body model
    gender      female, male or neutral
    fps         frames a second
    seed        everything random came from it
    parts       names of the garments, innermost first
    tightness   as CLOTH3D's two numbers, or empty
    parameters  how the outfit was made, as JSON values; empty where it was not made by `generate_outfit`
    """

    name: str
    outfit: str
    motion: str
    category: str
    fabric: str
    body: str
    gender: str
    fps: float
    seed: int
    parts: tuple[str, ...]
    tightness: tuple[float, ...]
    parameters: dict[str, Any]


@dataclass(frozen=True)
class Texcoords:
    """Texture coordinates: `uv` (T, 2) and for every corner of every triangle its row of it, `corners` (F, 3)."""

    uv: NDArray[np.float32]
    corners: NDArray[np.int32]


REASONS = ("penetration", "depth", "crossings", "stretch", "longest_edge", "compression", "jump", "finite", "body")
"""Why frames are rejected: the quality gate's limits by name, and "body", where the body runs into itself.

The order is part of the file format.
"""

STRAIN_PERCENTILES = (1, 50, 99, 100)


@dataclass(frozen=True)
class QualityTrack:
    """What the quality gate measured in each of T frames.

    rejected     (T,) uint16: bit k is set where REASONS[k] rejects the frame; 0: fit to learn from
    penetration  (T,) share of vertices deeper than 1 mm in the body
    depth        (T,) metres: the deepest vertex
    crossings    (T,) cloth edges that pass through cloth
    strain       (T, 4) length over rest length of the edges at STRAIN_PERCENTILES
    jump         (T,) metres: longest way of a vertex since the frame before
    """

    rejected: NDArray[np.uint16]
    penetration: NDArray[np.float32]
    depth: NDArray[np.float32]
    crossings: NDArray[np.int32]
    strain: NDArray[np.float32]
    jump: NDArray[np.float32]

    @staticmethod
    def unmeasured(frames: int) -> QualityTrack:
        """All frames accepted, nothing measured: for imported data."""
        zero, none = np.zeros(frames, np.float32), np.zeros(frames, np.int32)
        return QualityTrack(none.astype(np.uint16), zero, zero, none, np.ones((frames, 4), np.float32), zero)

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """(T,)"""
        accepted: NDArray[np.bool_] = self.rejected == 0
        return accepted

    def rejections(self) -> dict[str, int]:
        """How many frames each reason rejects. A frame may count under several."""
        counts = {name: int((self.rejected >> bit & 1).sum()) for bit, name in enumerate(REASONS)}
        return {name: count for name, count in counts.items() if count}


@dataclass(frozen=True)
class Sequence:
    """One outfit on one body along one motion. Metres; axes of the body (Y up, +Z front); radians.

    template       (N, 3) float32: the outfit at rest, on the body in its T-pose with shape `betas`
    faces          (F, 3) int32, facing outwards
    triangle_part  (F,) int32 index into `facts.parts`
    texcoords      or None
    betas          (S,) float32
    poses          (T, 24, 3) float32 axis-angle
    trans          (T, 3) float32, added to posed vertices
    vertices       (T, N, 3) float32: the outfit in every frame, `trans` included
    quality        per frame
    """

    facts: SequenceFacts
    template: NDArray[np.float32]
    faces: NDArray[np.int32]
    triangle_part: NDArray[np.int32]
    texcoords: Texcoords | None
    betas: NDArray[np.float32]
    poses: NDArray[np.float32]
    trans: NDArray[np.float32]
    vertices: NDArray[np.float32]
    quality: QualityTrack

    def __len__(self) -> int:
        return len(self.poses)

    def samples(self) -> Iterator[Sample]:
        """The accepted frames, in order."""
        for frame in np.flatnonzero(self.quality.accepted):
            yield Sample(self, int(frame))


@dataclass(frozen=True)
class Sample:
    """One accepted frame of a sequence: what networks learn from and are measured on."""

    sequence: Sequence
    frame: int

    @property
    def pose(self) -> NDArray[np.float32]:
        """(24, 3) axis-angle."""
        pose: NDArray[np.float32] = self.sequence.poses[self.frame]
        return pose

    @property
    def trans(self) -> NDArray[np.float32]:
        """(3,) metres."""
        trans: NDArray[np.float32] = self.sequence.trans[self.frame]
        return trans

    @property
    def vertices(self) -> NDArray[np.float32]:
        """(N, 3) metres, `trans` included."""
        vertices: NDArray[np.float32] = self.sequence.vertices[self.frame]
        return vertices
