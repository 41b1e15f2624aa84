"""garmentc evaluate."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, get_args

import click

from garmentc.cli.parameters import PATH
from garmentc.cli.printing import progress
from garmentc.options import Gender

if TYPE_CHECKING:
    from garmentc.evaluation.benchmark import Baseline


@click.command("evaluate")
@click.argument("glbs", type=PATH, nargs=-1, required=True, metavar="ASSET.glb...")
@click.option("--motion", "motions", type=PATH, multiple=True, required=True, help="Motion file; repeatable.")
@click.option(
    "--baseline",
    type=click.Choice(["nearest", "none"]),
    default="nearest",
    show_default=True,
    help="Also measure plain skinning with the weights of the nearest body vertex.",
)
@click.option("--step", type=click.IntRange(min=1), default=10, show_default=True, help="Measure every n-th frame.")
@click.option("--open-arms", default=0.0, show_default=True, metavar="DEGREES", help="Open the arms by this much.")
@click.option("--body", type=PATH, metavar="FILE", help="Body model, where it is not the default one.")
@click.option("--gender", type=click.Choice(get_args(Gender)[1:]), help="Body, where the file does not say.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of Markdown.")
@click.option("-q", "--quiet", is_flag=True, help="Show no progress.")
def command(
    glbs: tuple[Path, ...],
    motions: tuple[Path, ...],
    baseline: str,
    step: int,
    open_arms: float,
    body: Path | None,
    gender: str | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Measure compiled outfits along motions: vertices inside the body, stretched edges, bend.

    Prints a Markdown table.
    """
    from garmentc.evaluation.benchmark import benchmark
    from garmentc.evaluation.evaluate import EvaluationOptions
    from garmentc.evaluation.table import markdown, to_json

    baselines: list[Baseline] = ["nearest"] if baseline == "nearest" else []
    options = EvaluationOptions(step, open_arms)
    with progress([path.name for path in glbs], quiet) as show:
        rows = benchmark(glbs, motions, baselines, options, body, gender, lambda name: show(name, 0.0))
    click.echo(to_json(rows) if as_json else markdown(rows), nl=False)
