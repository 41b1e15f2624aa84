"""Bundles measured on a dataset: against closed forms, and from the files that the command writes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from cli_samples import CommandLine
from simulation_stand_in import skinned_patch

from garmentc.errors import GarmentcError
from garmentc.evaluation.baselines import nearest_skinning
from garmentc.evaluation.dataset_evaluation import DatasetEvaluation, evaluate_dataset, outfits_of
from garmentc.evaluation.evaluation_document import evaluation_document, evaluation_json
from garmentc.evaluation.evaluation_markdown import evaluation_markdown
from garmentc.evaluation.group_scores import by_category, by_garment, overall, ratios
from garmentc.evaluation.method import MATCH, NEAREST_METHOD, Method, PosedTemplate, bundle_methods, named_methods
from garmentc.evaluation.metrics import depth_inside, signed_distance
from garmentc.evaluation.outfit_scores import MethodScores, OutfitScores, sample_frames, score_outfit
from garmentc.evaluation.representative import representatives
from garmentc.families.bundle import DEFAULT_BUNDLE
from garmentc.options import PROFILES
from garmentc.outfit.topology import vertex_normals
from garmentc.schema import check_schema
from garmentc.simulation.dataset import Dataset
from garmentc.simulation.plan import make_plan
from garmentc.simulation.presets import PRESETS
from garmentc.simulation.sequence import Sample, Sequence
from garmentc.simulation.task_graph import run_plan
from garmentc.smpl.body import BodyModel
from garmentc.smpl.default_body import load_default_body

METRICS = tuple(MethodScores.__annotations__)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return run_plan(make_plan(PRESETS["small"], seed=2), tmp_path_factory.mktemp("data"), skinned_patch)


@pytest.fixture(scope="module")
def sequence() -> Sequence:
    """A strip of skin, 10 mm out at rest, that moves with the nearest body vertices; far from the origin."""
    patch = skinned_patch(next(make_plan(PRESETS["small"], seed=1, outfits=1).tasks))
    body = load_default_body(patch.facts.gender)
    skin = body.shaped(patch.betas)
    template = patch.template + 0.01 * vertex_normals(skin, body.faces)[_strip(patch, skin)]
    posed = nearest_skinning(template, patch.faces, body, patch.betas).posed(patch.poses, patch.trans)
    trans = patch.trans + np.float32([0.4, 0.1, -1.0])
    posed = posed + (trans - patch.trans)[:, None]
    return replace(patch, template=template.astype(np.float32), trans=trans, vertices=posed.astype(np.float32))


def _strip(patch: Sequence, skin: np.ndarray) -> np.ndarray:
    return np.linalg.norm(patch.template[:, None] - skin, axis=2).argmin(axis=1)


@dataclass(frozen=True)
class Shifted(Method):
    """The nearest body vertices, and then a constant way along x in millimetres."""

    by: float = 0.0

    def posed_template(self, sequence: Sequence, body: BodyModel, body_file: Path | None) -> PosedTemplate:
        rig = nearest_skinning(sequence.template, sequence.faces, body, sequence.betas)
        return lambda sample: rig.posed(sample.pose.astype(float)) + np.array([self.by / 1000, 0, 0])


def test_errors_are_those_put_in(sequence: Sequence) -> None:
    """Root translation and heading play no part, and a shift stretches nothing."""
    result = score_outfit([sequence], [NEAREST_METHOD, Shifted("shifted", by=7.0)])
    assert list(result.scores) == ["simulation", "nearest", "shifted"]
    np.testing.assert_allclose(result.scores["simulation"].error_mm, 0)
    np.testing.assert_allclose(result.scores["nearest"].error_mm, 0, atol=1e-3)
    np.testing.assert_allclose(result.scores["shifted"].error_mm, 7, atol=1e-3)
    np.testing.assert_allclose(result.scores["shifted"].garment_error_mm, 7, atol=1e-3)
    for metric in ("edge_mm", "bend"):
        shifted, still = (getattr(result.scores[name], metric) for name in ("shifted", "nearest"))
        np.testing.assert_allclose(shifted, still, atol=1e-6)
    assert len(result.frames) == sequence.quality.accepted.sum() < len(sequence)


def test_collisions_are_counted_against_the_body_of_the_frame(sequence: Sequence) -> None:
    """Cloth on the posed skin, half of it moved in by 3 mm, then by 0.5 mm: that half collides, but not deep."""
    body = load_default_body(sequence.facts.gender)
    skin = body.posed(sequence.poses, sequence.betas, sequence.trans)
    normals = np.array([vertex_normals(frame, body.faces) for frame in skin])
    strip = _strip(sequence, body.shaped(sequence.betas))
    for depth, deep in ((0.003, 0.5), (0.0005, 0.0)):
        way = np.where(np.arange(len(strip)) % 2, depth, -depth)[:, None]
        cloth = (skin[:, strip] + way * normals[:, strip]).astype(np.float32)
        scores = score_outfit([replace(sequence, vertices=cloth)], [NEAREST_METHOD], frames=3).scores["simulation"]
        np.testing.assert_allclose(scores.collision, 0.5, atol=0.03)
        np.testing.assert_allclose(scores.deep, deep, atol=0.03)


def test_depth_is_the_negative_part_of_the_signed_distance() -> None:
    body = load_default_body("female")
    points = body.v_template[::5] + np.random.default_rng(0).normal(0, 0.02, (len(body.v_template[::5]), 3))
    expected = np.maximum(-signed_distance(points, body.v_template, body.faces), 0)
    np.testing.assert_array_equal(depth_inside(points, body.v_template, body.faces), expected)
    assert 0.2 < (expected > 0).mean() < 0.8


@pytest.mark.parametrize(("profile", "tolerance"), [("network", 1e-6), ("reference", 1e-6), ("web", MATCH)])
def test_a_compiled_outfit_at_rest_is_the_template(sequence: Sequence, profile: str, tolerance: float) -> None:
    """Vertex by vertex in the template's order, whatever the order in the file."""
    order = np.random.default_rng(3).permutation(len(sequence.template))
    place = np.argsort(order).astype(np.int32)
    shuffled = replace(
        sequence, template=sequence.template[order], faces=place[sequence.faces], vertices=sequence.vertices[:, order]
    )
    body = load_default_body(sequence.facts.gender)
    [method] = bundle_methods([None], [profile])
    rows = [method.posed_template(one, body, None) for one in (sequence, shuffled)]
    resting = replace(shuffled, poses=np.zeros_like(shuffled.poses))
    rest = rows[1](Sample(resting, 0))
    assert np.linalg.norm(rest - shuffled.template, axis=1).max() <= tolerance
    sample = Sample(sequence, 5)
    # Sums in another order round otherwise, and cloth that touches the skin a round sooner slides a little less.
    apart = np.linalg.norm(rows[1](sample) - rows[0](sample)[order], axis=1)
    assert (apart.mean(), apart.max()) < (1e-4, 2e-3)
    assert np.linalg.norm(rows[0](sample) - (sequence.vertices[5] - sequence.trans[5]), axis=1).max() < 0.05


