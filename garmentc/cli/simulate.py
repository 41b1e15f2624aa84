"""garmentc simulate."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from garmentc.cli.interruption import resumable
from garmentc.cli.parameters import PATH
from garmentc.cli.printing import file_size, table
from garmentc.errors import GarmentcError

if TYPE_CHECKING:
    from garmentc.simulation.dataset import Dataset
    from garmentc.simulation.plan import Plan
    from garmentc.simulation.task_graph import Outcome


def _cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@click.command("simulate")
@click.option("--out", type=PATH, metavar="DIR", help="Dataset folder: made, resumed where it was left, or enlarged.")
@click.option(
    "--preset",
    default="small",
    show_default=True,
    metavar="NAME",
    help="What to make: benchmark-v1, wardrobe-v1 or -v2 (to train on only), tshirt (one topology) or small.",
)
@click.option("--outfits", type=click.IntRange(min=1), metavar="N", help="How many outfits, instead of the preset's.")
@click.option("--category", "categories", multiple=True, metavar="NAME", help="Only such outfits; repeatable.")
@click.option(
    "--motion", "motions", type=PATH, multiple=True, metavar="FILE", help="Motion instead of sampled ones; repeatable."
)
@click.option(
    "--poses",
    type=click.Choice(["ranges", "statistics"]),
    default="ranges",
    show_default=True,
    help="Walk through poses from hand-made ranges of motion, or from the statistics of recorded motion.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Everything random follows it.")
@click.option(
    "--workers", type=click.IntRange(min=1), default=_cores, show_default="one per core", help="Processes to use."
)
@click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler to use instead, such as tcp://host:8786.")
@click.option("--list-outfits", is_flag=True, help="Print the outfits of the plan and stop.")
@click.option(
    "--export-outfit", type=(click.IntRange(min=0), PATH), metavar="SEED OUT.obj", help="Write one outfit and stop."
)
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
def command(
    out: Path | None,
    preset: str,
    outfits: int | None,
    categories: tuple[str, ...],
    motions: tuple[Path, ...],
    poses: str,
    seed: int,
    workers: int,
    scheduler: str | None,
    list_outfits: bool,
    export_outfit: tuple[int, Path] | None,
    quiet: bool,
) -> None:
    """Make a dataset of outfits in motion by physics-based simulation, from nothing but a seed.

    Stopped or killed at any time, the same command goes on where it was. The dataset is the same, byte for byte,
    however many workers make it.
    """
    from garmentc.simulation.plan import make_plan
    from garmentc.simulation.presets import PRESETS

    if preset not in PRESETS:
        raise GarmentcError(f"unknown preset '{preset}'; the presets are {', '.join(PRESETS)}")
    if export_outfit is not None:
        _export(*export_outfit)
        return
    plan = make_plan(replace(PRESETS[preset], poses=poses), seed, outfits, motions, categories)
    if list_outfits:
        click.echo(_outfit_table(plan))
        return
    if out is None:
        raise click.UsageError("give a folder for the dataset: --out DIR")
    dataset = _simulate(plan, out, workers, scheduler, quiet)
    if not quiet:
        click.echo(_summary(dataset))


def _simulate(plan: Plan, out: Path, workers: int, scheduler: str | None, quiet: bool) -> Dataset:
    from garmentc.simulation.cloth_simulator import warm_up
    from garmentc.simulation.newton_cloth import import_newton
    from garmentc.simulation.simulate_task import simulate_task
    from garmentc.simulation.task_graph import Runner, run_plan

    import_newton()  # says what to install before any work is done
    if workers > 1 and scheduler is None:
        warm_up()
    with resumable(), _progress(sum(1 for _ in plan.tasks), quiet) as show:
        return run_plan(plan, out, simulate_task, Runner(workers, scheduler), show)


@contextmanager
def _progress(total: int, quiet: bool) -> Iterator[Callable[[Outcome], None]]:
    """A bar with the time left and the share of frames rejected so far, on stderr where that is a terminal."""
    from tqdm import tqdm

    frames = accepted = 0
    with tqdm(total=total, unit="sequence", file=sys.stderr, disable=quiet or not sys.stderr.isatty()) as bar:

        def show(outcome: Outcome) -> None:
            nonlocal frames, accepted
            frames, accepted = frames + outcome.frames, accepted + outcome.accepted
            bar.set_postfix_str(f"{accepted} frames, {1 - accepted / max(frames, 1):.1%} rejected", refresh=False)
            bar.update()

        yield show


def _export(seed: int, path: Path) -> None:
    from garmentc.output import check_outputs
    from garmentc.simulation.outfits import generate_outfit, sample_parameters
    from garmentc.simulation.write_outfit import write_obj
    from garmentc.smpl.default_body import load_default_body

    if path.suffix.lower() != ".obj":
        raise GarmentcError(f"cannot write an outfit as '{path.suffix}'; name the file .obj", path)
    check_outputs([path])
    parameters = sample_parameters(seed)
    try:
        outfit = generate_outfit(parameters, load_default_body(parameters.gender))
    except ValueError as error:
        raise GarmentcError(f"the outfit with seed {seed} cannot be made ({error}); try another seed") from None
    betas = ",".join(repr(float(beta)) for beta in parameters.betas)
    comments = (
        f"{parameters.category} for a {parameters.gender} body, seed {seed}",
        f"compile it with: --gender {parameters.gender} --betas {betas}",
    )
    write_obj(outfit, path, comments=comments)


def _outfit_table(plan: Plan) -> str:
    rows = [
        (
            outfit.name,
            outfit.parameters.seed,
            outfit.parameters.category,
            outfit.parameters.gender,
            outfit.fabric,
            outfit.parameters.vertex_count,
            "held out" if outfit.held_out else "train",
            ", ".join(garment.kind for garment in outfit.parameters.garments),
        )
        for outfit in plan.outfits
    ]
    return table(rows, header=("outfit", "seed", "category", "body", "fabric", "vertices", "split", "garments"))


def _summary(dataset: Dataset) -> str:
    frames = sum(entry.frames for entry in dataset.entries)
    accepted = sum(entry.accepted for entry in dataset.entries)
    rows = [
        ("dataset", dataset.name),
        ("outfits", str(len({entry.outfit for entry in dataset.entries}))),
        ("sequences", str(len(dataset.entries))),
        ("frames accepted", f"{accepted} of {frames}"),
        ("size", file_size(sum(entry.bytes for entry in dataset.entries))),
        ("hash", dataset.sha256),
    ]
    return table(rows)
