"""Plans carried out with a stand-in for physics: the same bytes whoever works, however often it is killed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from simulation_stand_in import fail_some, kill_first_worker, skinned_patch

import garmentc.simulation.dataset as dataset_module
from garmentc.errors import GarmentcError
from garmentc.output import cannot_write
from garmentc.simulation.plan import Plan, make_plan
from garmentc.simulation.presets import PRESETS
from garmentc.simulation.splits import SPLITS, leaks
from garmentc.simulation.task_graph import Outcome, Runner, run_plan

MOTION = Path(__file__).resolve().parents[1] / "examples" / "motions" / "step_turn_raise.npz"


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(PRESETS["small"], seed=3)


@pytest.fixture(scope="module")
def expected(plan: Plan, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("expected")
    run_plan(plan, folder, skinned_patch)
    return _files(folder)


def _files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_the_plan_depends_on_its_arguments_alone(plan: Plan) -> None:
    assert plan == make_plan(PRESETS["small"], seed=3)
    assert plan != make_plan(PRESETS["small"], seed=4)
    names = [task.name for task in plan.tasks]
    assert len(set(names)) == len(names)


def test_a_larger_plan_starts_with_the_smaller_one(plan: Plan) -> None:
    larger = make_plan(PRESETS["small"], seed=3, outfits=9)
    assert list(larger.tasks)[: len(list(plan.tasks))] == list(plan.tasks)


def test_benchmark_plan() -> None:
    plan = make_plan(PRESETS["benchmark-v1"])
    tasks = list(plan.tasks)
    assert len(plan.outfits) >= 120
    assert sum(outfit.held_out for outfit in plan.outfits) >= 24
    assert sum(motion.held_out for motion in plan.motions) == 3
    assert sum(task.motion.frames for task in tasks) >= 30_000
    assert leaks((task.outfit.name, task.motion.group, task.split) for task in tasks) == []
    assert {task.split for task in tasks} == set(SPLITS)
    categories = {outfit.parameters.category for outfit in plan.outfits if outfit.held_out}
    assert len(categories) >= 6
    assert {outfit.fabric for outfit in plan.outfits} == {"cotton", "silk", "denim", "leather"}


def test_tshirt_plan() -> None:
    plan = make_plan(PRESETS["tshirt"])
    styles = {(outfit.tshirt.sleeve, outfit.tshirt.ease) for outfit in plan.outfits if outfit.tshirt}
    bodies = {outfit.tshirt.betas for outfit in plan.outfits if outfit.tshirt}
    assert (len(styles), len(bodies), len(plan.outfits)) == (5, 9, 45)
    assert min(sum(task.motion.frames for task in plan.tasks_of(outfit)) for outfit in plan.outfits) >= 60


def test_motion_files_are_cut_into_stretches() -> None:
    plan = make_plan(PRESETS["small"], outfits=2, motion_files=[MOTION])
    assert {motion.group for motion in plan.motions} == {"step_turn_raise"}
    assert len(plan.motions) > 1
    assert all(motion.frames <= PRESETS["small"].frames for motion in plan.motions)
    assert not any(motion.held_out for motion in plan.motions), "the only motion cannot be held out"


def test_unreadable_motion(tmp_path: Path) -> None:
    (tmp_path / "walk.npz").write_bytes(b"no motion")
    with pytest.raises(GarmentcError, match=r"is not a whole \.npz file"):
        make_plan(PRESETS["small"], motion_files=[tmp_path / "walk.npz"])
    with pytest.raises(GarmentcError, match="two motion files are called 'step_turn_raise'"):
        make_plan(PRESETS["small"], motion_files=[MOTION, MOTION])


def test_unknown_category() -> None:
    with pytest.raises(GarmentcError, match="unknown category 'toga'; the categories are top, "):
        make_plan(PRESETS["small"], categories=["toga"])
    plan = make_plan(PRESETS["small"], categories=["skirt"])
    assert {outfit.parameters.category for outfit in plan.outfits} == {"skirt"}


def test_two_runs_are_alike(plan: Plan, expected: dict[str, bytes], tmp_path: Path) -> None:
    run_plan(plan, tmp_path, skinned_patch)
    assert _files(tmp_path) == expected


def test_two_workers_are_as_one(plan: Plan, expected: dict[str, bytes], tmp_path: Path) -> None:
    seen: list[Outcome] = []
    run_plan(plan, tmp_path, skinned_patch, Runner(workers=2), seen.append)
    assert _files(tmp_path) == expected
    assert sorted(outcome.name for outcome in seen) == sorted(task.name for task in plan.tasks)


def test_a_killed_worker_loses_nothing(
    plan: Plan, expected: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("KILL_ONCE", str(tmp_path / "mark"))
    run_plan(plan, tmp_path / "data", kill_first_worker, Runner(workers=2))
    assert (tmp_path / "mark").exists()
    assert _files(tmp_path / "data") == expected


_RUN = """
import sys
from pathlib import Path
from simulation_stand_in import slow_patch
from garmentc.simulation.plan import make_plan
from garmentc.simulation.presets import PRESETS
from garmentc.simulation.task_graph import Runner, run_plan
if __name__ == "__main__":
    run_plan(make_plan(PRESETS["small"], seed=3), Path(sys.argv[1]), slow_patch, Runner(int(sys.argv[2])))