@dataclass(frozen=True)
class Counted(Method):
    """The nearest body vertices, and the names of the sequences that it was asked to move."""

    compiled: list[str] = field(default_factory=list, hash=False)

    def posed_template(self, sequence: Sequence, body: BodyModel, body_file: Path | None) -> PosedTemplate:
        self.compiled.append(sequence.facts.name)
        return super().posed_template(sequence, body, body_file)


def test_an_outfit_is_compiled_once_for_all_sequences_that_share_it(sequence: Sequence) -> None:
    named = [replace(sequence, facts=replace(sequence.facts, name=name)) for name in ("a", "b", "c")]
    named[2] = replace(named[2], betas=named[2].betas + np.float32(0.5))
    counted = Counted("nearest")
    result = score_outfit(named, [counted], frames=1)
    assert counted.compiled == ["a", "c"], "another body is another fitting"
    assert [name for name, _ in result.frames] == ["a", "b", "c"]


def test_an_animation_is_what_the_file_plays(sequence: Sequence) -> None:
    """Where no targets are its own, as in profile mobile, the network's keys are baked."""
    [alone] = bundle_methods([None], ["mobile"])
    animated = alone.with_animations()
    assert animated.name.endswith(", mobile, animated")
    assert NEAREST_METHOD.with_animations() == NEAREST_METHOD
    body, sample = load_default_body(sequence.facts.gender), Sample(sequence, 7)
    played = animated.posed_template(sequence, body, None)(sample)
    assert PROFILES["mobile"].animation_morphs == 0
    posed = alone.posed_template(sequence, body, None)(sample)
    # The passes know the motion in one of them, so that they fit another set of poses.
    moved = np.linalg.norm(posed - sequence.template, axis=1).mean()
    assert np.linalg.norm(played - posed, axis=1).mean() < 0.05 * moved


