"""The compile pipeline, in the order in which it runs: read, align, infer, optimise, emit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.families import deepsd
from garmentc.families.bundle import Bundle, load_bundle
from garmentc.gltf.asset import Asset, Clip, GltfOptions
from garmentc.gltf.write import WrittenGlb, write_glb
from garmentc.key_graph import write_key_graph
from garmentc.options import CompileOptions
from garmentc.outfit.align import Alignment, AlignOptions, align
from garmentc.outfit.corners import CornerMesh, split_corners
from garmentc.outfit.obj import read_obj
from garmentc.outfit.outfit import Outfit
from garmentc.outfit.topology import Welded, edges, vertex_normals, weld
from garmentc.outfit.unwrap import unwrap
from garmentc.output import check_outputs
from garmentc.passes.follow_skin import FollowSkin, follow_skin
from garmentc.passes.limit_influences import LimitInfluences, limit_influences
from garmentc.passes.morph_normals import MorphNormals, morph_normals
from garmentc.passes.pose_set import PoseSet, plausible_poses
from garmentc.passes.prune_morphs import PruneMorphs, prune_morphs
from garmentc.passes.quantize import Quantize, quantize
from garmentc.passes.reduce_blend_shapes import ReduceBlendShapes, reduce_blend_shapes
from garmentc.passes.report import PassReport
from garmentc.passes.resolve_collisions import ResolveCollisions, resolve_collisions
from garmentc.report import CompileReport, StageTime, make_report
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.load import load_body
from garmentc.smpl.motion import Motion
from garmentc.smpl.parameters import Parameters, read_parameters
from garmentc.smpl.read_motion import read_motion

STAGES = ("read", "align", "infer", "optimise", "emit")

Progress = Callable[[str, float], None]

CHECKED_POSES = 32
"""Poses that the error of a pass is measured on; a quarter as many frames of the motions join them."""


def compile_outfit(
    outfit: str | PathLike[str],
    output: str | PathLike[str],
    options: CompileOptions | None = None,
    *,
    on_progress: Progress = lambda stage, done: None,
    **given: Any,
) -> CompileReport:
    """Compile the OBJ file `outfit` to the .glb file `output`.

    options      what to do; the keyword arguments in `given` replace single options, by the names of CompileOptions
    on_progress  called with a stage's name (STAGES) and how much of it is done, from 0 to 1

    The bytes of the .glb depend on the inputs alone. A former file at `output` stays until the new one is whole.
    Raises GarmentcError for everything that a user can cause or mend.
    """
    options = replace(options or CompileOptions(), **given)
    check_outputs((output, options.keys_onnx), inputs=(outfit, options.body, options.params, *options.motion))
    clock = _Clock(on_progress)
    with clock("read"):
        source = read_inputs(Path(outfit), options)
    with clock("align"):
        dressed = dress(source, options)
    with clock("infer"):
        rig = infer(source.bundle, dressed, lambda done, total: on_progress("infer", done / total))
    with clock("optimise"):
        rig, reports = optimise(rig, options, dressed)
    with clock("emit"):
        written = emit(rig, dressed, source, options, Path(output))
    return make_report(options, source, dressed, rig, reports, written, clock.stages)


@dataclass(frozen=True)
class Inputs:
    """What was read before anything is known about the body."""

    outfit: Outfit
    parameters: Parameters
    bundle: Bundle


def read_inputs(outfit: Path, options: CompileOptions) -> Inputs:
    """Read and check the outfit with its materials, the parameters and the model bundle."""
    return Inputs(
        outfit=read_obj(outfit, allow_external_textures=options.allow_external_textures),
        parameters=Parameters() if options.params is None else read_parameters(options.params),
        bundle=load_bundle(options.bundle),
    )


@dataclass(frozen=True)
class Dressed:
    """The outfit on its body, in the body's axes and T-pose, and the motions that this body will do."""

    alignment: Alignment
    outfit: Outfit
    welded: Welded
    corners: CornerMesh
    motions: tuple[Motion, ...]


def dress(source: Inputs, options: CompileOptions) -> Dressed:
    """Find out how the outfit is meant and put it on its body; unwrap, weld and split it; read the motions."""
    given = source.parameters
    known = AlignOptions(
        units=options.units,
        up=options.up,
        front=options.front,
        pose=given.pose if options.pose == "auto" and given.pose is not None else options.pose,
        gender=given.gender if options.gender == "auto" and given.gender is not None else options.gender,
        betas=given.betas if options.betas is None else np.array(options.betas),
    )
    alignment = align(source.outfit, _bodies(options.body, known.gender), known)
    outfit = unwrap(alignment.outfit, options.unwrap)
    welded = weld(outfit)
    up = None if options.motion_up == "auto" else options.motion_up
    joints = alignment.body.joints(alignment.betas)
    motions = tuple(read_motion(path, up, joints) for path in options.motion)
    return Dressed(alignment, outfit, welded, split_corners(outfit, welded), motions)


