"""Assets as the pipeline makes them, measured in other people's engines against the rig that was written."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import engine_runs
import numpy as np
import pytest
from scipy.spatial import cKDTree

from garmentc import emission, optimisation, pipeline
from garmentc.gltf.asset import GltfOptions
from garmentc.gltf.bind import rest_joint_matrices
from garmentc.gltf.evaluate import world_positions
from garmentc.gltf.finding import Finding
from garmentc.gltf.glb_asset import GlbAsset
from garmentc.gltf.read import read_glb
from garmentc.gltf.state import rest_state
from garmentc.gltf.validate import validate_glb
from garmentc.gltf.write import WrittenGlb
from garmentc.options import CompileOptions, Profile
from garmentc.passes.prune_morphs import PruneMorphs
from garmentc.passes.report import PassReport
from garmentc.rig import Rig

EXAMPLES = Path(__file__).parents[1] / "examples"
MOTION = EXAMPLES / "motions" / "step_turn_raise.npz"
FRAMES = [11, 43, 78, 119]
FPS = 30
TIMES = [float(np.float32(frame / FPS)) for frame in FRAMES]
FLOAT, QUANTIZED = 2e-6, 2e-4  # metres


@dataclass(frozen=True)
class Case:
    """An outfit and how it is compiled.

    given   options of the pipeline, by name
    pruned  metres: blend shapes lose what moves less than this; None leaves it to the pipeline
    """

    outfit: Path
    given: tuple[tuple[str, Any], ...]
    pruned: float | None = None

    def __str__(self) -> str:
        pruned = () if self.pruned is None else (f"pruned={self.pruned}",)
        return "-".join([self.outfit.stem, *(f"{name}={value}" for name, value in self.given), *pruned])

    @property
    def options(self) -> CompileOptions:
        return CompileOptions(motion=(MOTION,), **dict(self.given))


def case(outfit: Path, pruned: float | None = None, **given: Any) -> Case:
    return Case(outfit, tuple(given.items()), pruned)


@dataclass(frozen=True)
class Compiled:
    """A file and what went into it: the rig after all passes, in float.

    path     with every keyframe kept, so that what is left between file and rig is rounding
    written  the same as `compile_outfit` writes it, keyframes reduced
    """

    case: Case
    path: Path
    rig: Rig
    dressed: pipeline.Dressed
    written: WrittenGlb

    @property
    def corner_vertices(self) -> np.ndarray:
        """The rig's vertex of each vertex of the file."""
        return np.concatenate([part.vertices for part in self.dressed.corners.primitives])

    @property
    def obj_vertices(self) -> np.ndarray:
        """The OBJ's vertex of each vertex of the file."""
        return np.concatenate([part.obj_vertices for part in self.dressed.corners.primitives])

    def moved(self, rig: Rig, frames: list[int]) -> np.ndarray:
        """Where `rig` puts the file's vertices at frames of the motion, (T, S, 3), float64."""
        [motion] = self.dressed.motions
        assert motion.fps == FPS
        keys = None if rig.animation_keys is None else rig.animation_keys[frames]
        return rig.posed(motion.poses[frames], motion.trans[frames], keys)[:, self.corner_vertices]


@cache
def _inferred(outfit: Path) -> tuple[pipeline.Inputs, pipeline.Dressed, Rig]:
    """The stages that don't depend on a profile."""
    options = CompileOptions(motion=(MOTION,))
    source = pipeline.read_inputs(outfit, options)
    dressed = pipeline.dress(source, options)
    return source, dressed, pipeline.infer(source.bundle, dressed)


@cache
def _optimised(outfit: Path, pruned: float | None, profile: Profile) -> tuple[Rig, tuple[PassReport, ...]]:
    """The passes of a case; `profile` without quantization, which a pass only measures."""
    _, dressed, rig = _inferred(outfit)
    options = CompileOptions(motion=(MOTION,), profile="reference", **asdict(profile))
    with pytest.MonkeyPatch.context() as patch:
        if pruned is not None:
            patch.setattr(optimisation, "PruneMorphs", partial(PruneMorphs, threshold=pruned))
        return optimisation.optimise(rig, options, dressed)


