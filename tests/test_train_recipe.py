"""Recipes: those that come with garmentc, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

from garmentc.errors import GarmentcError

pytest.importorskip("torch")

from garmentc.training.deepsd_network import Deepsd
from garmentc.training.recipe import CONFIGS, differences, read_recipe, recipe_of

OWN = sorted(CONFIGS.glob("*.toml"))


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.stem)
def test_own_recipes_are_sound(path: Path) -> None:
    recipe = read_recipe(path)
    assert recipe_of(recipe.document()) == recipe, "as a checkpoint keeps it"
    Deepsd(recipe.network)


def test_ablations_have_the_same_budget_and_change_one_thing() -> None:
    full = read_recipe(CONFIGS / "ablation_full.toml")
    ablations = [path for path in OWN if path.stem.startswith("ablation_")]
    assert len(ablations) >= 12
    for path in ablations:
        changed = set(differences(full, read_recipe(path))) - {"description", "network.metadata_width"}
        assert changed <= {"physics"} or len(changed) == 1 or path.stem == "ablation_baseline_local", (path, changed)
        assert read_recipe(path).data.steps == full.data.steps


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[data]\nsteps = 0\n", "data.steps"),
        ("[data]\nsteps = 1\nstep = 2\n", "data"),
        ("[data\n", "no TOML.*line 1"),
        ("seed = 1\n", "data"),
        ("metadata = ['colour']\n[data]\nsteps = 1\n", "metadata"),
        ("[network]\ndeformation = 'none'\n[data]\nsteps = 1\n[physics]\nsteps = 1\n", "leave .physics. out"),
    ],
)
def test_wrong_recipes_are_refused(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "recipe.toml"
    path.write_text(text)
    with pytest.raises(GarmentcError, match=message) as caught:
        read_recipe(path)
    assert caught.value.file == path


def test_a_missing_recipe_names_those_there_are(tmp_path: Path) -> None:
    with pytest.raises(GarmentcError, match="deepsd"):
        read_recipe(tmp_path / "other.toml")