def _bodies(path: Path | None, gender: str) -> Mapping[str, BodyModel] | Callable[[str], BodyModel]:
    """The bodies that the outfit may be fitted to: all default ones, or the one in the user's model file."""
    if path is None:
        return load_default_body
    body = load_body(path, None if gender == "auto" else gender)
    return {body.gender: body}


def infer(bundle: Bundle, dressed: Dressed, progress: Callable[[int, int], None] = lambda done, total: None) -> Rig:
    """Run the bundle's networks, once: the outfit becomes a rig."""
    vertices, triangles = dressed.welded.vertices, dressed.welded.triangles
    joints = dressed.alignment.body.joints(dressed.alignment.betas)
    normals = vertex_normals(vertices, triangles)
    return deepsd.infer(bundle, vertices, normals, triangles, edges(triangles), joints, progress=progress)


Pass = Callable[[Rig, PoseSet], tuple[Rig, PassReport]]


def passes(options: CompileOptions, body: BodyModel, betas: NDArray[Any] | None) -> tuple[Pass, ...]:
    """The passes, in the order in which they run."""
    settings = options.settings
    reduction = ReduceBlendShapes(None if options.morph_tolerance else settings.morphs, options.morph_tolerance)
    invisible = PruneMorphs() if settings.sparse == "auto" else PruneMorphs(threshold=0)
    steps: list[Pass] = [
        lambda rig, poses: follow_skin(rig, FollowSkin(), poses, body, betas),
        lambda rig, poses: limit_influences(rig, LimitInfluences(settings.influences), poses),
        # Needs the final weights, and works best with all keys that the network has.
        lambda rig, poses: resolve_collisions(rig, ResolveCollisions(), poses, body, betas),
        lambda rig, poses: reduce_blend_shapes(rig, reduction, poses),
        # Whatever mixes or adds to shapes fills their zeros.
        lambda rig, poses: prune_morphs(rig, invisible, poses),
        # Follow from the final shapes.
        lambda rig, poses: morph_normals(rig, MorphNormals(), poses),
    ]
    if settings.quantize:
        # Only measures: the back end rounds, once.
        steps.append(lambda rig, poses: quantize(rig, Quantize(settings.influences), poses))
    return tuple(steps)


def optimise(rig: Rig, options: CompileOptions, dressed: Dressed) -> tuple[Rig, tuple[PassReport, ...]]:
    """Run the passes. Each says what it costs in posed vertices."""
    frames = [motion.poses for motion in dressed.motions]
    poses = plausible_poses(np.concatenate(frames) if frames else None, check=CHECKED_POSES)
    reports = []
    for run in passes(options, dressed.alignment.body, dressed.alignment.betas):
        rig, report = run(rig, poses)
        reports.append(report)
    return rig, tuple(reports)


def emit(rig: Rig, dressed: Dressed, source: Inputs, options: CompileOptions, output: Path) -> WrittenGlb:
    """Write the .glb and, where asked for, the pose-key network as ONNX."""
    settings = options.settings
    alignment = dressed.alignment
    betas = () if alignment.betas is None else alignment.betas
    asset = Asset(
        name=options.name or source.outfit.path.stem,
        rig=rig,
        primitives=dressed.corners.primitives,
        materials=dressed.outfit.materials,
        clips=tuple(Clip(motion) for motion in dressed.motions),
        options=GltfOptions(
            influences=settings.influences,
            quantize=settings.quantize,
            sparse=settings.sparse == "auto",
            pose_keys=options.pose_keys,
        ),
        extras={
            "body": alignment.body.name,
            "gender": alignment.gender,
            "betas": ",".join(repr(float(beta)) for beta in betas),
            "bundle": source.bundle.name,
            "profile": options.profile,
            **{f"fps:{motion.name}": float(motion.fps) for motion in dressed.motions},
        },
    )
    written = write_glb(asset, output)
    if options.keys_onnx is not None and rig.keys is not None:
        write_key_graph(rig.keys, options.keys_onnx)
    return written


class _Clock:
    """Wall time by stage."""

    def __init__(self, on_progress: Progress) -> None:
        self.stages: list[StageTime] = []
        self._on_progress = on_progress

    @contextmanager
    def __call__(self, stage: str) -> Iterator[None]:
        self._on_progress(stage, 0.0)
        start = perf_counter()
        yield
        self.stages.append(StageTime(stage, perf_counter() - start))
