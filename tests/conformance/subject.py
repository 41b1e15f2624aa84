"""A file that engines are tried on, and where its vertices belong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import engine_runs
import numpy as np
from compiled import Compiled
from gltf_samples import corner_vertices

from conformance.gowns import Gown, write_gowns
from garmentc.gltf.reorder import reordered
from garmentc.outfit.corners import CornerPrimitive
from garmentc.rig import Rig
from garmentc.smpl.motion import Motion

FLOAT, QUANTIZED = 2e-6, 2e-4  # metres

GOWN_FRAMES = [0, 7, 17, 29]
GOWN_COLUMNS = ("influences", "morphs", "stored", "numbers", "packed", "materials", "normals", "vertices")


@dataclass(frozen=True)
class Subject:
    """A .glb and its truth: the rig in float that was written, never what can be read from the file.

    labels      what the tables call it
    rig         after all passes
    vertices    (S,) the rig's vertex of each vertex of the file
    triangles   (F, 3) of all primitives, indices into S
    motion      of the first animation
    frames      of the motion, where engines are asked
    influences  4 or 8
    quantized   whether vertex attributes are integers
    """

    labels: tuple[str, ...]
    glb: Path
    rig: Rig
    vertices: np.ndarray
    triangles: np.ndarray
    motion: Motion
    frames: list[int]
    influences: int
    quantized: bool

    @property
    def tolerance(self) -> float:
        """Metres."""
        return QUANTIZED if self.quantized else FLOAT

    @property
    def times(self) -> list[float]:
        """Seconds, of `frames`, as a file has them."""
        return [float(np.float32(frame / self.motion.fps)) for frame in self.frames]

    def positions(self, influences: int = 8, normalized: bool = True) -> np.ndarray:
        """(T, S, 3) metres at `times`, in an engine that reads so many influences and brings their sum to 1, or not."""
        poses, translations = self.motion.poses[self.frames], self.motion.trans[self.frames]
        keys = None if self.rig.animation_keys is None else self.rig.animation_keys[self.frames]
        return self.posed(poses, translations, influences, normalized, keys)

    def posed(
        self,
        poses: np.ndarray,
        translations: np.ndarray,
        influences: int = 8,
        normalized: bool = True,
        keys: np.ndarray | None = None,
    ) -> np.ndarray:
        """(P, S, 3) metres in poses (P, 24, 3) with root translations (P, 3); with keys (P, M), or the network's."""
        rig = engine_runs.first_four(self.rig, normalized) if influences < self.influences else self.rig
        return rig.posed(poses, translations, keys)[:, self.vertices]


def of_gowns(gowns: Sequence[Gown], folder: Path) -> list[Subject]:
    """Write synthetic files; the labels are those of GOWN_COLUMNS."""
    return [_of_gown(gown, glb) for gown, glb in zip(gowns, write_gowns(gowns, folder), strict=True)]


def _of_gown(gown: Gown, glb: Path) -> Subject:
    asset = gown.asset()
    vertices = corner_vertices(asset)
    labels = (
        str(gown.influences),
        str(gown.morphs),
        "sparse" if gown.sparse else "dense",
        "quantized" if gown.quantize else "float",
        "meshopt" if gown.meshopt else "–",
        str(gown.parts),
        "yes" if gown.normals else "no",
        f"{len(vertices):,}",
    )
    triangles = _triangles(asset.primitives)
    motion = asset.clips[0].motion
    return Subject(labels, glb, asset.rig, vertices, triangles, motion, GOWN_FRAMES, gown.influences, gown.quantize)


def of_compiled(compiled: Compiled, labels: tuple[str, ...], glb: Path, frames: list[int]) -> Subject:
    """A file that the pipeline made, every keyframe kept: `glb`, which perhaps a tool has rewritten."""
    settings = compiled.case.options.settings
    [motion] = compiled.dressed.motions
    primitives = compiled.dressed.corners.primitives
    if compiled.case.options.meshopt:
        primitives = tuple(map(reordered, primitives))
    return Subject(
        labels=labels,
        glb=glb,
        rig=compiled.rig,
        vertices=np.concatenate([primitive.vertices for primitive in primitives]),
        triangles=_triangles(primitives),
        motion=motion,
        frames=frames,
        influences=settings.influences,
        quantized=settings.quantize,
    )


def _triangles(primitives: Sequence[CornerPrimitive]) -> np.ndarray:
    starts = np.cumsum([0] + [len(primitive.vertices) for primitive in primitives[:-1]])
    return np.concatenate(
        [primitive.triangles.astype(np.int64) + start for primitive, start in zip(primitives, starts, strict=True)]
    )
