"""What a compile did, as data: what the Python API returns, and what `--report` and `--json` write.

Times and paths stand here and nowhere in the .glb, whose bytes depend on its input alone.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from garmentc import __version__
from garmentc.errors import Diagnostic
from garmentc.output import written_whole
from garmentc.passes.report import PassReport


@dataclass(frozen=True)
class FileFacts:
    """A file by its content. A device or a pipe has none to speak of: no bytes and no hash."""

    path: str
    bytes: int
    sha256: str

    @classmethod
    def of(cls, path: Path) -> FileFacts:
        if not path.is_file():
            return cls(str(path), 0, "")
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        return cls(str(path), path.stat().st_size, digest)


@dataclass(frozen=True)
class StageTime:
    """Wall time of one stage of the pipeline."""

    name: str
    seconds: float


@dataclass(frozen=True)
class OutfitFacts:
    """What was read.

    vertices   of the OBJ
    welded     vertices after merging equal positions: what the networks see
    corners    vertices of the glb, split at seams
    texcoords  whose the texture coordinates are
    """

    vertices: int
    triangles: int
    welded: int
    corners: int
    materials: tuple[str, ...]
    textures: int
    texcoords: Literal["authored", "made", "none"]


@dataclass(frozen=True)
class FitFacts:
    """How an outfit sits on its body: distances of its vertices from the skin."""

    mean_gap_mm: float
    median_gap_mm: float
    p95_gap_mm: float
    inside: float
    depth_mm: float


@dataclass(frozen=True)
class AlignmentFacts:
    """How the outfit was recognised.

    fit          how the outfit sits on the body, millimetres, and the share of its vertices inside
    misfits_mm   by gender: how badly the best guess fits each body that was tried
    to_body      4x4 matrix from file coordinates to the body's axes and metres, before the pose is undone
    """

    summary: str
    units: str
    up: str
    front: str
    origin: str
    rest_pose: str
    arms_degrees: float
    body: str
    gender: str
    betas: tuple[float, ...]
    fit: FitFacts
    misfits_mm: dict[str, float]
    to_body: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class ModelFacts:
    """Where the rig came from."""

    family: str
    bundle: str
    fabric: str | None


@dataclass(frozen=True)
class MotionFacts:
    """A motion that became an animation."""

    name: str
    source: str
    frames: int
    fps: float


@dataclass(frozen=True)
class RigFacts:
    """What an engine has to run.

    keyframes          of all animation channels, out of `all_keyframes` that there were before some were left out
    keyframe_error_mm  how far leaving them out moves a vertex, at most
    """

    joints: int
    influences: int
    morphs: int
    quantized: bool
    pose_keys: bool
    keyframes: int
    all_keyframes: int
    keyframe_error_mm: float


@dataclass(frozen=True)
class BodyFacts:
    """The body that was written beside the outfit.

    correctives_mean_mm, _max_mm  what its pose correctives, which are left out, would move its vertices by
    """

    name: str
    vertices: int
    correctives_mean_mm: float
    correctives_max_mm: float


@dataclass(frozen=True)
class LayerFacts:
    """What CompileReport says of the first outfit, for another one in the same file."""

    input: FileFacts
    outfit: OutfitFacts
    alignment: AlignmentFacts
    passes: tuple[PassReport, ...]
    morphs: int


@dataclass(frozen=True)
class CompileReport:
    """The result of a compile (schemas/report.schema.json).

    also  further outfits in the file; `input`, `outfit`, `alignment`, `passes` and `rig.morphs` are the first one's
    body  the body in the file, if there is one
    """

    input: FileFacts
    output: FileFacts
    profile: str
    outfit: OutfitFacts
    alignment: AlignmentFacts
    model: ModelFacts
    passes: tuple[PassReport, ...]
    rig: RigFacts
    motions: tuple[MotionFacts, ...]
    stages: tuple[StageTime, ...]
    warnings: tuple[Diagnostic, ...]
    also: tuple[LayerFacts, ...] = ()
    body: BodyFacts | None = None
    garmentc: str = __version__
    schema: int = 1

    @property
    def seconds(self) -> float:
        """Wall time of all stages."""
        return sum(stage.seconds for stage in self.stages)

    def as_document(self) -> dict[str, Any]:
        """Plain JSON values."""
        document: dict[str, Any] = json.loads(json.dumps(asdict(self), allow_nan=False))
        return document


def write_report(report: CompileReport, path: Path) -> None:
    """Write `report` as JSON. Raises GarmentcError where the file cannot be written."""
    text = json.dumps(report.as_document(), indent=2, ensure_ascii=False) + "\n"
    with written_whole(path) as file:
        file.write(text.encode("utf-8"))