def test_an_outfit_is_compiled_anew_for_each_animation(sequence: Sequence) -> None:
    named = [replace(sequence, facts=replace(sequence.facts, name=name)) for name in ("a", "b")]
    counted = Counted("nearest", animated=True)
    score_outfit(named, [counted], frames=1)
    assert counted.compiled == ["a", "b"]


def test_vertices_of_no_face_do_not_count(sequence: Sequence) -> None:
    stray = np.full((len(sequence), 1, 3), 1.5, np.float32)
    more = replace(
        sequence,
        template=np.concatenate([sequence.template, stray[0]]),
        vertices=np.concatenate([sequence.vertices, stray], axis=1),
    )
    methods = bundle_methods([None], ["web"])
    first, second = (score_outfit([one], methods, frames=1) for one in (sequence, more))
    for name in first.scores:
        np.testing.assert_allclose(second.scores[name].error_mm, first.scores[name].error_mm, atol=1e-9)


def test_frames_are_accepted_ones_spread_evenly(sequence: Sequence) -> None:
    accepted = np.flatnonzero(sequence.quality.accepted)
    assert [sample.frame for sample in sample_frames(sequence, None)] == accepted.tolist()
    assert [sample.frame for sample in sample_frames(sequence, 99)] == accepted.tolist()
    few = [sample.frame for sample in sample_frames(sequence, 3)]
    assert len(few) == 3
    assert set(few) <= set(accepted.tolist())
    assert few[0] > accepted[0]
    assert few[-1] < accepted[-1]
    assert [sample.frame for sample in sample_frames(sequence, 1)] == [accepted[len(accepted) // 2]]


def _outfit(name: str, errors: Mapping[str, list[float]], clean: list[bool], garments: tuple[str, ...]) -> OutfitScores:
    """Collisions are a hundredth of the errors, and the second garment has twice the error of the first."""
    count = len(clean)
    scores = {
        method: MethodScores(
            np.array(values, float),
            np.outer(values, np.arange(1, len(garments) + 1)),
            np.ones(count),
            np.ones(count),
            np.array(values) / 100,
            np.zeros(count),
        )
        for method, values in errors.items()
    }
    frames = tuple((f"{name}.walk", frame) for frame in range(count))
    return OutfitScores(name, "+".join(garments), "silk", "male", garments, frames, np.array(clean), scores)


@pytest.fixture
def evaluation() -> DatasetEvaluation:
    methods = (
        NEAREST_METHOD,
        Method("new, web", Path("new"), "web"),
        Method("new, reference", Path("new"), "reference"),
    )
    baseline = (Method("old, web", Path("old"), "web"),)
    few = {"simulation": [0.0], "nearest": [10.0], "new, web": [1.0], "new, reference": [2.0], "old, web": [8.0]}
    many = {name: [values[0] * k for k in (1, 2, 3)] for name, values in few.items()}
    outfits = (
        _outfit("a", few, [False], ("skirt",)),
        _outfit("b", many, [True, False, True], ("top", "skirt")),
    )
    return DatasetEvaluation("made up", "0" * 64, True, "test", None, methods, baseline, outfits)


def test_means_are_over_outfits_and_percentiles_over_frames(evaluation: DatasetEvaluation) -> None:
    rows = {row.method: row for row in overall(evaluation)}
    row = rows["nearest"]
    assert (row.outfits, row.frames, row.clean_frames) == (2, 4, 2)
    assert row.error_mm.mean == pytest.approx((10 + (10 + 20 + 30) / 3) / 2)
    assert row.error_mm.p95 == pytest.approx(20 + 0.85 * 10)  # of 10, 10, 20, 30
    assert row.collision.mean == pytest.approx(0.15)
    assert row.clean_collision.mean == pytest.approx(0.2), "of the outfit that has clean frames"
    skirts = {row.method: row for row in by_category(evaluation) if row.group == "skirt"}
    assert (skirts["nearest"].clean_collision.mean, skirts["nearest"].error_mm.mean) == (None, 10)


def test_errors_by_garment_are_those_of_its_vertices(evaluation: DatasetEvaluation) -> None:
    rows = {(row.garment, row.method): row for row in by_garment(evaluation)}
    assert rows["top", "nearest"].error_mm.mean == pytest.approx(20)
    assert rows["skirt", "nearest"].error_mm.mean == pytest.approx((10 + 2 * 20) / 2)
    assert rows["skirt", "nearest"].outfits == 2


def test_ratios_compare_equal_profiles(evaluation: DatasetEvaluation) -> None:
    found = {(ratio.method, ratio.baseline): ratio for ratio in ratios(evaluation)}
    assert set(found) == {("new, web", "nearest"), ("new, web", "old, web"), ("new, reference", "nearest")}
    unbundled = replace(evaluation, methods=(replace(evaluation.methods[1], bundle=None, profile=None),))
    assert ratios(unbundled) == (), "nothing to compare a run with"
    assert found["new, web", "old, web"].error == pytest.approx(1 / 8)
    assert found["new, reference", "nearest"].clean_collision == pytest.approx(0.2)


def test_best_median_and_worst(evaluation: DatasetEvaluation) -> None:
    shown = representatives(evaluation)
    assert [(s.place, s.sequence, s.frame, s.error_mm) for s in shown] == [
        ("best", "a.walk", 0, 2.0),
        ("median", "b.walk", 1, 4.0),
        ("worst", "b.walk", 2, 6.0),
    ]
    assert {sample.method for sample in shown} == {"new, reference"}


def test_the_tables_say_what_the_json_says(evaluation: DatasetEvaluation) -> None:
    document = evaluation_document(evaluation, representatives(evaluation))
    text = evaluation_markdown(evaluation)
    line = next(line for line in text.splitlines() if line.startswith("| nearest |"))
    assert float(line.split("|")[2]) == pytest.approx(document["overall"][1]["error_mm"]["mean"])
    line = next(line for line in text.splitlines() if line.startswith("| top+skirt | old, web |"))
    row = next(r for r in document["categories"] if (r["group"], r["method"]) == ("top+skirt", "old, web"))
    assert float(line.split("|")[5]) == pytest.approx(row["error_mm"]["mean"])
    assert "new, web: error 0.12 ×" in text
    assert "| DeePSD | 25.13 |" in text
    assert "| skirt | nearest | 2 | 4 | 25.00 |" in text
    assert "skirt 41.15" in text


def test_workers_change_nothing(dataset: Dataset) -> None:
    methods = [NEAREST_METHOD]
    found = [evaluate_dataset(dataset, "train", methods, frames=2, workers=workers) for workers in (1, 2)]
    first, second = (evaluation_json(evaluation_document(evaluation)) for evaluation in found)
    assert first == second
    assert [outfit.outfit for outfit in found[1].outfits] == [group[0].outfit for group in outfits_of(dataset, "train")]


def test_another_body_is_asked_for(sequence: Sequence) -> None:
    foreign = replace(sequence, facts=replace(sequence.facts, body="SMPL male"))
    with pytest.raises(GarmentcError, match="made on the body 'SMPL male'; give its model file with --body"):
        score_outfit([foreign], [NEAREST_METHOD])


def test_bundles_of_one_name_are_told_apart(tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    copy.mkdir()
    for path in DEFAULT_BUNDLE.iterdir():
        (copy / path.name).write_bytes(path.read_bytes())
    names = [method.name for method in bundle_methods([None, copy], ["web"])]
    assert len(set(names)) == 2
    assert str(copy) in names[1]
    assert len(bundle_methods([None, None], ["web", "web"])) == 1


def test_a_bundle_that_is_told_the_fabric_moves_it_otherwise(sequence: Sequence) -> None:
    [alone] = bundle_methods([None], ["network"])
    told = alone.told_fabrics()
    assert told.name.endswith(", network, told the fabric")
    body, last = load_default_body(sequence.facts.gender), Sample(sequence, len(sequence) - 1)
    apart = [method.posed_template(sequence, body, None)(last) for method in (alone, told)]
    assert np.abs(apart[0] - apart[1]).max() > 1e-4


def test_the_folder_of_a_training_run_is_a_method_too(tmp_path: Path) -> None:
    folder = tmp_path / "without_global"
    folder.mkdir()
    (folder / "checkpoint.pt").write_bytes(b"not read before it is measured")
    found = named_methods([None, folder], ["web", "network"])
    assert [method.profile for method in found[None]] == ["web", "network"]
    [method] = found[folder]
    assert (method.name, method.bundle, method.profile) == ("without_global", None, None)
    with pytest.raises(GarmentcError, match=r"manifest\.json"):
        named_methods([tmp_path], ["web"])


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> CommandLine:
    return CommandLine(capsys)


def test_the_command_measures_a_bundle(
    run: CommandLine, dataset: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("garmentc.evaluation.evaluation_picture.CELL", (140, 160))
    files = {"-o": tmp_path / "r.json", "--markdown": tmp_path / "r.md", "--picture": tmp_path / "r.png"}
    written = [part for pair in files.items() for part in pair]
    data = ("--data", dataset.folder, "--split", "test_motions", "--frames", "2", "--outfits", "1")
    result = run("evaluate", DEFAULT_BUNDLE, *data, "--profile", "web", *written)
    assert result.code == 0, result.err
    document = json.loads(files["-o"].read_text())
    check_schema(document, "evaluation")
    assert [method["name"] for method in document["methods"]] == ["nearest", "garmentc-deepsd 0.1.0, web"]
    assert {row["method"] for row in document["overall"]} == {"simulation", "nearest", "garmentc-deepsd 0.1.0, web"}
    assert document["overall"][0]["frames"] == 2
    assert files["--markdown"].read_text() == result.out
    assert [sample["place"] for sample in document["samples"]] == ["best", "median", "worst"]
    assert files["--picture"].read_bytes().startswith(b"\x89PNG")


def test_the_word_nearest_measures_skinning_alone(run: CommandLine, dataset: Dataset) -> None:
    command = ("evaluate", "nearest", "--data", dataset.folder, "--json", "--frames", "1")
    result = run(*command)
    document = json.loads(result.out)
    assert [method["name"] for method in document["methods"]] == ["nearest"]
    assert document["ratios"] == []
    skinned = document["overall"][1]
    assert 0.5 < skinned["error_mm"]["mean"] < 5, "noise of 1 mm along each axis, and the body's pose correctives"
    assert run(*command) == result, "twice the same bytes"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a.glb", "--motion", "m.npz", "--frames", "3"], "--frames is for 'garmentc evaluate BUNDLE... --data DIR'"),
        (["nearest", "--data", "DATA", "--step", "3"], "--step is for 'garmentc evaluate ASSET.glb..."),
        ([], "give compiled files, or a dataset with --data"),
        (["--motion", "m.npz"], "give compiled files, or a dataset with --data"),
        (["a.glb", "--motion", "m.npz", "--baseline", "bundle"], "--baseline takes a bundle with --data only"),
        (["--data", "missing"], "missing: is no dataset: it has no manifest.json"),
        (["nearest", "--data", "DATA", "--split", "exam"], "unknown split 'exam'; the splits are train, test"),
        (["missing", "--data", "DATA"], "missing/manifest.json: no such file"),
        (["nearest", "--data", "DATA", "-o", "missing/r.json"], "missing/r.json: cannot be written"),
    ],
)
def test_mistakes(run: CommandLine, dataset: Dataset, arguments: list[str], message: str) -> None:
    given = [str(dataset.folder) if argument == "DATA" else argument for argument in arguments]
    assert message in run.fails("evaluate", *given)