def compile_case(case: Case, folder: Path) -> Compiled:
    """Run the pipeline's stages, as `compile_outfit` does, and emit twice."""
    source, dressed, _ = _inferred(case.outfit)
    rig, reports = _optimised(case.outfit, case.pruned, replace(case.options.settings, quantize=False))
    layers = [pipeline.Layer(source, dressed, rig, reports)]
    written = pipeline.emit(layers, case.options, folder / f"{case}.glb")
    path = folder / f"{case}-all-keyframes.glb"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(emission, "GltfOptions", partial(GltfOptions, key_tolerance=0))
        pipeline.emit(layers, case.options, path)
    return Compiled(case, path, rig, dressed, written)


@dataclass(frozen=True)
class Measured:
    """What engines make of a compiled file. Errors in metres, the largest coordinate over all vertices (and FRAMES).

    khronos          the validator's reports on both files
    findings         garmentc's own
    gltf_transform   against the rig
    three            against the rig limited to the four influences that three.js reads
    rest             at rest with zero morph weights, against the OBJ file's numbers (through `to_body`, see `measure`)
    step             of the positions' quantization, 0 for float
    sparse           share of the blend shapes' accessors that are sparse
    """

    case: Case
    bytes: int
    khronos: tuple[dict[str, Any], ...] = field(repr=False)
    findings: tuple[Finding, ...]
    gltf_transform: float
    three: float
    rest: float
    step: float
    sparse: float
    summary: str
    warnings: tuple[str, ...]

    @property
    def tolerance(self) -> float:
        return QUANTIZED if self.step else FLOAT


def measure(cases: list[Case], folder: Path, to_body: np.ndarray | None = None) -> dict[Case, Measured]:
    """Compile all cases and run each engine once.

    to_body  (4, 4) from the OBJs' coordinates to metres in the body's axes, known to their makers; None is the identity
    """
    engine_runs.require_engines()
    compiled = [compile_case(each, folder) for each in cases]
    paths = [each.path for each in compiled]
    written = [each.written.path for each in compiled]
    khronos = zip(*(engine_runs.khronos_reports(files, folder) for files in (paths, written)), strict=True)
    gltf_transform = engine_runs.animated_positions("gltf_transform.mjs", paths, TIMES, folder)
    three = engine_runs.animated_positions("three_cpu.mjs", paths, TIMES, folder)
    measured = {}
    for each, reports, transformed, shown in zip(compiled, khronos, gltf_transform, three, strict=True):
        glb = read_glb(each.path)
        alignment = each.dressed.alignment
        measured[each.case] = Measured(
            case=each.case,
            bytes=each.written.bytes,
            khronos=reports,
            findings=validate_glb(glb),
            gltf_transform=largest(transformed - each.moved(each.rig, FRAMES)),
            three=largest(shown - each.moved(engine_runs.first_four(each.rig), FRAMES)),
            rest=rest_error(each, glb, np.eye(4) if to_body is None else to_body),
            step=quantization_step(glb),
            sparse=sparse_share(glb),
            summary=alignment.summary,
            warnings=tuple(
                warning.message
                for warning in (*each.dressed.outfit.warnings, *alignment.warnings, *each.written.warnings)
            ),
        )
    return measured


def largest(difference: np.ndarray) -> float:
    return float(np.abs(difference).max())


def obj_points(path: Path) -> np.ndarray:
    """The numbers of an OBJ's `v` lines, (V, 3)."""
    return np.array([line.split()[1:4] for line in path.read_text().splitlines() if line.startswith("v ")], dtype=float)


def rest_error(compiled: Compiled, glb: GlbAsset, to_body: np.ndarray) -> float:
    """The largest coordinate between the file at rest and its OBJ, vertex by vertex, with no vertex of the OBJ lost."""
    points = obj_points(compiled.case.outfit) @ to_body[:3, :3].T + to_body[:3, 3]
    resting = np.concatenate(world_positions(glb, rest_state(glb)))
    lost, _ = cKDTree(resting).query(points, p=np.inf)
    return max(largest(resting - points[compiled.obj_vertices]), float(lost.max()))


def quantization_step(glb: GlbAsset) -> float:
    """Metres between neighbouring 16-bit positions; 0 where positions are floats."""
    [node] = glb.mesh_nodes
    if glb.meshes[0].primitives[0].storage["POSITION"].component == "float32":
        return 0.0
    return float(rest_joint_matrices(glb, node)[0, 0, 0]) / 32767


def sparse_share(glb: GlbAsset) -> float:
    """How many of the morph targets' positions and normals are sparse accessors, from 0 to 1."""
    stored = [
        storage.sparse is not None
        for primitive in glb.meshes[0].primitives
        for name, storage in primitive.storage.items()
        if name.startswith("targets/")
    ]
    return sum(stored) / len(stored)
