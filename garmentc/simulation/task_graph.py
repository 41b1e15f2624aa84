"""Carrying out a plan: on this machine or on a Dask cluster, stopped and resumed at any time, always the same bytes.

One job is an outfit with its motions, because they share the outfit's making and settling. What a job does depends on
its tasks alone. A finished sequence is a file: either the sequence or a note why it was rejected. There are no lock
files and no journal, so there is nothing that a kill could leave in a wrong state: what has no file is done (again).
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from garmentc.errors import GarmentcError
from garmentc.simulation.dataset import (
    MANIFEST,
    REJECTED,
    REJECTED_LIST,
    SEQUENCES,
    Dataset,
    make_entry,
    make_folders,
    open_dataset,
    sequence_path,
    write_file,
    write_manifest,
)
from garmentc.simulation.plan import Plan, Task
from garmentc.simulation.sequence import REASONS, QualityTrack, Sequence
from garmentc.simulation.sequence_file import read_quality, sequence_bytes

_ONE_AT_A_TIME = threading.Lock()
"""A cluster's worker may run several threads; simulators keep their state per process."""


class RejectedSequence(Exception):
    """A sequence that came out bad as a whole. `reason` is one word; `detail` says more."""

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(reason, detail)
        self.reason = reason
        self.detail = detail


class Simulator(Protocol):
    """Makes a task's sequence, deterministically; facts.name is the task's. A function that can be pickled.

    Raises RejectedSequence where the result is of no use. Any other exception except OSError and MemoryError also
    rejects the sequence: one bad outfit never stops a run.
    """

    def __call__(self, task: Task, /) -> Sequence: ...


@dataclass(frozen=True)
class Outcome:
    """How one task ended: `accepted` of `frames`, or rejected as a whole with a `reason`."""

    name: str
    frames: int
    accepted: int
    reason: str = ""


@dataclass(frozen=True)
class Runner:
    """Where jobs run.

    workers    processes on this machine; 1 is this process itself
    scheduler  address of a Dask scheduler ("tcp://host:8786") to use instead; its workers must see the same folder
    """

    workers: int = 1
    scheduler: str | None = None


def run_plan(
    plan: Plan,
    folder: Path,
    simulate: Simulator,
    runner: Runner | None = None,
    progress: Callable[[Outcome], None] = lambda outcome: None,
) -> Dataset:
    """Simulate what is missing in `folder` and write its manifest. The result depends on `plan` and `simulate` alone.

    progress  is called with each sequence, also with those that are already there
    Raises GarmentcError where the folder holds another dataset or cannot be written, or workers keep dying.
    """
    runner = runner or Runner()
    _begin(plan, folder)
    missing: list[tuple[Task, ...]] = []
    for outfit in plan.outfits:
        left = []
        for task in plan.tasks_of(outfit):
            if (outcome := _done(folder, task)) is None:
                left.append(task)
            else:
                progress(outcome)
        if left:
            missing.append(tuple(left))
    job = partial(run_job, folder.absolute(), simulate)
    with closing(_outcomes(missing, job, runner)) as outcomes:  # a progress that raises stops the workers
        for outcome in outcomes:
            progress(outcome)
    return _finish(plan, folder)


Job = Callable[[tuple[Task, ...]], list[Outcome]]


def _outcomes(jobs: list[tuple[Task, ...]], job: Job, runner: Runner) -> Generator[Outcome, None, None]:
    from garmentc.simulation.task_runners import on_dask, on_processes

    if runner.scheduler is not None:
        results: Iterable[list[Outcome]] = on_dask(jobs, job, runner.scheduler)
    elif runner.workers > 1:
        results = on_processes(jobs, job, runner.workers)
    else:
        results = (job((task,)) for tasks in jobs for task in tasks)
    for result in results:
        yield from result


def run_job(folder: Path, simulate: Simulator, tasks: tuple[Task, ...]) -> list[Outcome]:
    """Simulate those of `tasks` that have no file yet and write their files. This is what workers run."""
    from threadpoolctl import threadpool_limits

    with _ONE_AT_A_TIME, threadpool_limits(limits=1):  # sums are rounded alike, whatever the number of cores
        return [_done(folder, task) or _carry_out(folder, simulate, task) for task in tasks]


