"""garmentc dataset."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from garmentc.cli.exit_codes import EXIT_CLEAN, EXIT_FINDINGS
from garmentc.cli.parameters import PATH
from garmentc.cli.printing import file_size, print_json, table

if TYPE_CHECKING:
    from garmentc.simulation.dataset_check import DatasetReport, GroupStatistics


@click.group("dataset")
def command() -> None:
    """Check, draw and import datasets of outfits in motion."""


@command.command("check", short_help="Read every file: hashes, splits, statistics.")
@click.argument("folder", type=PATH, metavar="DIR")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
@click.option("-q", "--quiet", is_flag=True, help="Show no progress.")
def check(folder: Path, as_json: bool, quiet: bool) -> int:
    """Read every file of the dataset in DIR: hashes, splits, statistics.

    Exit codes: 0 sound, 1 problems, 2 failure.
    """
    from garmentc.simulation.dataset import open_dataset
    from garmentc.simulation.dataset_check import check_dataset

    dataset = open_dataset(folder)
    with _counted(quiet, len(dataset.entries)) as show:
        report = check_dataset(dataset, show)
    if as_json:
        print_json(asdict(report))
    else:
        click.echo("\n\n".join(part for part in _parts(report) if part))
    return EXIT_FINDINGS if report.problems else EXIT_CLEAN


def _parts(report: DatasetReport) -> Iterator[str]:
    total = report.total
    yield table(
        [
            ("dataset", report.name),
            ("hash", report.sha256),
            ("outfits", str(total.outfits)),
            ("motions", str(total.motions)),
            ("frames accepted", f"{total.accepted} of {total.frames} ({total.accepted_share:.1%})"),
            ("sequences rejected", str(report.rejected_sequences)),
            ("frames rejected", ", ".join(f"{k} {n}" for k, n in report.rejected_frames.items()) or "none"),
            ("size of a frame", file_size(round(total.bytes_per_frame))),
        ]
    )
    header = ("", "sequences", "frames", "accepted", "> 1 mm deep", "crossings", "1 %", "median", "99 %", "longest")
    yield table([_row(group) for group in (total, *report.groups)], header=header)
    yield "\n".join(f"problem: {problem}" for problem in report.problems)


def _row(group: GroupStatistics) -> tuple[object, ...]:
    """Counts, then penetration, self-crossing edges a frame, and edge length over rest length."""
    return (
        group.name,
        group.sequences,
        group.frames,
        f"{group.accepted_share:.1%}",
        f"{group.penetration:.3%}",
        f"{group.crossings:.2f}",
        *(f"{strain:.2f}" for strain in group.strain),
    )


@command.command("preview", short_help="Draw a frame each of some sequences.")
@click.argument("folder", type=PATH, metavar="DIR")
@click.option("-o", "--output", type=PATH, required=True, metavar="SHEET.png", help="Picture to write.")
@click.option("--count", type=click.IntRange(1, 200), default=24, show_default=True, help="How many sequences.")
def preview(folder: Path, output: Path, count: int) -> None:
    """Draw a frame of each of some sequences, spread over the dataset in DIR."""
    from garmentc.output import check_outputs
    from garmentc.simulation.dataset import open_dataset
    from garmentc.simulation.dataset_preview import write_preview

    check_outputs([output])
    write_preview(open_dataset(folder), output, count)


@command.command("import", short_help="Turn CLOTH3D or TailorNet's dataset into one of these.")
@click.argument("layout", type=click.Choice(["cloth3d", "tailornet"]))
@click.argument("source", type=PATH, metavar="DIR")
@click.option("--out", type=PATH, required=True, metavar="DIR", help="Dataset folder to make.")
@click.option(
    "--body", "bodies", type=PATH, multiple=True, metavar="FILE", help="SMPL's models, for CLOTH3D; repeatable."
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the split.")
@click.option("-q", "--quiet", is_flag=True, help="Show no progress.")
def import_layout(layout: str, source: Path, out: Path, bodies: tuple[Path, ...], seed: int, quiet: bool) -> None:
    """Turn a copy of CLOTH3D or TailorNet's dataset in DIR, as published, into a dataset of garmentc's."""
    from garmentc.simulation.importers.import_dataset import import_dataset

    with _counted(quiet) as show:
        dataset = import_dataset(layout, source, out, bodies, seed, show)
    if not quiet:
        click.echo(f"{len(dataset.entries)} sequences, {sum(entry.frames for entry in dataset.entries)} frames")


@contextmanager
def _counted(quiet: bool, total: int | None = None) -> Iterator[Callable[[str], None]]:
    """Counts the calls of what it yields, on stderr where that is a terminal."""
    from tqdm import tqdm

    with tqdm(total=total, unit="sequence", file=sys.stderr, disable=quiet or not sys.stderr.isatty()) as bar:

        def show(name: str) -> None:
            bar.update()

        yield show
