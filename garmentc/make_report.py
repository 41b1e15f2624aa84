"""The report of a compile, gathered from what its stages found out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from garmentc.errors import Diagnostic
from garmentc.report import (
    AlignmentFacts,
    BodyFacts,
    CompileReport,
    FileFacts,
    FitFacts,
    LayerFacts,
    ModelFacts,
    MotionFacts,
    OutfitFacts,
    RigFacts,
    StageTime,
)

if TYPE_CHECKING:
    from garmentc.gltf.write import WrittenGlb
    from garmentc.layer import Dressed, Layer
    from garmentc.options import CompileOptions
    from garmentc.outfit.align import Alignment

CORRECTIVE_POSES = 16
"""Poses in which the body's left-out pose correctives are measured."""


def make_report(
    options: CompileOptions, layers: Sequence[Layer], written: WrittenGlb, stages: Sequence[StageTime]
) -> CompileReport:
    """The report on `layers`, all outfits of the file in its order, and on the file as `written`."""
    first, settings = layers[0], options.settings
    motions = first.dressed.motions
    warnings = [warning for layer in layers for warning in _warnings(layer)]
    warnings += [warning for motion in motions for warning in motion.warnings]
    if options.with_body and options.body is not None:
        message = "its mesh is in the file; check that its licence lets you pass the file on"
        warnings.append(Diagnostic("body-included", message, str(options.body)))
    return CompileReport(
        input=FileFacts.of(first.source.outfit.path),
        output=FileFacts.of(written.path),
        profile=options.profile,
        outfit=_outfit_facts(first.dressed),
        alignment=_alignment_facts(first.dressed.alignment),
        model=ModelFacts(options.family, first.source.bundle.name, options.fabric),
        passes=first.passes,
        rig=RigFacts(
            joints=len(first.rig.joints),
            influences=settings.influences,
            morphs=first.rig.morph_count,
            quantized=settings.quantize,
            pose_keys=options.pose_keys and first.rig.keys is not None,
            keyframes=written.keyframes,
            all_keyframes=written.all_keyframes,
            keyframe_error_mm=1000 * written.keyframe_error,
        ),
        motions=tuple(MotionFacts(m.name, m.source, len(m), m.fps) for m in motions),
        stages=tuple(stages),
        warnings=(*warnings, *written.warnings),
        also=tuple(
            LayerFacts(
                input=FileFacts.of(layer.source.outfit.path),
                outfit=_outfit_facts(layer.dressed),
                alignment=_alignment_facts(layer.dressed.alignment),
                passes=layer.passes,
                morphs=layer.rig.morph_count,
            )
            for layer in layers[1:]
        ),
        body=_body_facts(first.dressed) if options.with_body else None,
    )


def _warnings(layer: Layer) -> tuple[Diagnostic, ...]:
    return (*layer.dressed.outfit.warnings, *layer.dressed.alignment.warnings)


def _outfit_facts(dressed: Dressed) -> OutfitFacts:
    outfit = dressed.outfit
    textures = {material.base_color_texture.name for material in outfit.materials if material.base_color_texture}
    made = outfit.texcoords is not dressed.alignment.outfit.texcoords
    return OutfitFacts(
        vertices=len(outfit.vertices),
        triangles=len(outfit.tri_v),
        welded=len(dressed.welded.vertices),
        corners=sum(len(primitive.vertices) for primitive in dressed.corners.primitives),
        materials=tuple(material.name for material in outfit.materials),
        textures=len(textures),
        texcoords="made" if made else "authored" if (outfit.tri_vt >= 0).any() else "none",
    )


def _body_facts(dressed: Dressed) -> BodyFacts:
    from garmentc.gltf.body_mesh import left_out_correctives
    from garmentc.smpl.pose_sampler import sample_poses

    body = dressed.alignment.body
    mean, largest = left_out_correctives(body, sample_poses(CORRECTIVE_POSES, seed=0))
    return BodyFacts(body.name, len(body.v_template), 1000 * mean, 1000 * largest)


def _alignment_facts(alignment: Alignment) -> AlignmentFacts:
    fit, frame = alignment.fit, alignment.frame
    return AlignmentFacts(
        summary=alignment.summary,
        units=frame.unit,
        up=frame.up,
        front=frame.front,
        origin=frame.origin,
        rest_pose=alignment.rest_pose,
        arms_degrees=float(alignment.arms),
        body=alignment.body.name,
        gender=alignment.gender,
        betas=() if alignment.betas is None else tuple(float(beta) for beta in alignment.betas),
        fit=FitFacts(
            mean_gap_mm=1000 * fit.mean_gap,
            median_gap_mm=1000 * fit.median_gap,
            p95_gap_mm=1000 * fit.p95_gap,
            inside=fit.inside,
            depth_mm=1000 * fit.depth,
        ),
        misfits_mm={gender: 1000 * float(misfit) for gender, misfit in alignment.misfits.items()},
        to_body=tuple(tuple(float(value) for value in row) for row in alignment.to_body),
    )
