"""garmentc train."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

import click

from garmentc.cli.parameters import PATH, Number
from garmentc.cli.printing import print_warnings
from garmentc.errors import Diagnostic, GarmentcError

if TYPE_CHECKING:
    from garmentc.training.recipe import Recipe
    from garmentc.training.train_deepsd import Trained
    from garmentc.training.workers import Workers


@click.group("train")
def command() -> None:
    """Train networks on datasets of simulated outfits, and export them as bundles."""


@command.command("deepsd", short_help="Train DeePSD on datasets, by a recipe.")
@click.option(
    "--data",
    "folders",
    type=PATH,
    required=True,
    multiple=True,
    metavar="DIR",
    help="Dataset, as `garmentc simulate` makes it; repeatable.",
)
@click.option("--config", required=True, metavar="FILE", help="Recipe (.toml), or the name of one of garmentc's own.")
@click.option("--out", type=PATH, required=True, metavar="DIR", help="Folder of the run: made, or resumed.")
@click.option(
    "--body", "bodies", type=PATH, multiple=True, metavar="FILE", help="Body model of imported data; repeatable."
)
@click.option("--time-limit", type=Number(min=0), metavar="MINUTES", help="Stop cleanly, save, go on later.")
@click.option("--threads", type=click.IntRange(min=1), default=1, show_default=True, help="Of each process.")
@click.option("--device", type=click.Choice(["cpu", "cuda"]), default="cpu", show_default=True, help="To compute on.")
@click.option("--measure", default="test", show_default=True, metavar="SPLIT", help="Split to measure for the log.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
def deepsd(
    folders: tuple[Path, ...],
    config: str,
    out: Path,
    bodies: tuple[Path, ...],
    time_limit: float | None,
    threads: int,
    device: str,
    measure: str,
    quiet: bool,
) -> None:
    """Train DeePSD: first on the simulation, then its second branch on physics, as the recipe says.

    Stopped or killed at any time, the same command goes on where it was, and ends with the same network. A finished
    run has its model bundle in DIR/bundle.

    Several processes, on one machine or many: torchrun --nproc-per-node 2 -m garmentc train deepsd ...
    """
    _require_torch()
    from garmentc.training.recipe import read_recipe
    from garmentc.training.workers import joined

    recipe = read_recipe(_config_file(config))
    _check_device(device)
    with joined(device == "cuda") as workers:
        show = _shown(workers, quiet)
        trained = _train(recipe, folders, out, bodies, time_limit, threads, measure, workers, show)
        if workers.leads:
            _finish(trained, out, show)


def _train(
    recipe: Recipe,
    folders: tuple[Path, ...],
    out: Path,
    bodies: tuple[Path, ...],
    time_limit: float | None,
    threads: int,
    measure: str,
    workers: Workers,
    show: Callable[[str], None],
) -> Trained:
    import torch

    from garmentc.simulation.dataset import open_dataset
    from garmentc.training.checkpoint import check_same_recipe, read_checkpoint
    from garmentc.training.train_deepsd import train
    from garmentc.training.training_data import read_training_data

    torch.set_num_threads(threads)
    begun = read_checkpoint(out) if workers.leads else None
    if begun is not None:  # before the data, whose preparation takes minutes
        check_same_recipe(begun, recipe, out)
    datasets = [open_dataset(folder) for folder in folders]
    unfinished = [folder for folder, data in zip(folders, datasets, strict=True) if not data.complete]
    if workers.leads:
        message = "the dataset is incomplete; training on what is there"
        print_warnings([Diagnostic("incomplete-dataset", message, str(folder)) for folder in unfinished])
    data = read_training_data(datasets, recipe, measure if workers.leads else None, bodies)
    show(f"{data.facts.outfits} outfits in {data.facts.frames} frames; {len(data.held_out)} held out")
    limit = None if time_limit is None else 60 * time_limit
    with _stoppable() as must_stop:
        return train(
            recipe,
            data.outfits,
            data.held_out,
            data.facts,
            out,
            workers,
            time_limit=limit,
            must_stop=must_stop,
            show=show,
        )


def _finish(trained: Trained, out: Path, show: Callable[[str], None]) -> None:
    from garmentc.training.bundle_record import BUNDLE, export_run, has_bundle
    from garmentc.training.predict import load_run

    minutes = sum(trained.progress.seconds) / 60
    if not trained.finished:
        show(f"stopped after {minutes:.1f} minutes of training; the same command goes on")
        return
    run, where = load_run(out), "no rig can express this variant, so it has no bundle"
    if has_bundle(run):
        export_run(run, out / BUNDLE)
        where = f"bundle in {out / BUNDLE}"
    show(f"finished after {minutes:.1f} minutes of training; {where}")


@command.command("export", short_help="Write the model bundle of a training run.")
@click.argument("run", type=PATH, metavar="DIR")
@click.option("-o", "--output", type=PATH, required=True, metavar="BUNDLE", help="Folder of the bundle.")
@click.option("--version", "version", metavar="TEXT", help="Version of the bundle instead of garmentc's.")
def export(run: Path, output: Path, version: str | None) -> None:
    """Write the model bundle of the training run in DIR, finished or not."""
    _require_torch()
    from garmentc import __version__
    from garmentc.training.bundle_record import export_run
    from garmentc.training.predict import load_run

    export_run(load_run(run), output, version=version or __version__)


def _require_torch() -> None:
    if find_spec("torch") is None:
        raise GarmentcError("training needs PyTorch; install it with: pip install 'garmentc[train]'")


def _check_device(device: str) -> None:
    import torch

    if device == "cuda" and not torch.cuda.is_available():
        raise GarmentcError("PyTorch finds no CUDA device; leave --device out to train on the CPU")


def _config_file(config: str) -> Path:
    from garmentc.training.recipe import CONFIGS

    own = CONFIGS / f"{config}.toml"
    return own if own.exists() and not Path(config).is_file() else Path(config)


def _shown(workers: Workers, quiet: bool) -> Callable[[str], None]:
    def show(line: str) -> None:
        if workers.leads and not quiet:
            click.echo(line)

    return show


@contextmanager
def _stoppable() -> Iterator[Callable[[], bool]]:
    """Within, the first Ctrl-C or polite kill is a wish to stop after the step; the second stops at once."""
    wishes: list[int] = []
    former: dict[int, Any] = {}

    def wish(number: int, frame: FrameType | None) -> None:
        wishes.append(number)
        signal.signal(number, former[number])

    for number in (int(signal.SIGINT), int(signal.SIGTERM)):
        if signal.getsignal(number) != signal.SIG_IGN:
            former[number] = signal.signal(number, wish)
    try:
        yield lambda: bool(wishes)
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)
