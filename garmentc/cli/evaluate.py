"""garmentc evaluate."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import click

from garmentc.cli.parameters import PATH, Number
from garmentc.cli.printing import print_json, print_warnings, progress
from garmentc.errors import Diagnostic
from garmentc.options import Gender, ProfileName

if TYPE_CHECKING:
    from garmentc.evaluation.benchmark import Baseline

NEAREST, NONE = "nearest", "none"

_ALONG_MOTIONS = ("motions", "step", "open_arms", "gender")
_ON_A_DATASET = (
    "split",
    "profiles",
    "frames",
    "tell_fabric",
    "animate",
    "outfits",
    "workers",
    "output",
    "markdown",
    "picture",
)
"""Options of one of the two ways only; without a default, so that those given are known."""


@click.command("evaluate")
@click.argument("inputs", type=PATH, nargs=-1, metavar="ASSET.glb... | BUNDLE...")
@click.option(
    "--baseline",
    default=NEAREST,
    show_default=True,
    metavar="nearest|none|BUNDLE",
    help="Also measure skinning with the weights of the nearest body vertex, or, on a dataset, it and this bundle.",
)
@click.option("--body", "bodies", type=PATH, multiple=True, metavar="FILE", help="Body model, where not a default one.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of Markdown.")
@click.option("-q", "--quiet", is_flag=True, help="Show no progress.")
@click.option(
    "--motion",
    "motions",
    type=PATH,
    multiple=True,
    help="Of a .glb: motion file; repeatable.  [default: its animations]",
)
@click.option("--step", type=click.IntRange(min=1), help="Of a .glb: measure every n-th frame.  [default: 10]")
@click.option(
    "--open-arms",
    type=Number(-180, 180),
    metavar="DEGREES",
    help="Of a .glb: open the arms by this much.  [default: 0]",
)
@click.option("--gender", type=click.Choice(get_args(Gender)[1:]), help="Of a .glb: body, where the file does not say.")
@click.option("--data", type=PATH, metavar="DIR", help="Dataset that bundles are measured on.")
@click.option("--split", help="Of the dataset: train, test, test_outfits or test_motions.  [default: test]")
@click.option(
    "--profile",
    "profiles",
    type=click.Choice([*get_args(ProfileName), "network"]),
    multiple=True,
    help="Compile the outfits with it; repeatable. network: no passes, no file.  [default: reference, web]",
)
@click.option(
    "--frames", type=click.IntRange(min=1), metavar="N", help="Frames of each sequence.  [default: all good ones]"
)
@click.option("--tell-fabric", is_flag=True, help="Compile the outfits with their --fabric.")
@click.option("--animate", is_flag=True, help="Compile each sequence's motion too, and measure the animation.")
@click.option("--outfits", type=click.IntRange(min=1), metavar="N", help="Only the first N outfits.")
@click.option("--workers", type=click.IntRange(min=1), metavar="N", help="Processes.  [default: 1]")
@click.option("-o", "--output", type=PATH, metavar="RESULTS.json", help="Also write everything as JSON.")
@click.option("--markdown", type=PATH, metavar="FILE.md", help="Also write the Markdown tables.")
@click.option("--picture", type=PATH, metavar="FILE.png", help="Draw the best, median and worst sample.")
def command(inputs: tuple[Path, ...], data: Path | None, **options: Any) -> None:
    """Measure compiled outfits along motions, or model bundles on a dataset. Prints Markdown tables.

    \b
    ASSET.glb...                 vertices inside the body, bared skin, stretched edges, bend, along
                                 the file's own animations, or each --motion
    BUNDLE... --data DIR         each of the dataset's outfits compiled, and compared with its simulation too;
                                 the bundle that comes with garmentc where none is named;
                                 the folder of a training run stands for its network before all passes

    The word "nearest" in place of a bundle measures nothing but the skinning with the nearest body vertex.
    """
    foreign = _ON_A_DATASET if data is None else _ALONG_MOTIONS
    for parameter in command.params:
        if parameter.name in foreign and options[parameter.name]:
            needed = "BUNDLE... --data DIR" if data is None else "ASSET.glb..., without --data"
            raise click.UsageError(f"{parameter.opts[-1]} is for 'garmentc evaluate {needed}'")
    if data is None:
        _along_motions(inputs, **{key: value for key, value in options.items() if key not in _ON_A_DATASET})
    else:
        _on_a_dataset(inputs, data, **{key: value for key, value in options.items() if key not in _ALONG_MOTIONS})


def _along_motions(
    glbs: tuple[Path, ...],
    baseline: str,
    bodies: tuple[Path, ...],
    motions: tuple[Path, ...],
    step: int | None,
    open_arms: float | None,
    gender: str | None,
    as_json: bool,
    quiet: bool,
) -> None:
    from garmentc.evaluation.benchmark import benchmark
    from garmentc.evaluation.evaluate import EvaluationOptions
    from garmentc.evaluation.table import markdown, to_json

    if not glbs:
        raise click.UsageError("give compiled files, or a dataset with --data")
    if baseline not in (NEAREST, NONE):
        raise click.UsageError("--baseline takes a bundle with --data only; choose nearest or none")
    if len(bodies) > 1:
        raise click.UsageError("--body is repeatable with --data only")
    baselines: list[Baseline] = ["nearest"] if baseline == NEAREST else []
    options = EvaluationOptions(step or EvaluationOptions.step, open_arms or 0.0)
    body = bodies[0] if bodies else None
    with progress([path.name for path in glbs], quiet) as show:
        rows = benchmark(glbs, motions, baselines, options, body, gender, lambda name: show(name, 0.0))
    click.echo(to_json(rows) if as_json else markdown(rows), nl=False)


def _on_a_dataset(
    bundles: tuple[Path, ...],
    data: Path,
    baseline: str,
    bodies: tuple[Path, ...],
    split: str | None,
    profiles: tuple[Any, ...],
    frames: int | None,
    tell_fabric: bool,
    animate: bool,
    outfits: int | None,
    workers: int | None,
    output: Path | None,
    markdown: Path | None,
    picture: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    from garmentc.evaluation.dataset_evaluation import evaluate_dataset, outfits_of
    from garmentc.evaluation.evaluation_document import evaluation_document, evaluation_json
    from garmentc.evaluation.evaluation_markdown import evaluation_markdown
    from garmentc.evaluation.evaluation_picture import picture_bytes
    from garmentc.evaluation.method import NEAREST_METHOD, named_methods
    from garmentc.evaluation.representative import representatives
    from garmentc.output import check_outputs, written_whole
    from garmentc.simulation.dataset import open_dataset

    check_outputs([output, markdown, picture])
    dataset = open_dataset(data)
    if not dataset.complete:
        print_warnings([Diagnostic("dataset-unfinished", "is unfinished; the figures are of what is there", str(data))])
    profiles = profiles or ("reference", "web")
    own = [bundle for bundle in bundles if str(bundle) != NEAREST] if bundles else [None]
    other = [] if baseline in (NEAREST, NONE) else [Path(baseline)]
    named = named_methods([*own, *other], profiles)
    beside = tuple(method for folder in other for method in named[folder])
    methods = tuple(method for folder in own for method in named[folder] if method not in beside)
    if tell_fabric:
        methods = tuple(method.told_fabrics() for method in methods)
    if animate:
        methods, beside = (tuple(method.with_animations() for method in some) for some in (methods, beside))
    if baseline != NONE or not methods:
        methods = (NEAREST_METHOD, *methods)
    split = split or "test"
    names = [entries[0].outfit for entries in outfits_of(dataset, split)[:outfits]]
    with progress(names, quiet) as show:
        evaluation = evaluate_dataset(
            dataset,
            split,
            methods,
            beside,
            frames=frames,
            outfits=outfits,
            bodies=bodies,
            workers=workers or 1,
            progress=lambda name: show(name, 1.0),
        )
    samples = representatives(evaluation)
    document = evaluation_document(evaluation, samples if picture else ())
    files: list[tuple[Path | None, bytes]] = [
        (output, evaluation_json(document).encode()),
        (markdown, evaluation_markdown(evaluation).encode()),
        (picture, picture_bytes(evaluation, samples, dataset, bodies) if picture else b""),
    ]
    for path, content in files:
        if path is not None:
            with written_whole(path) as file:
                file.write(content)
    if as_json:
        print_json(document)
    else:
        click.echo(evaluation_markdown(evaluation), nl=False)
