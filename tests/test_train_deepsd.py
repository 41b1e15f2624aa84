"""Training DeePSD on a tiny dataset: it learns, can be stopped anywhere and shared, and leaves a bundle."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulation_stand_in import skinned_patch
from train_samples import SMALL_NETWORK, swinging_patches

from garmentc.errors import GarmentcError
from garmentc.families import deepsd
from garmentc.families.bundle import load_bundle
from garmentc.families.held_cloth import held_cloth
from garmentc.outfit.topology import edges, vertex_normals
from garmentc.simulation.dataset import Dataset
from garmentc.simulation.plan import make_plan
from garmentc.simulation.presets import PRESETS
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.pose_sampler import sample_poses

torch = pytest.importorskip("torch")

from garmentc.training.bundle_record import export_run, has_bundle  # noqa: E402
from garmentc.training.checkpoint import Checkpoint, DataFacts, read_checkpoint  # noqa: E402
from garmentc.training.deepsd_network import Deepsd, DeepsdConfig  # noqa: E402
from garmentc.training.metadata import encode_metadata  # noqa: E402
from garmentc.training.outfit_sample import PosableBody, make_sample  # noqa: E402
from garmentc.training.predict import mean_error_mm, poser  # noqa: E402
from garmentc.training.recipe import DataStage, PhysicsStage, Recipe, read_recipe, recipe_of  # noqa: E402
from garmentc.training.simulated_outfits import (  # noqa: E402
    SimulatedOutfit,
    read_outfits,
    simulated_outfit,
    validation_split,
)
from garmentc.training.stage import Progress  # noqa: E402
from garmentc.training.train_deepsd import train  # noqa: E402

DATA = DataFacts("tiny", "0" * 64, 4, 44)


def recipe(steps: int = 12, physics: int = 4, **changes: object) -> Recipe:
    values = {
        "data": DataStage(steps, outfits_per_step=(1, 2), poses=6, vertices=20, prior_share=0.3),
        "physics": PhysicsStage(physics, outfits_per_step=(2,), poses=3, bodies=3, random_bodies=1)
        if physics
        else None,
        "network": DeepsdConfig(**SMALL_NETWORK),  # type: ignore[arg-type]
        "measure_every": 5,
        **changes,
    }
    return Recipe(**values)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return swinging_patches(tmp_path_factory.mktemp("data"))


@pytest.fixture(scope="module")
def outfits(dataset: Dataset) -> list[SimulatedOutfit]:
    return read_outfits(dataset, "train")


@pytest.fixture(scope="module")
def finished(outfits: list[SimulatedOutfit], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a few steps, both stages."""
    folder = tmp_path_factory.mktemp("run")
    assert train(recipe(), outfits, outfits[:1], DATA, folder).finished
    return folder


def weights_of(network: torch.nn.Module) -> torch.Tensor:
    return torch.cat([parameter.detach().flatten() for parameter in network.parameters()])


def after_steps(count: int) -> Callable[[], bool]:
    """True when asked for the `count`-th time."""
    asked = iter(range(1, count))
    return lambda: next(asked, None) is None


def test_targets_are_what_skinning_aims_at() -> None:
    """The patch is skin, 1 mm of noise and pose correctives: the body's weights pose it right, wherever it walks."""
    sequence = skinned_patch(next(make_plan(PRESETS["small"], seed=1, outfits=1).tasks))
    body = load_default_body(sequence.facts.gender)
    outfit = simulated_outfit(sequence, (), body)
    good = sequence.quality.accepted
    assert len(outfit) == good.sum() < len(sequence)
    every = np.arange(len(outfit))
    moved = sequence.vertices[good] - sequence.trans[good, None]
    np.testing.assert_allclose(outfit.targets(every), moved, atol=4e-5)
    np.testing.assert_array_equal(outfit.targets(every[2:5], np.array([7, 3])), outfit.targets(every)[2:5][:, [7, 3]])
    found = poser(skinning_of(outfit), outfit.sample)(outfit.poses)
    distance = np.linalg.norm(found - outfit.targets(every), axis=-1)
    assert distance.mean() < 0.005


def skinning_of(outfit: SimulatedOutfit) -> Deepsd:
    """A network whose blend weights are the outfit's prior and that deforms nothing."""
    network = Deepsd(DeepsdConfig(**SMALL_NETWORK, deformation="none"))  # type: ignore[arg-type]
    network.blend_weights = lambda descriptors: outfit.sample.skin  # type: ignore[method-assign]
    return network


