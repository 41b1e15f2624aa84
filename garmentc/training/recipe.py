"""A training recipe: what a configuration file says (schemas/train.schema.json), as frozen dataclasses."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from garmentc.errors import GarmentcError
from garmentc.schema import check_schema
from garmentc.training.deepsd_network import BLEND_SHAPES, DeepsdConfig
from garmentc.training.metadata import metadata_width

CONFIGS = Path(__file__).with_name("configs")
"""The recipes that come with garmentc: the shipped bundle's and one for each ablation."""


@dataclass(frozen=True)
class Optimisation:
    """How a stage is optimised: Adam, a learning rate that follows half a cosine, growing batches.

    steps             of the optimiser
    outfits_per_step  for each equal part of the steps; their gradients are accumulated
    poses             of each outfit
    clip              largest norm of the gradient
    """

    steps: int
    outfits_per_step: tuple[int, ...] = (1,)
    poses: int = 24
    learning_rate: float = 1e-3
    final_learning_rate: float = 3e-5
    weight_decay: float = 0.0
    clip: float = 50.0


@dataclass(frozen=True)
class DataStage(Optimisation):
    """Stage A: Φ, Ω, Ψ and the pose MLP learn the simulated vertices (equation 3).

    loss               "distance": mean distance in mm, what is measured in the end; "squared": mean squared, mm²
    vertices           of an outfit that are compared, drawn anew each time; 0: all
    edge               on the mean change of edge lengths from those at rest, mm: what blend weights and Ψ stretch, χ
                       can hardly mend
    prior_share        of the steps in which the two priors hold; each falls to a tenth in them (section 9)
    weight_prior       on the cross-entropy of W and the weights of the nearest skin; the paper's squared
                       difference hardly moves a softmax that is sure of a wrong joint
    deformation_prior  on squared deformations, mm²; too low, deformations learn what blend weights should
    influences         one is drawn for each outfit: skinning uses the largest so many weights, as assets do
    dropout            share of the descriptors' channels that a batch does without, against learning outfits by heart
    metadata_dropout   share of outfits whose metadata are withheld, so that the network also does without
    """

    outfits_per_step: tuple[int, ...] = (1, 2, 4)
    loss: str = "distance"
    vertices: int = 1024
    edge: float = 0.0
    prior_share: float = 0.1
    weight_prior: float = 100.0
    deformation_prior: float = 1.0
    influences: tuple[int, ...] = (4, 4, 8, 24)
    dropout: float = 0.0
    metadata_dropout: float = 0.25


@dataclass(frozen=True)
class PhysicsStage(Optimisation):
    """Stage B: χ alone learns cloth consistency and clearance (equations 4 to 6); losses are in mm².

    poses         of which half are simulated ones and half drawn at random, where both are wanted
    bodies        posed bodies kept for each outfit, of simulated poses
    random_bodies of random ones, combinations that were never simulated; 0: none
    epsilon       metres of clearance asked for (the paper's)
    surface       clearance from the exact closest point of the body's surface, not from its nearest vertex: slower
    """

    poses: int = 12
    bodies: int = 24
    random_bodies: int = 24
    edge: float = 2.0
    bend: float = 5.0
    collision: float = 5.0
    deformation: float = 0.03
    epsilon: float = 0.005
    surface: bool = False
    influences: tuple[int, ...] = (4, 4, 8)


@dataclass(frozen=True)
class Recipe:
    """Everything that a trained network follows from, beside the data.

    description    of the bundle, one sentence
    mirror         half of the batches are left-right mirrored
    metadata       of METADATA: what the network is told about an outfit beside its mesh
    physics        None: without χ
    validation     outfits of the training split that are measured in place of held-out ones and not learned from:
                   for choosing a recipe without looking at what is held out
    rigid_outfits  shoes, hats, bands and gloves mixed in, see `garmentc.training.rigid_outfits`
    measure_every  steps between measurements on held-out outfits, which nothing depends on; 0: only at the end
    """

    data: DataStage
    physics: PhysicsStage | None = None
    network: DeepsdConfig = field(default_factory=DeepsdConfig)
    seed: int = 0
    description: str = "DeePSD trained on simulated outfits."
    mirror: bool = True
    metadata: tuple[str, ...] = ()
    validation: int = 0
    rigid_outfits: int = 0
    measure_every: int = 1000

    def document(self) -> dict[str, Any]:
        """As JSON values."""
        plain: dict[str, Any] = json.loads(json.dumps(asdict(self)))
        return plain


def read_recipe(path: Path) -> Recipe:
    """The recipe in a TOML file; what it leaves out has its default.

    Raises GarmentcError where the file is missing, is no TOML or does not follow the schema.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        names = ", ".join(sorted(file.stem for file in CONFIGS.glob("*.toml")))
        raise GarmentcError(f"no such file; the recipes in {CONFIGS.name}/ are {names}", path) from None
    except (OSError, UnicodeDecodeError) as error:
        raise GarmentcError(f"cannot be read: {error}", path) from None
    except tomllib.TOMLDecodeError as error:
        raise GarmentcError(f"is no TOML: {error}", path) from None
    check_schema(document, "train", path)
    recipe = recipe_of(document)
    if recipe.physics is not None and recipe.network.deformation != BLEND_SHAPES:
        raise GarmentcError(
            f"physics needs blend shapes, not deformation = '{recipe.network.deformation}'; leave [physics] out", path
        )
    return recipe


def recipe_of(document: Mapping[str, Any]) -> Recipe:
    """The recipe that `Recipe.document` or a checked file describes."""
    plain = {name: _tuples(value) for name, value in document.items()}
    network = plain.get("network", {}) | {"metadata_width": metadata_width(plain.get("metadata", ()))}
    plain["network"] = DeepsdConfig(**network)
    plain["data"] = DataStage(**plain["data"])
    if plain.get("physics") is not None:
        plain["physics"] = PhysicsStage(**plain["physics"])
    return Recipe(**plain)


def _tuples(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _tuples(inner) for name, inner in value.items()}
    return tuple(value) if isinstance(value, list) else value


def differences(ours: Recipe, theirs: Recipe) -> list[str]:
    """Names of the entries in which two recipes differ, such as "data.steps"."""
    found = []
    for entry in fields(Recipe):
        a, b = getattr(ours, entry.name), getattr(theirs, entry.name)
        if a == b:
            continue
        inner = fields(a) if hasattr(a, "__dataclass_fields__") and type(a) is type(b) else ()
        names = [f.name for f in inner if getattr(a, f.name) != getattr(b, f.name)]
        found += [f"{entry.name}.{name}" for name in names] or [entry.name]
    return found
