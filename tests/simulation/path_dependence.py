"""How much of the cloth is not a function of pose: the same poses reached the other way round.

    PYTHONPATH=tests python -m simulation.path_dependence ~/garmentc-data/benchmark-v1 --split test --every 3

Every so many sequences are simulated again with their motion backwards, and each frame is compared with the recorded
one of the same pose. Nothing that knows only outfit and pose can be nearer to both than half of their distance, on
average: a floor for the error of every method without memory, networks that make glTF files among them. Half a minute
of CPU a sequence.
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from garmentc.simulation.cloth_simulator import Cloth, simulate
from garmentc.simulation.dataset import open_dataset
from garmentc.simulation.fabrics import FABRICS
from garmentc.simulation.motion_preparation import PreparationOptions, way_in
from garmentc.simulation.pins import pin, worn_tight
from garmentc.simulation.plan import Task, make_plan
from garmentc.simulation.presets import PRESETS
from garmentc.simulation.sequence import Sequence
from garmentc.simulation.simulate_task import SETTINGS, make_outfit
from garmentc.smpl.default_body import load_default_body


@click.command()
@click.argument("folder", type=click.Path(path_type=Path, exists=True))
@click.option("--split", default="test", show_default=True)
@click.option("--every", default=3, show_default=True, help="Take one in so many sequences.")
@click.option("--frames", default=64, show_default=True, help="Of each sequence, from its start.")
def main(folder: Path, split: str, every: int, frames: int) -> None:
    """Print the floor for each sequence and their mean, mm."""
    dataset = open_dataset(folder)
    preset = PRESETS[dataset.plan["preset"]]
    tasks = {task.name: task for task in make_plan(preset, dataset.plan["seed"], dataset.plan["outfits"]).tasks}
    floors = []
    for entry in dataset.of_split(split)[::every]:
        sequence = dataset.sequence(entry)
        floors.append(floor_mm(tasks[entry.name], sequence, frames))
        click.echo(f"{entry.name}  {sequence.facts.category}  {sequence.facts.fabric}  {floors[-1]:.2f}")
    click.echo(f"mean of {len(floors)} sequences: {np.mean(floors):.2f} mm")


def floor_mm(task: Task, sequence: Sequence, frames: int) -> float:
    """Half the mean distance between the recorded frames and those of the motion backwards."""
    good = sequence.quality.accepted[:frames]
    backwards = simulated(task, sequence.poses[:frames][::-1], sequence.trans[:frames][::-1])[::-1]
    return float(500 * np.linalg.norm(backwards - sequence.vertices[:frames], axis=-1)[good].mean())


def simulated(task: Task, poses: NDArray[np.float32], trans: NDArray[np.float32]) -> NDArray[np.float32]:
    """The task's outfit in `poses` (T, 24, 3) at `trans` (T, 3), way in from rest before them: vertices (T, N, 3)."""
    parameters = task.outfit.parameters
    body, betas = load_default_body(parameters.gender), np.asarray(parameters.betas)
    outfit, _ = make_outfit(task.outfit)
    rest = body.shaped(betas)
    pins = pin(outfit.vertices, worn_tight(outfit), rest, body.faces, SETTINGS.clearance)
    way_poses, way_trans = way_in(poses[0].astype(np.float64), trans[0].astype(np.float64), PreparationOptions())
    bodies = body.posed(np.concatenate([way_poses, poses]), betas, np.concatenate([way_trans, trans]))
    cloth = Cloth(outfit.vertices, outfit.triangles, FABRICS[task.outfit.fabric], pins)
    return simulate(cloth, rest, bodies, body.faces, SETTINGS).frames[len(way_poses) :]


if __name__ == "__main__":
    main()
