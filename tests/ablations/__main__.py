"""Train every ablation of DeePSD with the same budget and measure it: docs/ablations.md.

    PYTHONPATH=tests python -m ablations --data data/benchmark-v1 --runs runs/ablations [--only full]

Resumable: runs that are finished are only measured. On one core the training takes about an hour and a half.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import click

from ablations.table import ABLATIONS, Measured, markdown

CONFIGS = Path(__file__).parents[2] / "garmentc" / "training" / "configs"
DOCUMENT = Path(__file__).parents[2] / "docs" / "ablations.md"
FRAMES, WORKERS = 8, 2


@click.command()
@click.option("--data", type=click.Path(path_type=Path, exists=True), required=True, help="Dataset benchmark-v1.")
@click.option("--runs", type=click.Path(path_type=Path), required=True, help="Folder of the runs: made, or gone on in.")
@click.option("--only", multiple=True, help="Name of an ablation; repeatable. All by default.")
@click.option("--train/--no-train", default=True, help="Measure what is there, or train what is missing too.")
@click.option("-o", "--output", type=click.Path(path_type=Path), default=DOCUMENT, help="Markdown file.")
def main(data: Path, runs: Path, only: tuple[str, ...], train: bool, output: Path) -> None:
    """Train and measure the ablations."""
    chosen = [ablation for ablation in ABLATIONS if not only or ablation.name in only]
    if train:
        for ablation in chosen:
            command = [sys.executable, "-m", "garmentc", "train", "deepsd", "--data", str(data)]
            command += ["--config", ablation.config, "--out", str(runs / ablation.name), "--quiet"]
            subprocess.run(command, check=True)
    there = {ablation.name: runs / ablation.name for ablation in chosen if is_finished(runs / ablation.name)}
    output.write_text(markdown(measure(data, there)), encoding="utf-8")


def is_finished(run: Path) -> bool:
    """Whether a run has taken all its steps."""
    from garmentc.training.checkpoint import read_checkpoint

    checkpoint = read_checkpoint(run)
    return checkpoint is not None and checkpoint.progress.stage == 1 + (checkpoint.recipe.physics is not None)


def measure(data: Path, runs: dict[str, Path]) -> Measured:
    """The networks of all `runs` on the test split."""
    from garmentc.evaluation.dataset_evaluation import evaluate_dataset
    from garmentc.evaluation.group_scores import overall
    from garmentc.evaluation.method import NEAREST_METHOD, Method
    from garmentc.simulation.dataset import open_dataset
    from garmentc.training.run_log import LOG
    from garmentc.training.run_method import RunMethod

    methods: list[Method] = [NEAREST_METHOD, *(RunMethod(name=name, run=run) for name, run in runs.items())]
    dataset = open_dataset(data)
    rows = overall(evaluate_dataset(dataset, "test", methods, frames=FRAMES, workers=WORKERS))
    logs = {name: (run / LOG).read_text(encoding="utf-8") for name, run in runs.items()}
    return Measured(dataset.sha256, {row.method: row for row in rows}, logs)


if __name__ == "__main__":
    main()
