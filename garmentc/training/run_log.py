"""What training says while it runs: log.jsonl, TensorBoard's event files (needs tensorboardX), one-line reports."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from garmentc.training.stage import Progress, StepReport

LOG = "log.jsonl"
EVENTS = "tensorboard"

EVERY = 50
"""Steps whose mean makes one line of the log."""

SPEAK_AFTER = 10.0
"""Seconds between lines on the console."""


@dataclass
class RunLog:
    """The log of a run in `folder`. `starts` are the steps that come before each stage."""

    folder: Path
    starts: dict[str, int]
    show: Callable[[str], None]
    writer: Any = None
    _sums: dict[str, float] = field(default_factory=dict)
    _count: int = 0
    _seconds: float = 0.0
    _spoken: float = 0.0

    @staticmethod
    def opened(folder: Path, stages: list[tuple[str, int]], progress: Progress, show: Callable[[str], None]) -> RunLog:
        """Go on where a run was left: what its log says of steps that will be taken again is dropped.

        stages  name and steps of each
        """
        starts, total = {}, 0
        for name, steps in stages:
            starts[name], total = total, total + steps
        reached = starts[stages[progress.stage][0]] + progress.step if progress.stage < len(stages) else total
        path = folder / LOG
        if path.exists():
            lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
            kept = [line for line in lines if _total_step(line) <= reached]
            path.write_text("".join(kept), encoding="utf-8")
        return RunLog(folder, starts, show, _event_writer(folder / EVENTS, reached, show))

    def step(self, report: StepReport) -> None:
        """Take a step's report in."""
        for name, value in {**report.terms, "gradient": report.gradient}.items():
            self._sums[name] = self._sums.get(name, 0.0) + value
        self._count += 1
        self._seconds += report.seconds
        if report.step % EVERY and report.step < report.steps:
            return
        means = {name: value / self._count for name, value in self._sums.items()}
        each = self._seconds / self._count
        self._sums, self._count, self._seconds = {}, 0, 0.0
        facts = {"epoch": report.epoch, "learning_rate": report.learning_rate, "seconds_per_step": each}
        self._write(report.stage, report.step, {**facts, **means})
        now = time.monotonic()
        if now - self._spoken > SPEAK_AFTER or report.step == report.steps:
            self._spoken = now
            left = each * (report.steps - report.step) / 60
            terms = " ".join(f"{name} {value:.4g}" for name, value in means.items())
            place = f"{report.stage} {report.step}/{report.steps} epoch {report.epoch:.2f}"
            self.show(f"{place} | {terms} | {each:.3f} s/step, {left:.1f} min left")

    def measured(self, stage: str, step: int, figures: dict[str, float]) -> None:
        """Figures on held-out outfits."""
        self._write(stage, step, figures)
        self.show(f"{stage} {step} held out | " + " ".join(f"{name} {value:.4g}" for name, value in figures.items()))

    def close(self) -> None:
        """Nothing is written after this."""
        if self.writer is not None:
            self.writer.close()

    def _write(self, stage: str, step: int, values: dict[str, float]) -> None:
        total = self.starts[stage] + step
        line = {"stage": stage, "step": step, "total_step": total, **values}
        with (self.folder / LOG).open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
        if self.writer is not None:
            for name, value in values.items():
                self.writer.add_scalar(f"{stage}/{name}", value, total)


def _total_step(line: str) -> float:
    """Of a line of the log; beyond all steps where a kill cut it short."""
    try:
        return float(json.loads(line)["total_step"])
    except (ValueError, KeyError, TypeError):
        return float("inf")


def _event_writer(folder: Path, purge_step: int, show: Callable[[str], None]) -> Any:
    try:
        from tensorboardX import SummaryWriter  # type: ignore[import-untyped]
    except ImportError:
        show("no TensorBoard log: tensorboardX is not installed")
        return None
    return SummaryWriter(str(folder), purge_step=purge_step)
