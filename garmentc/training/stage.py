"""The loop that every stage of training shares: batches, gradients, Adam, checkpoints, measurements."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Protocol

import torch
from torch import Tensor, nn

from garmentc.training.batch_plan import Batch, BatchPlan
from garmentc.training.recipe import Optimisation
from garmentc.training.workers import Workers


class Stage(Protocol):
    """What is learned in a stage, and from what."""

    @property
    def name(self) -> str:
        """As in the recipe and in logs."""
        ...

    @property
    def plan(self) -> BatchPlan:
        """The batches of every step."""
        ...

    @property
    def optimisation(self) -> Optimisation:
        """Learning rates and the like."""
        ...

    def parameters(self) -> Iterable[nn.Parameter]:
        """What is trained."""
        ...

    def losses(self, batch: Batch, done: float) -> tuple[Tensor, dict[str, Tensor]]:
        """What to minimise on a batch, and its terms unweighted. `done` is the share of the stage that is over."""
        ...


@dataclass
class Progress:
    """How far training is: what a checkpoint holds beside the network and the optimiser.

    stage    index of the stage
    step     of the stage; all before it are taken
    seconds  of each stage so far, over all starts
    figures  measured on held-out outfits at the end of each stage, by its name
    """

    stage: int = 0
    step: int = 0
    seconds: list[float] = field(default_factory=list)
    figures: dict[str, dict[str, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class StepReport:
    """One step: the means of the terms over its batches."""

    stage: str
    step: int
    steps: int
    epoch: float
    learning_rate: float
    gradient: float
    terms: dict[str, float]
    seconds: float


@dataclass(frozen=True)
class Interruptions:
    """What happens between steps.

    must_stop  asked after every step
    after      called with every step's report
    """

    must_stop: Callable[[], bool]
    after: Callable[[StepReport, torch.optim.Optimizer], None]


def run_stage(
    stage: Stage,
    progress: Progress,
    optimizer_state: dict[str, Any] | None,
    workers: Workers,
    interruptions: Interruptions,
) -> bool:
    """Take the stage's remaining steps. False where it was stopped before its end."""
    parameters, plan, settings = list(stage.parameters()), stage.plan, stage.optimisation
    optimizer = make_optimizer(parameters, settings)
    if optimizer_state is not None:
        optimizer.load_state_dict(optimizer_state)
    while progress.step < plan.steps:
        began = time.perf_counter()
        done = progress.step / plan.steps
        rate = learning_rate(settings, done)
        for group in optimizer.param_groups:
            group["lr"] = rate
        batches = plan.of_step(progress.step)
        optimizer.zero_grad()
        sums: dict[str, Tensor] = {}
        for batch in workers.share(batches):
            total, parts = stage.losses(batch, done)
            (total / len(batches)).backward()  # type: ignore[no-untyped-call]
            for name, value in {"loss": total, **parts}.items():
                sums[name] = sums.get(name, torch.zeros(())) + value.detach().cpu() / len(batches)
        workers.sum_gradients(parameters)
        gradient = float(nn.utils.clip_grad_norm_(parameters, settings.clip))
        optimizer.step()
        progress.step += 1
        seconds = time.perf_counter() - began
        progress.seconds[progress.stage] += seconds
        # Who has no batch knows no terms either, so the leader's names count.
        names, stops = workers.from_leader((list(sums), interruptions.must_stop()))
        means = workers.summed(torch.stack([sums.get(name, torch.zeros(())) for name in names]))
        terms = dict(zip(names, means.tolist(), strict=True))
        epoch = plan.epoch(progress.step)
        interruptions.after(
            StepReport(stage.name, progress.step, plan.steps, epoch, rate, gradient, terms, seconds), optimizer
        )
        if stops and progress.step < plan.steps:
            return False
    return True


def make_optimizer(parameters: Iterable[nn.Parameter], settings: Optimisation) -> torch.optim.Optimizer:
    """Adam; with weight decay as of Loshchilov and Hutter 2019 where the recipe has any."""
    return torch.optim.AdamW(list(parameters), lr=settings.learning_rate, weight_decay=settings.weight_decay)


def learning_rate(settings: Optimisation, done: float) -> float:
    """Half a cosine from the first to the final rate."""
    span = settings.learning_rate - settings.final_learning_rate
    return settings.final_learning_rate + span * 0.5 * (1 + math.cos(math.pi * done))