def _carry_out(folder: Path, simulate: Simulator, task: Task) -> Outcome:
    try:
        sequence = simulate(task)
        if not sequence.quality.accepted.any():
            raise RejectedSequence("frames", f"no frame passed the quality gate: {_counted(sequence.quality)}")
        data = sequence_bytes(sequence)
    except (OSError, MemoryError):  # of this machine, not of the outfit: nothing to note down
        raise
    except RejectedSequence as rejection:
        return _reject(folder, task, rejection.reason, rejection.detail)
    except Exception as error:
        return _reject(folder, task, "failed", f"{type(error).__name__}: {error}")
    write_file(sequence_path(folder, task.name), data)
    return Outcome(task.name, len(sequence), int(sequence.quality.accepted.sum()))


def _reject(folder: Path, task: Task, reason: str, detail: str) -> Outcome:
    note: dict[str, Any] = {
        "sequence": task.name,
        "outfit": task.outfit.name,
        "category": task.outfit.parameters.category,
    }
    note |= {"reason": reason, "detail": " ".join(detail.split())[:500], "frames": task.motion.frames}
    write_file(_note_path(folder, task), (json.dumps(note) + "\n").encode())
    return Outcome(task.name, task.motion.frames, 0, reason)


def _counted(quality: QualityTrack) -> str:
    """For messages: "penetration 3, strain 9"."""
    return ", ".join(f"{reason} {count}" for reason, count in quality.rejections().items())


def _note_path(folder: Path, task: Task) -> Path:
    return folder / REJECTED / f"{task.name}.json"


def _done(folder: Path, task: Task) -> Outcome | None:
    """How the task ended where it has, as its file tells."""
    if (path := sequence_path(folder, task.name)).exists():
        quality = read_quality(path)
        return Outcome(task.name, len(quality.rejected), int(quality.accepted.sum()))
    try:
        note = json.loads(_note_path(folder, task).read_bytes())
    except FileNotFoundError:
        return None
    return Outcome(task.name, task.motion.frames, 0, str(note["reason"]))


def _begin(plan: Plan, folder: Path) -> None:
    """Make the folder ready: an unfinished manifest says whose it is, leftovers of a kill are removed."""
    make_folders(folder)
    document = plan.document()
    if (folder / MANIFEST).exists():
        former = open_dataset(folder).plan
        others = sorted(key for key in former | document if key != "outfits" and former.get(key) != document.get(key))
        if others or former["outfits"] > document["outfits"]:
            what = ", ".join(others or ["fewer outfits"]).replace("garmentc", "another version of garmentc")
            said = f"holds another dataset ({what}); give the options that it was made with, or an empty folder"
            raise GarmentcError(said, folder)
    _remove_leftovers(folder)
    write_manifest(folder, plan.preset.name, (), complete=False, plan=document)


def _remove_leftovers(folder: Path) -> None:
    """Of processes that were killed as they wrote a file."""
    for part in (SEQUENCES, REJECTED):
        for leftover in (folder / part).glob(".*.tmp"):
            with suppress(OSError):
                leftover.unlink()


def _finish(plan: Plan, folder: Path) -> Dataset:
    """Sum up what the files say, in the plan's order. A worker that was killed and replaced may have left something."""
    _remove_leftovers(folder)
    entries, lines = [], []
    for task in plan.tasks:
        outcome = _done(folder, task)
        if outcome is None:
            raise GarmentcError(
                f"'{task.name}' was simulated elsewhere but is not here; all workers must see the same folder", folder
            )
        if outcome.reason:
            lines.append(json.loads(_note_path(folder, task).read_bytes()))
            continue
        entries.append(make_entry(folder, task.name, task.split))
        if outcome.accepted < outcome.frames:
            lines += _frame_notes(task, read_quality(sequence_path(folder, task.name)))
    write_file(folder / REJECTED_LIST, "".join(json.dumps(line) + "\n" for line in lines).encode())
    return write_manifest(folder, plan.preset.name, entries, plan=plan.document())


def _frame_notes(task: Task, quality: QualityTrack) -> Iterator[dict[str, Any]]:
    """One note for each run of frames that were rejected for the same reasons."""
    starts = np.flatnonzero(np.diff(quality.rejected.astype(np.int32), prepend=-1, append=-1))
    for first, after in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        if bits := int(quality.rejected[first]):
            reasons = [name for bit, name in enumerate(REASONS) if bits >> bit & 1]
            yield {"sequence": task.name, "reasons": reasons, "first_frame": first, "last_frame": after - 1}