def test_sequences_of_one_outfit_are_one_outfit(dataset: Dataset, outfits: list[SimulatedOutfit]) -> None:
    known = dataset.of_split("train")
    assert len(outfits) == len({entry.outfit for entry in known})
    assert sum(map(len, outfits)) == sum(entry.accepted for entry in known)


def test_learns_what_skinning_alone_cannot(outfits: list[SimulatedOutfit], tmp_path: Path) -> None:
    settings = DataStage(300, poses=12, vertices=0, learning_rate=3e-3, outfits_per_step=(1,), prior_share=0.6)
    longer = recipe(data=settings, physics=None, measure_every=0, mirror=False)
    trained = train(longer, outfits, [], DATA, tmp_path / "shapes")
    skinned = replace(longer, network=replace(longer.network, deformation="none"))
    rigid = train(skinned, outfits, [], DATA, tmp_path / "skinning")
    nearest = float(np.mean([mean_error_mm(skinning_of(outfit), [outfit]) for outfit in outfits]))
    errors = mean_error_mm(trained.network, outfits), mean_error_mm(rigid.network, outfits)
    assert errors[0] < 0.5 * errors[1]
    assert errors[1] < nearest
    assert errors[0] < 2.0, "what is left is the noise: 1 mm along each axis is 1.6 mm"


