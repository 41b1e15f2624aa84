"""Train DeePSD on simulated outfits: stage A on the data, stage B, where the recipe has it, on physics.

    with joined() as workers:
        trained = train(recipe, outfits, held_out, data, folder, workers)

A run is a folder. Stopped or killed at any time, the same call goes on where its last checkpoint was, and ends with the
same network. Every draw of random numbers follows from the seed and the step.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import torch

from garmentc.errors import GarmentcError
from garmentc.training.checkpoint import Checkpoint, DataFacts, check_same_run, read_checkpoint, write_checkpoint
from garmentc.training.data_stage import DataLearning
from garmentc.training.deepsd_network import Deepsd
from garmentc.training.physics_stage import PhysicsLearning
from garmentc.training.predict import mean_error_mm
from garmentc.training.recipe import Recipe
from garmentc.training.run_log import RunLog
from garmentc.training.simulated_outfits import SimulatedOutfit
from garmentc.training.stage import Interruptions, Progress, Stage, StepReport, run_stage
from garmentc.training.workers import Workers

CHECKPOINT_SECONDS = 120.0


@dataclass(frozen=True)
class Trained:
    """What `train` leaves: the network, and whether all steps were taken."""

    network: Deepsd
    progress: Progress
    finished: bool


def train(
    recipe: Recipe,
    outfits: Sequence[SimulatedOutfit],
    held_out: Sequence[SimulatedOutfit],
    data: DataFacts,
    folder: Path,
    workers: Workers | None = None,
    *,
    time_limit: float | None = None,
    must_stop: Callable[[], bool] = lambda: False,
    show: Callable[[str], None] = lambda line: None,
) -> Trained:
    """Train, or go on training, the network of `recipe` in `folder`.

    outfits     to learn from
    held_out    measured now and then for the log; nothing depends on them
    data        what `outfits` are
    time_limit  seconds after which to stop and save
    must_stop   asked after every step

    Raises GarmentcError where there is nothing to learn from, or `folder` holds a run of another recipe or other data.
    """
    workers = workers or Workers()
    if not outfits:
        raise GarmentcError("the dataset has no accepted frames in the split 'train'; there is nothing to learn from")
    ends_at = time.monotonic() + (float("inf") if time_limit is None else time_limit)
    folder.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(recipe.seed)
    network = Deepsd(recipe.network).to(workers.device)  # drawn on the CPU: the same on every device
    progress, optimizer_state = Progress(), None
    checkpoint = workers.from_leader(read_checkpoint(folder) if workers.leads else None)
    if checkpoint is not None:
        check_same_run(checkpoint, recipe, data, folder)
        network.load_state_dict(checkpoint.network)
        progress, optimizer_state = checkpoint.progress, checkpoint.optimizer
    there = tuple(replace(outfit, sample=outfit.sample.to(workers.device)) for outfit in outfits)
    stages = _stages(network, recipe, there)
    progress.seconds += [0.0] * (len(stages) - len(progress.seconds))
    log = None
    if workers.leads:
        log = RunLog.opened(folder, [(stage.name, stage.plan.steps) for stage in stages], progress, show)
    saved_at = time.monotonic()

    def save(optimizer: dict[str, Any] | None) -> None:
        if workers.leads:
            write_checkpoint(folder, Checkpoint(recipe, data, network.state_dict(), optimizer, progress))

    last: dict[str, Any] | None = optimizer_state

    def after(report: StepReport, optimizer: torch.optim.Optimizer) -> None:
        nonlocal saved_at, last
        if log is None:
            return
        log.step(report)
        last = optimizer.state_dict()
        due = recipe.measure_every and report.step % recipe.measure_every == 0 and report.step < report.steps
        if held_out and due:
            log.measured(report.stage, report.step, measured(network, held_out))
        if time.monotonic() - saved_at > CHECKPOINT_SECONDS:
            save(last)
            saved_at = time.monotonic()

    interruptions = Interruptions(lambda: must_stop() or time.monotonic() > ends_at, after)
    while progress.stage < len(stages):
        stage = stages[progress.stage]
        if not run_stage(stage, progress, optimizer_state, workers, interruptions):
            save(last)
            break
        if log is not None and held_out:
            progress.figures[stage.name] = measured(network, held_out, every=1)
            log.measured(stage.name, progress.step, progress.figures[stage.name])
        progress.stage, progress.step, optimizer_state = progress.stage + 1, 0, None
        save(None)
    if log is not None:
        log.close()
    return Trained(network, progress, progress.stage == len(stages))


def _stages(network: Deepsd, recipe: Recipe, outfits: tuple[SimulatedOutfit, ...]) -> list[Stage]:
    stages: list[Stage] = [DataLearning(network, recipe, outfits)]
    if recipe.physics is not None:
        stages.append(PhysicsLearning(network, recipe, recipe.physics, outfits))
    return stages


def measured(network: Deepsd, held_out: Sequence[SimulatedOutfit], every: int = 8) -> dict[str, float]:
    """Figures for the log: the mean vertex distance to the simulation in every so many frames, mm."""
    return {"error_mm": mean_error_mm(network, held_out, every=every)}
