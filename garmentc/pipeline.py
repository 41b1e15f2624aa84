"""The compile pipeline, in the order in which it runs: read, align, infer, optimise, emit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from garmentc.emission import emit
from garmentc.errors import Diagnostic, GarmentcError
from garmentc.families import deepsd
from garmentc.families.bundle import Bundle, load_bundle
from garmentc.families.held_cloth import held_cloth, hold_beneath
from garmentc.gltf.meshopt import codec
from garmentc.gltf.names import unique_names
from garmentc.layer import Dressed, Inputs, Layer
from garmentc.make_report import make_report
from garmentc.optimisation import optimise, quantized_together
from garmentc.options import CompileOptions
from garmentc.outfit.align import Alignment, AlignOptions, align
from garmentc.outfit.align.together import common_gender
from garmentc.outfit.corners import split_corners
from garmentc.outfit.obj import read_obj
from garmentc.outfit.topology import edges, surface_warnings, vertex_normals, weld
from garmentc.outfit.unwrap import unwrap
from garmentc.output import check_outputs, is_special
from garmentc.report import CompileReport, StageTime
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.load import load_body
from garmentc.smpl.motion import Motion
from garmentc.smpl.parameters import Parameters, read_parameters
from garmentc.smpl.read_motion import read_motion

STAGES = ("read", "align", "infer", "optimise", "emit")

Progress = Callable[[str, float], None]


def compile_outfit(
    outfit: str | PathLike[str] | Sequence[str | PathLike[str]],
    output: str | PathLike[str],
    options: CompileOptions | None = None,
    *,
    on_progress: Progress = lambda stage, done: None,
    **given: Any,
) -> CompileReport:
    """Compile the OBJ file `outfit`, or several that are worn together, to the .glb file `output`.

    options      what to do; the keyword arguments in `given` replace single options, by the names of CompileOptions
    on_progress  called with a stage's name (STAGES) and how much of it is done, from 0 to 1

    Several outfits share body, skeleton and animations; each is a mesh with morph targets and pose keys of its own.
    The bytes of the .glb depend on the inputs alone. A former file at `output` stays until the new one is whole.
    Raises GarmentcError for everything that a user can cause or mend.
    """
    options = replace(options or CompileOptions(), **given)
    paths = [Path(outfit)] if isinstance(outfit, (str, PathLike)) else [Path(path) for path in outfit]
    _check(paths, Path(output), options)
    check_outputs((output, options.keys_onnx), inputs=(*paths, options.body, options.params, *options.motion))
    clock = _Clock(on_progress)

    def inferred(number: int) -> Callable[[int, int], None]:
        return lambda done, total: on_progress("infer", (number + done / total) / len(paths))

    with clock("read"):
        sources = [read_inputs(path, options) for path in paths]
    with clock("align"):
        all_dressed = dress_together(sources, options)
    with clock("infer"):
        rigs = [
            infer(source.bundle, dressed, options.fabric, inferred(number))
            for number, (source, dressed) in enumerate(zip(sources, all_dressed, strict=True))
        ]
    with clock("optimise"):
        layers = [
            Layer(source, dressed, *optimise(rig, options, dressed))
            for source, dressed, rig in zip(sources, all_dressed, rigs, strict=True)
        ]
        layers = quantized_together(layers, options)
    with clock("emit"):
        written = emit(layers, options, Path(output))
    return make_report(options, layers, written, clock.stages)


def _check(paths: Sequence[Path], output: Path, options: CompileOptions) -> None:
    """Raise GarmentcError now for what would fail later: no outfit, options that are for one, a missing package."""
    if not paths:
        raise GarmentcError("no outfit is given; name an OBJ file")
    if output.suffix.lower() != ".glb" and not is_special(output):
        raise GarmentcError(f"ends in '{output.suffix}', and engines go by that; name a .glb", output)
    if options.meshopt:
        codec()  # now, not after all the work
    for option, value in (("keys-onnx", options.keys_onnx), ("name", options.name)):
        if len(paths) > 1 and value is not None:
            raise GarmentcError(f"--{option} is for one outfit, and {len(paths)} are given; leave it out")


def read_inputs(outfit: Path, options: CompileOptions) -> Inputs:
    """Read and check the outfit with its materials, the parameters and the model bundle."""
    bundle = load_bundle(options.bundle)
    bundle.encode_fabric(options.fabric)  # raises now what would fail later
    return Inputs(
        outfit=read_obj(outfit, allow_external_textures=options.allow_external_textures),
        parameters=Parameters() if options.params is None else read_parameters(options.params),
        bundle=bundle,
    )


def dress(source: Inputs, options: CompileOptions) -> Dressed:
    """Find out how the outfit is meant and put it on its body; unwrap, weld and split it; read the motions."""
    return dress_together([source], options)[0]


def dress_together(sources: Sequence[Inputs], options: CompileOptions) -> tuple[Dressed, ...]:
    """The same for several outfits on one body, which must fit them all."""
    given = sources[0].parameters
    known = AlignOptions(
        units=options.units,
        up=options.up,
        front=options.front,
        pose=given.pose if options.pose == "auto" and given.pose is not None else options.pose,
        gender=given.gender if options.gender == "auto" and given.gender is not None else options.gender,
        betas=given.betas if options.betas is None else np.array(options.betas),
    )
    bodies = _bodies(options.body, known.gender)
    alignments = [align(source.outfit, bodies, known) for source in sources]
    gender, doubts = common_gender(alignments)
    alignments = [
        alignment if alignment.gender == gender else align(source.outfit, bodies, replace(known, gender=gender))
        for source, alignment in zip(sources, alignments, strict=True)
    ]
    alignments[0] = replace(alignments[0], warnings=(*alignments[0].warnings, *doubts))
    up = None if options.motion_up == "auto" else options.motion_up
    joints = alignments[0].body.joints(alignments[0].betas)
    motions = _distinct([read_motion(path, up, joints) for path in options.motion])
    return tuple(_dressed(alignment, motions, options) for alignment in alignments)


def _distinct(motions: Sequence[Motion]) -> tuple[Motion, ...]:
    """The motions under different names, as engines find animations by name."""
    renamed = []
    for motion, name in zip(motions, unique_names([motion.name for motion in motions], ()), strict=True):
        if name != motion.name:
            message = f"another motion has the name '{motion.name}' too; this one's animation is called '{name}'"
            warning = Diagnostic("motion-renamed", message)
            motion = replace(motion, name=name, warnings=(*motion.warnings, warning))
        renamed.append(motion)
    return tuple(renamed)


def _dressed(alignment: Alignment, motions: tuple[Motion, ...], options: CompileOptions) -> Dressed:
    outfit = unwrap(alignment.outfit, options.unwrap)
    welded = weld(outfit)
    outfit = replace(outfit, warnings=(*outfit.warnings, *surface_warnings(outfit, welded)))
    cloth = held_cloth(welded.vertices, edges(welded.triangles), alignment.body, alignment.betas)
    return Dressed(alignment, outfit, welded, split_corners(outfit, welded), cloth, motions)


def _bodies(path: Path | None, gender: str) -> Mapping[str, BodyModel] | Callable[[str], BodyModel]:
    """The bodies that the outfit may be fitted to: all default ones, or the one in the user's model file."""
    if path is None:
        return load_default_body
    body = load_body(path, None if gender == "auto" else gender)
    return {body.gender: body}


def infer(
    bundle: Bundle,
    dressed: Dressed,
    fabric: str | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Rig:
    """Run the bundle's networks, once: the outfit becomes a rig."""
    vertices, triangles = dressed.welded.vertices, dressed.welded.triangles
    body, betas = dressed.alignment.body, dressed.alignment.betas
    joined = edges(triangles)
    normals = vertex_normals(vertices, triangles)
    rig = deepsd.infer(
        bundle, vertices, normals, triangles, joined, body.joints(betas), dressed.cloth, fabric, progress=progress
    )
    return hold_beneath(rig, dressed.cloth, body, betas)


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