def test_a_run_stopped_anywhere_ends_the_same(outfits: list[SimulatedOutfit], finished: Path, tmp_path: Path) -> None:
    sessions = 0
    while not (part := train(recipe(), outfits, outfits[:1], DATA, tmp_path, must_stop=after_steps(5))).finished:
        sessions += 1
    assert sessions == 3
    straight = read_checkpoint(finished)
    assert straight is not None
    assert torch.equal(weights_of(part.network), weights_of(straight.restored()))
    lines = [
        [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
        for folder in (finished, tmp_path)
    ]
    measured = [[(line["total_step"], line["error_mm"]) for line in of if "error_mm" in line] for of in lines]
    assert measured[0] == measured[1]
    assert [step for step, _ in measured[0]] == [5, 10, 12, 16]


def test_the_second_stage_trains_the_second_branch_alone(
    outfits: list[SimulatedOutfit], finished: Path, tmp_path: Path
) -> None:
    first = train(recipe(physics=0), outfits, [], DATA, tmp_path).network.state_dict()
    both = read_checkpoint(finished)
    assert both is not None
    for name, value in both.network.items():
        changed = not torch.equal(value, first[name])
        assert changed == name.startswith("physics_head"), name


def test_a_run_of_another_recipe_or_other_data_is_not_continued(outfits: list[SimulatedOutfit], finished: Path) -> None:
    with pytest.raises(GarmentcError, match=r"data\.steps, mirror"):
        train(recipe(13, mirror=False), outfits, [], DATA, finished)
    with pytest.raises(GarmentcError, match="other data"):
        train(recipe(), outfits, [], replace(DATA, sha256="1" * 64), finished)
    with pytest.raises(GarmentcError, match="nothing to learn"):
        train(recipe(), [], [], DATA, finished)


def test_a_damaged_checkpoint_is_refused_and_executes_nothing(tmp_path: Path) -> None:
    import pickle

    class Evil:
        def __reduce__(self) -> tuple[object, ...]:
            return (os.mkdir, (str(tmp_path / "harm"),))

    (tmp_path / "checkpoint.pt").write_bytes(pickle.dumps(Evil(), protocol=2))
    with pytest.raises(GarmentcError, match="no checkpoint"):
        read_checkpoint(tmp_path)
    assert not (tmp_path / "harm").exists()


@pytest.mark.parametrize(
    ("variant", "metadata"),
    [
        ({}, ()),
        ({"global_descriptor": False}, ()),
        ({"pose_embedding": False}, ()),
        ({"deformation": "none"}, ()),
        ({}, ("fabric", "tightness")),
    ],
)
def test_a_bundle_moves_an_outfit_as_the_network_does(
    variant: dict[str, object], metadata: tuple[str, ...], outfits: list[SimulatedOutfit], tmp_path: Path
) -> None:
    plain = recipe(network=DeepsdConfig(**SMALL_NETWORK, **variant), metadata=metadata)  # type: ignore[arg-type]
    told = recipe_of(
        plain.document() if variant.get("deformation") != "none" else {**plain.document(), "physics": None}
    )
    torch.manual_seed(5)
    network = Deepsd(told.network)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.add_(0.05 * torch.randn_like(parameter))
    checkpoint = Checkpoint(told, DATA, network.state_dict(), None, Progress())
    fabric = "silk" if metadata else None
    export_run(checkpoint, tmp_path)

    body = load_default_body("female")
    vertices, triangles = body.shaped()[:2000], body.faces[(body.faces < 2000).all(axis=1)]
    sample = make_sample("skin", vertices, triangles, PosableBody.of(body, np.zeros(10)))
    joined, normals = edges(triangles), vertex_normals(vertices, triangles)
    cloth = held_cloth(vertices, joined, body)
    rig = deepsd.infer(load_bundle(tmp_path), vertices, normals, triangles, joined, body.joints(), cloth, fabric)
    known = encode_metadata(metadata, "silk", ())
    poses = sample_poses(4, seed=1)
    found = poser(network, sample, metadata=known, influences=24)(poses)
    np.testing.assert_allclose(rig.posed(poses), found, atol=2e-5)
    if metadata:
        other = poser(network, sample, metadata=encode_metadata(metadata, "denim", ()), influences=24)(poses)
        assert np.abs(other - found).max() > 1e-3


def test_what_no_rig_can_express_has_no_bundle(tmp_path: Path) -> None:
    for variant in ({"deformation": "vertices"}, {"pose_encoding": "gravity_6d"}):
        odd = recipe(physics=0, network=DeepsdConfig(**SMALL_NETWORK, **variant))  # type: ignore[arg-type]
        checkpoint = Checkpoint(odd, DATA, Deepsd(odd.network).state_dict(), None, Progress())
        assert not has_bundle(checkpoint)
        with pytest.raises(GarmentcError, match=r"no rig|pose encoding"):
            export_run(checkpoint, tmp_path)


def test_two_processes_learn_what_one_learns(dataset: Dataset, tmp_path: Path) -> None:
    """Started as a user would, with torchrun: the same batches, the same losses but for rounding."""
    config = tmp_path / "recipe.toml"
    widths = "\n".join(f"{name} = {list(v) if isinstance(v, tuple) else v}" for name, v in SMALL_NETWORK.items())
    config.write_text(
        "measure_every = 0\n[data]\nsteps = 50\noutfits_per_step = [2, 3]\nposes = 6\nvertices = 20\n"
        f"[network]\n{widths}\n"
    )
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", "--standalone"]
    options = ["--data", str(dataset.folder), "--config", str(config), "--out", str(tmp_path / "two")]
    shared = subprocess.run(
        [*torchrun, "-m", "garmentc", "train", "deepsd", *options],
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert shared.returncode == 0, shared.stderr
    outfits = read_outfits(dataset, "train")
    train(read_recipe(config), outfits, read_outfits(dataset, "test"), DATA, tmp_path / "one")
    logs = [
        [json.loads(line) for line in (tmp_path / name / "log.jsonl").read_text().splitlines()]
        for name in ("one", "two")
    ]
    assert len(logs[0]) == len(logs[1]) == 2
    for one, two in zip(*logs, strict=True):
        for name in {"loss", "distance", "weights", "error_mm"} & set(one):
            assert two[name] == pytest.approx(one[name], rel=2e-3), name
    assert (tmp_path / "two" / "bundle" / "manifest.json").exists()


def test_validation_outfits_are_spread_and_not_learned_from(outfits: list[SimulatedOutfit]) -> None:
    kept, withheld = validation_split(outfits, 2)
    assert [outfit.sample.name for outfit in withheld] == ["outfit0000", "outfit0002"]
    assert [outfit.sample.name for outfit in kept] == ["outfit0001", "outfit0003"]
    assert validation_split(outfits, 0) == (outfits, [])


def test_dropout_thins_in_training_only_and_the_same_every_time(outfits: list[SimulatedOutfit], tmp_path: Path) -> None:
    thin = recipe(3, 0, data=DataStage(3, poses=6, dropout=0.5))
    once, again = (train(thin, outfits, [], DATA, tmp_path / name).network for name in ("once", "again"))
    plain = train(recipe(3, 0, data=DataStage(3, poses=6)), outfits, [], DATA, tmp_path / "plain").network
    assert torch.equal(weights_of(once), weights_of(again))
    assert not torch.equal(weights_of(once), weights_of(plain))
