"""What training reads: several datasets, nothing that one of them holds out, edges."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulation_stand_in import skinned_patch
from train_samples import swinging_patches

from garmentc.errors import GarmentcError
from garmentc.simulation.dataset import Dataset
from garmentc.simulation.plan import make_plan
from garmentc.simulation.presets import PRESETS
from garmentc.simulation.task_graph import run_plan

pytest.importorskip("torch")


from garmentc.training.data_stage import drawn_edges
from garmentc.training.recipe import DataStage, Recipe
from garmentc.training.simulated_outfits import read_outfits
from garmentc.training.training_data import read_training_data

RECIPE = Recipe(DataStage(10))
WARDROBE = replace(PRESETS["wardrobe-v1"], walks=2, frames=6)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return swinging_patches(tmp_path_factory.mktemp("data"))


def wardrobe(folder: Path, seed: int) -> Dataset:
    return run_plan(make_plan(WARDROBE, seed=seed, outfits=5), folder, skinned_patch)


def test_several_datasets_are_learned_from_together(dataset: Dataset, tmp_path: Path) -> None:
    more = wardrobe(tmp_path, seed=3)
    one = read_training_data([dataset], RECIPE, "test")
    both = read_training_data([dataset, more], RECIPE, "test")
    assert len(more.of_split("train")) == len(more.entries) == 5  # a wardrobe holds nothing out
    assert len(both.outfits) == len(one.outfits) + 5
    assert len(both.held_out) == len(one.held_out) == 1
    assert one.facts.sha256 == dataset.sha256
    assert both.facts.name == f"{dataset.name} + {more.name}"
    assert len({one.facts.sha256, both.facts.sha256, more.sha256}) == 3


def test_what_a_dataset_holds_out_is_not_learned_from_another(dataset: Dataset, tmp_path: Path) -> None:
    held_out = next(dataset.sequences("test")).template
    more = run_plan(make_plan(WARDROBE, seed=1, outfits=5), tmp_path, skinned_patch)
    assert any(np.array_equal(outfit.template, held_out) for outfit in more.sequences("train"))
    with pytest.raises(GarmentcError, match=r"holds out the outfit .* simulate that one with another --seed"):
        read_training_data([dataset, more], RECIPE, "test")


def test_drawn_edges_are_edges_between_drawn_vertices(dataset: Dataset) -> None:
    sample = read_outfits(dataset, "train")[0].sample
    rows, edges, lengths = drawn_edges(sample, 16, np.random.default_rng(3))
    assert len(edges) == 8
    assert len(rows) <= 16
    known = {tuple(sorted(edge)) for edge in sample.edges.tolist()}
    assert {tuple(sorted(edge)) for edge in rows[edges.numpy()].tolist()} <= known
    ends = sample.vertices[rows][edges]
    np.testing.assert_allclose(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1), lengths, rtol=1e-5)
