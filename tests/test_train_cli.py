"""`garmentc train`: stopped, resumed, exported, and measured as the evaluation measures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from train_samples import swinging_patches

from garmentc.cli import main
from garmentc.cli.exit_codes import EXIT_CLEAN, EXIT_FAILURE
from garmentc.families.bundle import load_bundle
from garmentc.simulation.dataset import Dataset
from garmentc.simulation.sequence import Sample
from garmentc.smpl.default_body import load_default_body

pytest.importorskip("torch")

RECIPE = """
metadata = ["fabric"]
[data]
steps = 6
poses = 6
[physics]
steps = 2
poses = 3
bodies = 2
random_bodies = 1
[network]
convolutions = [8, 16]
keys = 12
shape_head = [16]
weight_head = [16]
"""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return swinging_patches(tmp_path_factory.mktemp("data"), outfits=2)


@pytest.fixture(scope="module")
def run(dataset: Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    (folder / "recipe.toml").write_text(RECIPE)
    assert train(dataset, folder / "recipe.toml", folder / "out") == EXIT_CLEAN
    return folder / "out"


def train(dataset: Dataset, config: Path, out: Path, *options: str) -> int:
    known = ["--data", str(dataset.folder), "--config", str(config), "--out", str(out), "--measure", "test_motions"]
    return main(["train", "deepsd", *known, *options])


def test_a_time_limit_stops_cleanly_and_the_same_command_goes_on(
    dataset: Dataset, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sessions = 0
    while not (tmp_path / "bundle").exists():
        assert train(dataset, run.parent / "recipe.toml", tmp_path, "--time-limit", "0") == EXIT_CLEAN
        sessions += 1
    assert sessions == 7, "each takes a step; the last of a stage is followed by the next"
    assert "the same command goes on" in capsys.readouterr().out
    for name in ("outfit.onnx", "keys.onnx"):
        assert (tmp_path / "bundle" / name).read_bytes() == (run / "bundle" / name).read_bytes()


def test_another_recipe_is_refused_at_once_and_nothing_is_lost(
    dataset: Dataset, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "recipe.toml").write_text(RECIPE.replace("steps = 6", "steps = 7"))
    before = (run / "checkpoint.pt").read_bytes()
    monkeypatch.setattr("garmentc.training.training_data.read_training_data", None)  # data would take minutes
    assert train(dataset, tmp_path / "recipe.toml", run) == EXIT_FAILURE
    assert "another recipe (data.steps differ)" in capsys.readouterr().err
    assert (run / "checkpoint.pt").read_bytes() == before


def test_bundles_say_how_they_were_made(dataset: Dataset, run: Path) -> None:
    training = load_bundle(run / "bundle").manifest["training"]
    assert training["data"]["sha256"] == dataset.sha256
    assert training["recipe"]["data"]["steps"] == 6
    assert training["finished"] is True
    assert training["held_out"]["physics"]["error_mm"] > 0
    assert load_bundle(run / "bundle").metadata == ("fabric:cotton", "fabric:silk", "fabric:denim", "fabric:leather")


def test_export(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["train", "export", str(run), "-o", str(tmp_path), "--version", "9"]) == EXIT_CLEAN
    assert load_bundle(tmp_path).name == "garmentc-deepsd 9"
    assert (tmp_path / "outfit.onnx").read_bytes() == (run / "bundle" / "outfit.onnx").read_bytes()
    assert main(["train", "export", str(tmp_path), "-o", str(tmp_path / "again")]) == EXIT_FAILURE
    assert "no training run" in capsys.readouterr().err


def test_the_log_is_readable_by_tensorboard(run: Path) -> None:
    pytest.importorskip("tensorboardX")
    (events,) = (run / "tensorboard").iterdir()
    assert b"data/loss" in events.read_bytes()
    assert b"physics/error_mm" in events.read_bytes()
    assert [json.loads(line)["stage"] for line in (run / "log.jsonl").read_text().splitlines()] == [
        "data",
        "data",
        "physics",
        "physics",
    ]


def test_a_run_is_a_method_of_the_evaluation(dataset: Dataset, run: Path) -> None:
    from garmentc.families import deepsd
    from garmentc.families.held_cloth import held_cloth
    from garmentc.outfit.topology import edges, vertex_normals
    from garmentc.rig import Rig
    from garmentc.training.run_method import run_method

    sequence = next(dataset.sequences("train"))
    body = load_default_body(sequence.facts.gender)
    posed = run_method(run).posed_template(sequence, body, None)(Sample(sequence, 3))
    bundle = load_bundle(run / "bundle")
    template, faces = sequence.template, sequence.faces
    joints = body.joints(sequence.betas.astype(np.float64))
    cloth = held_cloth(template, edges(faces), body, sequence.betas.astype(np.float64))
    rig = deepsd.infer(
        bundle, template, vertex_normals(template, faces), faces, edges(faces), joints, cloth, sequence.facts.fabric
    )
    four = np.where(rig.weights >= np.sort(rig.weights, axis=1)[:, -4:-3], rig.weights, 0)
    four /= four.sum(axis=1, keepdims=True)
    pruned = Rig(rig.template, rig.triangles, rig.joints, four, rig.blend_shapes, rig.keys)
    np.testing.assert_allclose(posed, pruned.posed(sequence.poses[3]), atol=2e-5)


def test_wrong_data_and_recipes_are_one_line(
    dataset: Dataset, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert train(dataset, tmp_path / "none.toml", tmp_path) == EXIT_FAILURE
    assert "no such file" in capsys.readouterr().err
    (tmp_path / "recipe.toml").write_text(RECIPE.replace("fabric", "tightness"))
    assert train(dataset, tmp_path / "recipe.toml", tmp_path) == EXIT_FAILURE
    assert "has no tightness" in capsys.readouterr().err
    assert (
        main(["train", "deepsd", "--data", str(tmp_path), "--config", "deepsd", "--out", str(tmp_path)]) == EXIT_FAILURE
    )
    assert "is no dataset" in capsys.readouterr().err


def test_rigid_outfits_move_with_the_skin(dataset: Dataset) -> None:
    from garmentc.smpl.nearest import nearest_vertex
    from garmentc.training.rigid_outfits import rigid_outfits
    from garmentc.training.simulated_outfits import read_outfits

    simulated = read_outfits(dataset, "train", ["fabric"])
    alone, together = rigid_outfits(2, simulated, seed=1)
    count = len(simulated[1].sample.vertices)
    assert together.sample.name.startswith(simulated[1].sample.name + "+")
    every = np.arange(len(together))
    np.testing.assert_allclose(together.targets(every)[:, :count], simulated[1].targets(every), atol=1e-6)
    body = alone.sample.body
    near = nearest_vertex(alone.sample.vertices.numpy(), body.vertices)
    posed = body.posed(alone.poses, body.transforms(alone.poses))[:, near]
    rest = np.linalg.norm(alone.sample.vertices.numpy() - body.vertices[near], axis=1)
    moved = np.linalg.norm(alone.targets(np.arange(len(alone))) - posed, axis=2)
    assert np.abs(moved - rest).mean() < 0.004