"""


@pytest.mark.parametrize("workers", [1, 2])
def test_killed_and_resumed_is_as_if_nothing_happened(expected: dict[str, bytes], tmp_path: Path, workers: int) -> None:
    folder = tmp_path / "data"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    command = [sys.executable, "-c", _RUN, str(folder), str(workers)]
    killed = 0
    for attempt in range(20):
        done = len(list(folder.glob("sequences/*.npz")))
        process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE)
        while killed < 5 and process.poll() is None and len(list(folder.glob("sequences/*.npz"))) < done + 1:
            time.sleep(0.005)
        if killed < 5 and process.poll() is None:
            time.sleep(0.02 * attempt)
            process.send_signal(signal.SIGKILL)
            killed += 1
        _, errors = process.communicate(timeout=120)
        if process.returncode == 0:
            break
        assert process.returncode == -signal.SIGKILL, errors.decode()
    assert killed >= 3
    assert _files(folder) == expected


def test_leftovers_of_a_kill_are_removed(plan: Plan, expected: dict[str, bytes], tmp_path: Path) -> None:
    (tmp_path / "sequences").mkdir()
    (tmp_path / "sequences" / ".outfit0000.walk000.npz.123.tmp").write_bytes(b"half")
    run_plan(plan, tmp_path, skinned_patch)
    assert _files(tmp_path) == expected


def test_bad_outfits_stop_nothing(tmp_path: Path) -> None:
    plan = make_plan(PRESETS["small"], seed=3, outfits=7)
    seen: list[Outcome] = []
    made = run_plan(plan, tmp_path, fail_some, Runner(), seen.append)
    assert {entry.outfit for entry in made.entries} == {"outfit0000", "outfit0005", "outfit0006"}
    notes = [json.loads(line) for line in (tmp_path / "rejected.jsonl").read_text().splitlines()]
    said = {note["outfit"]: (note["reason"], note["detail"]) for note in notes if "outfit" in note}
    assert said == {
        "outfit0001": ("explosion", "frame 7: a vertex moved by 12 m"),
        "outfit0002": ("failed", "ZeroDivisionError: division by zero"),
        "outfit0003": ("failed", "ValueError: vertices hold NaN or infinity"),
        "outfit0004": ("frames", "no frame passed the quality gate: jump 12"),
    }
    assert [note for note in notes if note["sequence"].startswith("outfit0005")] == [
        {"sequence": name, "reasons": ["stretch"], "first_frame": 4, "last_frame": 4}
        for name in (entry.name for entry in made.entries if entry.outfit == "outfit0005")
    ]
    assert sum(bool(outcome.reason) for outcome in seen) == 8
    before = _files(tmp_path)
    run_plan(plan, tmp_path, _must_not_run)
    assert _files(tmp_path) == before, "what is rejected stays rejected"


def _must_not_run(task: object) -> None:
    raise AssertionError("nothing was missing")


def test_more_outfits_are_appended(plan: Plan, expected: dict[str, bytes], tmp_path: Path) -> None:
    run_plan(plan, tmp_path, skinned_patch)
    larger = make_plan(PRESETS["small"], seed=3, outfits=7)
    made = run_plan(larger, tmp_path, skinned_patch)
    assert len(made.entries) == 14
    kept = {name: data for name, data in expected.items() if name.startswith("sequences/")}
    assert kept.items() <= _files(tmp_path).items()
    with pytest.raises(GarmentcError, match=r"holds another dataset \(fewer outfits\)"):
        run_plan(plan, tmp_path, skinned_patch)
    with pytest.raises(GarmentcError, match=r"holds another dataset \(motions, seed\); give the options"):
        run_plan(make_plan(PRESETS["small"], seed=4, outfits=7), tmp_path, skinned_patch)


def test_a_full_disk_stops_the_run_and_is_no_rejection(
    plan: Plan, expected: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, written = dataset_module.write_file, []

    def full_after_three(path: Path, data: bytes) -> None:
        if len(written) == 3:
            raise cannot_write(path, OSError(28, "No space left on device"))
        written.append(path)
        real(path, data)

    with monkeypatch.context() as patched:
        patched.setattr("garmentc.simulation.task_graph.write_file", full_after_three)
        with pytest.raises(GarmentcError, match="the disk is full; free some space"):
            run_plan(plan, tmp_path, skinned_patch)
    assert not list((tmp_path / "rejected").iterdir())
    run_plan(plan, tmp_path, skinned_patch)
    assert _files(tmp_path) == expected


def test_a_folder_that_cannot_be_made(plan: Plan, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(GarmentcError, match="its folder is a file"):
        run_plan(plan, tmp_path / "file" / "data", skinned_patch)


def test_no_scheduler(plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("garmentc.simulation.task_runners.CONNECT_SECONDS", 0.5)
    with pytest.raises(GarmentcError, match=r"no Dask scheduler answers at 'tcp://127\.0\.0\.1:9'"):
        run_plan(plan, tmp_path, skinned_patch, Runner(scheduler="tcp://127.0.0.1:9"))


def test_a_dask_cluster_gives_the_same_and_survives_a_killed_worker(
    plan: Plan, expected: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = pytest.importorskip("distributed")
    monkeypatch.setenv("KILL_ONCE", str(tmp_path / "mark"))
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster:
        run_plan(plan, tmp_path / "data", kill_first_worker, Runner(scheduler=cluster.scheduler_address))
    assert (tmp_path / "mark").exists()
    assert _files(tmp_path / "data") == expected
