"""garmentc compile."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import click

from garmentc import options as choices
from garmentc.cli.garbage import uncollected
from garmentc.cli.parameters import PATH, Length, Numbers
from garmentc.cli.printing import file_size, print_json, print_warnings, progress, table
from garmentc.options import CompileOptions

if TYPE_CHECKING:
    from garmentc.report import BodyFacts, CompileReport, LayerFacts, RigFacts


def _choice(flag: str, literal: Any, description: str) -> Callable[[Any], Any]:
    """An option with fixed words, and CompileOptions' default for it."""
    default = getattr(CompileOptions, flag.removeprefix("--").replace("-", "_"))
    return click.option(
        flag, type=click.Choice(get_args(literal)), default=default, show_default=default is not None, help=description
    )


@click.command("compile")
@click.argument("outfits", type=PATH, nargs=-1, required=True, metavar="OUTFIT.obj...")
@click.option("-o", "--output", type=PATH, metavar="OUT.glb", required=True, help="File to write.")
@click.option("--body", type=PATH, metavar="FILE", help="SMPL, SMPL-H or SMPL-X model (.npz, .pkl) to dress.")
@_choice("--gender", choices.Gender, "Body; auto takes the one that the outfit fits best.")
@click.option("--betas", type=Numbers(), metavar="B0,B1,...", help="Shape coefficients of the body.")
@click.option("--params", type=PATH, metavar="FILE", help="Gender, betas and pose in a .json or .npz file.")
@click.option("--motion", type=PATH, multiple=True, metavar="FILE", help="Motion (AMASS .npz, .bvh); repeatable.")
@_choice("--motion-up", choices.MotionUp, "Up axis of the motion.")
@_choice("--units", choices.Units, "Length unit of the outfit.")
@_choice("--up", choices.Axis, "Axis of the outfit that points up.")
@_choice("--front", choices.Axis, "Axis of the outfit that the body faces.")
@_choice("--pose", choices.RestPose, "Rest pose of the outfit: T-pose or A-pose.")
@_choice("--profile", choices.ProfileName, "Named settings of the passes.")
@click.option("--influences", type=click.Choice([4, 8]), help="Joints that may pull one vertex.")
@click.option("--morphs", type=click.IntRange(min=0), metavar="N", help="Number of morph targets to keep.")
@click.option(
    "--animation-morphs",
    type=click.IntRange(min=0),
    metavar="N",
    help="Morph targets more, at most, that let cloth fall along the animations.",
)
@click.option("--morph-tolerance", type=Length(), metavar="0.5mm", help="Keep as few morphs as hold this error.")
@click.option("--quantize/--no-quantize", default=None, help="Integer instead of float vertex attributes.")
@_choice("--sparse", choices.Sparse, "Sparse morph targets where they are smaller.")
@_choice("--unwrap", choices.Unwrap, "Make texture coordinates where there are none.")
@click.option("--allow-external-textures", is_flag=True, help="Read textures outside the outfit's folder.")
@click.option(
    "--pose-keys/--no-pose-keys", default=True, show_default=True, help="Write the pose-key network into the glb."
)
@click.option("--meshopt", is_flag=True, help="Compress the glb (EXT_meshopt_compression); loaders need a decoder.")
@_choice("--skeleton", choices.SkeletonName, "Whose names the joints have.")
@click.option("--with-body", is_flag=True, help="Write the body beside the outfit, for previews and try-on.")
@click.option("--keys-onnx", type=PATH, metavar="OUT.onnx", help="Also write the pose-key network as ONNX.")
@click.option("--fabric", metavar="NAME", help="What the outfit is made of: cotton, silk, denim or leather.")
@_choice("--family", choices.Family, "Model family.")
@click.option("--bundle", type=PATH, metavar="DIR", help="Model bundle to use instead of the one shipped.")
@click.option("--name", metavar="NAME", help="Name of the asset; otherwise the file name.")
@click.option("--report", type=PATH, metavar="OUT.json", help="Write what was done, with times and errors.")
@click.option("--json", "as_json", is_flag=True, help="Print the report as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
@uncollected()
def command(
    outfits: tuple[Path, ...], output: Path, report: Path | None, as_json: bool, quiet: bool, **given: Any
) -> None:
    """Compile OUTFIT.obj and SMPL parameters to one .glb.

    Several outfits are worn together: they share body, skeleton and animations. Whatever is not given is detected,
    or comes from the profile, and is reported.
    """
    from garmentc.output import check_outputs
    from garmentc.pipeline import STAGES, compile_outfit
    from garmentc.report import write_report

    options = CompileOptions(**given)
    check_outputs((report, output, options.keys_onnx), inputs=outfits)
    with progress(STAGES, quiet) as show:
        result = compile_outfit(outfits, output, options, on_progress=show)
    if report is not None:
        write_report(result, report)
    if not quiet:
        print_warnings(result.warnings)
    if as_json:
        print_json(result.as_document())
    elif not quiet:
        click.echo(_summary(result))


def _summary(report: CompileReport) -> str:
    """What a person wants to know: what was recognised, what was made, what it cost."""
    rig, output = report.rig, report.output
    morphs = " + ".join(str(count) for count in (rig.morphs, *(layer.morphs for layer in report.also)))
    rows = [
        *_layer(report, named=bool(report.also)),
        *(row for layer in report.also for row in _layer(layer, named=True)),
        *((f"motion {motion.name}", f"{motion.frames} frames at {motion.fps:g} fps") for motion in report.motions),
        *([("keyframes", _keyframes(rig))] if report.motions else []),
        *([("body", _body(report.body))] if report.body else []),
        ("rig", f"{rig.joints} joints, {rig.influences} influences, {morphs} morph targets"),
        (output.path, f"{file_size(output.bytes)} in {report.seconds:.1f} s"),
    ]
    return table(rows)


def _layer(layer: CompileReport | LayerFacts, named: bool) -> list[tuple[str, str]]:
    """How one outfit was recognised, and what the passes did with it."""
    outfit = layer.outfit
    texcoords = {"authored": "", "made": ", texture coordinates made", "none": ", no texture coordinates"}
    return [
        *([(Path(layer.input.path).name, "")] if named else []),
        ("recognised", layer.alignment.summary),
        ("outfit", f"{outfit.vertices} vertices, {outfit.triangles} triangles{texcoords[outfit.texcoords]}"),
        *((step.name, f"{step.detail}; {step.error}" if step.error else step.detail) for step in layer.passes),
    ]


def _body(body: BodyFacts) -> str:
    left_out = f"{body.correctives_mean_mm:.2f} mm mean, {body.correctives_max_mm:.1f} mm max"
    return f"{body.name}, {body.vertices} vertices; skinned only, pose correctives left out: {left_out}"


def _keyframes(rig: RigFacts) -> str:
    return f"{rig.keyframes} of {rig.all_keyframes} kept; {rig.keyframe_error_mm:.3f} mm max"
