"""What goes wrong in a simulation run: it is said clearly, contained, and costs nothing that was finished."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cli_samples import CommandLine

from garmentc.errors import GarmentcError
from garmentc.simulation import simulate_task as module
from garmentc.simulation.dataset import write_file
from garmentc.simulation.motion_preparation import PreparedMotion
from garmentc.simulation.outfits import GeneratedOutfit
from garmentc.simulation.plan import Plan, Task, make_plan
from garmentc.simulation.presets import SMALL
from garmentc.simulation.simulate_task import simulate_task
from garmentc.simulation.task_graph import RejectedSequence, run_plan
from garmentc.smpl.motion import Motion

_SIGNALLED_WHILE_IT_SIMULATES = """
import os, sys
from garmentc.cli import main
from garmentc.simulation import newton_cloth, task_graph

newton_cloth.import_newton = lambda: None
task_graph.run_plan = lambda *_: os.kill(os.getpid(), int(sys.argv[1]))
sys.exit(main(["simulate", "--workers", "1", "--out", sys.argv[2]]))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_an_interrupted_run_says_that_it_goes_on(tmp_path: Path, number: signal.Signals) -> None:
    def listen() -> None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    command = [sys.executable, "-c", _SIGNALLED_WHILE_IT_SIMULATES, str(int(number)), str(tmp_path / "data")]
    result = subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=listen)
    assert result.returncode == 128 + number
    said = "interrupted; what is finished stays, and the same command goes on with the rest"
    assert result.stderr == f"garmentc: error: {said}\n"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--category", "trouser"], "unknown category 'trouser'; the categories are top, "),
        (["--preset", "huge"], "unknown preset 'huge'; the presets are benchmark-v1, "),
        (["--motion", "absent.bvh"], "absent.bvh: cannot be read: No such file or directory"),
        (["--motion", "damaged.bvh"], "damaged.bvh: is not a BVH file"),
        (["--motion", "damaged.npz"], "damaged.npz: is not a whole .npz file"),
        (["--motion", "damaged.txt"], "unknown kind of motion '.txt'; use .npz"),
        (["--outfits", "0"], "0 is not in the range x>=1"),
        ([], "give a folder for the dataset: --out DIR"),
    ],
)
def test_mistakes_on_the_command_line(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    for suffix in ("bvh", "npz", "txt"):
        Path(f"damaged.{suffix}").write_text("nothing of the kind")
    place = ["--out", "data"] if arguments else []
    result = CommandLine(capsys)("simulate", *place, *arguments)
    assert result.code == 2
    assert said in result.err
    assert not Path("data").exists(), "mistakes are found before anything is written"


def test_a_file_where_the_dataset_should_be(tmp_path: Path) -> None:
    place = tmp_path / "data"
    place.write_text("a file")
    with pytest.raises(GarmentcError, match="is a file, and a dataset is a folder; name another place"):
        run_plan(make_plan(SMALL, outfits=1), place, simulate_task)
    assert place.read_text() == "a file"


def impossible(plan: Plan) -> Task:
    """A task whose outfit is a skirt so short that nothing is left of it."""
    task = next(plan.tasks)
    garment = replace(task.outfit.parameters.garments[0], kind="skirt", length=-1.0)
    return replace(task, outfit=replace(task.outfit, parameters=replace(task.outfit.parameters, garments=(garment,))))


def test_impossible_parameters_reject_the_outfit() -> None:
    with pytest.raises(RejectedSequence, match=r"a garment \(skirt\) has no surface; its hems leave nothing"):
        simulate_task(impossible(make_plan(SMALL, outfits=1, categories=["skirt"])))


def test_an_explosion_rejects_the_sequence(monkeypatch: pytest.MonkeyPatch) -> None:
    task = next(make_plan(SMALL, outfits=1).tasks)
    rag = GeneratedOutfit(
        np.eye(3), np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32), ("top",), task.outfit.parameters
    )
    still = PreparedMotion(Motion("still", np.zeros((2, 24, 3)), np.zeros((2, 3)), 30.0), 0, np.ones(2, bool), 0.0, 0)

    def explode(*_: object) -> None:
        raise GarmentcError("the cloth exploded in frame 1 of 2: 3 of 3 vertices left the scene; use more substeps")

    monkeypatch.setattr(module, "make_outfit", lambda _: (rag, None))
    monkeypatch.setattr(module, "prepared_motion", lambda *_: still)
    monkeypatch.setattr(module, "simulate", explode)
    with pytest.raises(RejectedSequence) as rejected:
        simulate_task(task)
    assert rejected.value.reason == "simulation"
    assert rejected.value.detail.startswith("the cloth exploded in frame 1 of 2")


def test_files_are_on_the_disk_before_they_get_their_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[tuple[int, int]] = []
    sync, rename = os.fsync, Path.replace

    def noted(descriptor: int) -> None:
        sync(descriptor)
        status = os.fstat(descriptor)
        synced.append((status.st_ino, status.st_size))

    def renamed(self: Path, target: Path) -> Path:
        status = self.stat()
        assert synced == [(status.st_ino, status.st_size)], "all of it is on the disk"
        return rename(self, target)

    monkeypatch.setattr(os, "fsync", noted)
    monkeypatch.setattr(Path, "replace", renamed)
    write_file(tmp_path / "sequence.npz", b"all of it")
    assert (tmp_path / "sequence.npz").read_bytes() == b"all of it"
    assert synced[0][1] == len(b"all of it")
