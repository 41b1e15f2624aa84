"""python -m garmentc.evaluation a.glb b.glb --motion walk.npz: the benchmark table on standard output."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from garmentc.cli.printing import print_error
from garmentc.errors import GarmentcError
from garmentc.evaluation.benchmark import Baseline, benchmark
from garmentc.evaluation.evaluate import EvaluationOptions
from garmentc.evaluation.table import markdown, to_json

_PATH = click.Path(path_type=Path)


@click.command()
@click.argument("outfits", nargs=-1, required=True, type=_PATH)
@click.option("--motion", "motions", multiple=True, type=_PATH, help="Motion file; repeatable.")
@click.option("--baseline", "baselines", multiple=True, type=click.Choice(["nearest"]), help="Also measure this.")
@click.option("--step", default=10, show_default=True, help="Measure every n-th frame.")
@click.option("--open-arms", default=0.0, show_default=True, help="Degrees to open the arms by.")
@click.option("--body", type=_PATH, help="Model file of the body, where it is not the default one.")
@click.option("--gender", type=click.Choice(["female", "male", "neutral"]), help="Where the file does not say.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of Markdown.")
def main(
    outfits: tuple[Path, ...],
    motions: tuple[Path, ...],
    baselines: tuple[str, ...],
    step: int,
    open_arms: float,
    body: Path | None,
    gender: str | None,
    as_json: bool,
) -> None:
    """Measure compiled outfits along motions: collisions with the body, stretched edges, bend."""
    try:
        options = EvaluationOptions(step, open_arms)
        names: list[Baseline] = ["nearest"] if "nearest" in baselines else []
        rows = benchmark(outfits, motions, names, options, body, gender, lambda name: click.echo(name, err=True))
    except GarmentcError as error:
        print_error(str(error))
        sys.exit(2)
    click.echo(to_json(rows) if as_json else markdown(rows), nl=False)


if __name__ == "__main__":
    main()
