"""The dataset's files: exact to the stated error, the same bytes every time, read lazily, checked and never trusted."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulation_stand_in import skinned_patch

from garmentc.errors import GarmentcError
from garmentc.simulation.dataset import Dataset, dataset_hash, open_dataset, write_manifest
from garmentc.simulation.dataset_check import check_dataset
from garmentc.simulation.plan import make_plan
from garmentc.simulation.presets import PRESETS
from garmentc.simulation.sequence import Sequence, Texcoords
from garmentc.simulation.sequence_file import STEP, read_facts, read_sequence, sequence_bytes
from garmentc.simulation.splits import SPLITS, is_block_held_out, leaks, split_pairs
from garmentc.simulation.task_graph import run_plan


@pytest.fixture(scope="module")
def sequence() -> Sequence:
    return skinned_patch(next(make_plan(PRESETS["small"], seed=1, outfits=1).tasks))


@pytest.fixture
def dataset(tmp_path: Path) -> Dataset:
    return run_plan(make_plan(PRESETS["small"], seed=1), tmp_path / "data", skinned_patch)


def _saved(sequence: Sequence, folder: Path) -> Path:
    path = folder / "one.npz"
    path.write_bytes(sequence_bytes(sequence))
    return path


def test_a_sequence_survives_its_file(sequence: Sequence, tmp_path: Path) -> None:
    with_texture = replace(sequence, texcoords=Texcoords(sequence.template[:, :2], sequence.faces))
    path = _saved(with_texture, tmp_path)
    again = read_sequence(path)
    assert again.facts == sequence.facts == read_facts(path)
    for name in ("template", "faces", "triangle_part", "betas", "poses", "trans"):
        np.testing.assert_array_equal(getattr(again, name), getattr(sequence, name))
    for name, values in vars(sequence.quality).items():
        np.testing.assert_array_equal(getattr(again.quality, name), values)
    assert again.texcoords is not None
    np.testing.assert_array_equal(again.texcoords.uv, sequence.template[:, :2])
    error = np.abs(again.vertices.astype(np.float64) - sequence.vertices)
    assert error.max() <= STEP / 2 + 1e-6
    assert error.max() > STEP / 4, "the vertices are not rounded at all"
    assert sequence_bytes(again) == path.read_bytes(), "reading and writing again changes nothing"


def test_the_file_is_plain_numpy(sequence: Sequence, tmp_path: Path) -> None:
    """Decoded here as docs/dataset.md says, with numpy alone."""
    with np.load(_saved(sequence, tmp_path), allow_pickle=False) as file:
        low, high = file["vertices_int16"].astype(np.int64)
        steps = np.cumsum(low + 256 * high, axis=0) % 65536
        steps = np.where(steps >= 32768, steps - 65536, steps)
        vertices = steps / 16384 + file["trans"][:, None]
    np.testing.assert_allclose(vertices, sequence.vertices, atol=3.2e-5)


def test_far_cloth_is_stored_in_full(sequence: Sequence, tmp_path: Path) -> None:
    far = sequence.vertices.copy()
    far[3, 4] += 5.0
    np.testing.assert_array_equal(read_sequence(_saved(replace(sequence, vertices=far), tmp_path)).vertices, far)


@pytest.mark.parametrize("name", ["vertices", "poses", "template"])
def test_numbers_that_are_none_are_never_written(sequence: Sequence, name: str) -> None:
    broken = getattr(sequence, name).copy()
    broken.flat[7] = np.nan
    with pytest.raises(ValueError, match=name):
        sequence_bytes(replace(sequence, **{name: broken}))


def _with_array(path: Path, name: str, array: np.ndarray | bytes) -> None:
    """Replace one array in an .npz, by raw bytes or as numpy would write it."""
    with zipfile.ZipFile(path) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    if isinstance(array, np.ndarray):
        buffer = io.BytesIO()
        np.save(buffer, array, allow_pickle=True)
        array = buffer.getvalue()
    members[f"{name}.npy"] = array
    with zipfile.ZipFile(path, "w") as archive:
        for filename, data in members.items():
            archive.writestr(filename, data)


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("faces", np.full((4, 3), 10**6), "'faces' refers to entry"),
        ("poses", np.zeros((12, 23, 3)), "'poses' has shape"),
        ("trans", np.zeros((11, 3)), "'trans' has shape"),
        ("betas", np.array([{}], dtype=object), "Python objects, which are never loaded"),
        ("rejected", np.full(12, 9999), "'rejected' refers to"),
        ("facts", np.frombuffer(b"{}", np.uint8), "sequence.schema.json"),
        ("facts", np.frombuffer(b"{", np.uint8), "'facts' is damaged"),
        ("template", b"damaged", "'template' is damaged"),
    ],
)
def test_a_damaged_file_is_refused(
    sequence: Sequence, tmp_path: Path, name: str, array: np.ndarray | bytes, message: str
) -> None:
    path = _saved(sequence, tmp_path)
    _with_array(path, name, array)
    with pytest.raises(GarmentcError, match=message) as error:
        read_sequence(path)
    assert str(error.value).startswith(f"{path}: ")


def test_training_and_evaluation_see_the_same_samples(dataset: Dataset) -> None:
    again = open_dataset(dataset.folder)
    assert again == dataset
    for split in SPLITS:
        kept = [(s.sequence.facts.name, s.frame) for s in again.samples(split)]
        shuffled = [(s.sequence.facts.name, s.frame) for s in again.samples(split, shuffle_seed=5)]
        assert sorted(kept) == sorted(shuffled)
        assert len(set(kept)) == len(kept) == sum(entry.accepted for entry in again.of_split(split))
        assert shuffled == [(s.sequence.facts.name, s.frame) for s in again.samples(split, shuffle_seed=5)]
    assert kept != shuffled
    sample = next(again.samples("train"))
    assert sample.vertices.shape == sample.sequence.template.shape
    assert sample.pose.shape == (24, 3)
    assert 4 not in {frame for _, frame in kept}, "a rejected frame is no sample"


def test_sequences_are_read_one_at_a_time(dataset: Dataset) -> None:
    train = dataset.of_split("train")
    (dataset.folder / train[1].file).unlink()
    samples = dataset.samples("train")
    for _ in range(train[0].accepted):
        next(samples)
    with pytest.raises(GarmentcError, match="cannot be read"):
        next(samples)


def test_the_hash_knows_no_order() -> None:
    files = [("a", "1" * 64), ("b", "2" * 64)]
    assert dataset_hash(files) == dataset_hash(files[::-1]) != dataset_hash([("b", "1" * 64), ("a", "2" * 64)])


def test_a_sound_dataset_has_no_problems(dataset: Dataset) -> None:
    report = check_dataset(dataset)
    assert report.problems == ()
    assert (report.total.sequences, report.total.frames, report.total.accepted) == (10, 120, 110)
    assert report.rejected_frames == {"stretch": 10}
    assert report.total.penetration == pytest.approx(0.001)
    assert 1.0 < report.total.strain[2] < 1.2
    size = sum(path.stat().st_size for path in (dataset.folder / "sequences").iterdir())
    assert report.total.bytes_per_frame == pytest.approx(size / 120)
    assert sum(group.accepted for group in report.groups if group.name in SPLITS) == 110


def _flip_a_byte(dataset: Dataset) -> None:
    path = dataset.folder / dataset.entries[0].file
    data = bytearray(path.read_bytes())
    data[10] ^= 1  # a zip header's time: the arrays stay readable
    path.write_bytes(data)


def _remove(dataset: Dataset) -> None:
    (dataset.folder / dataset.entries[0].file).unlink()


def _add(dataset: Dataset) -> None:
    source = dataset.folder / dataset.entries[0].file
    source.with_name("stray.npz").write_bytes(source.read_bytes())


def _leak(dataset: Dataset) -> None:
    entries = [replace(entry, split="train") if entry.split == "test" else entry for entry in dataset.entries]
    write_manifest(dataset.folder, dataset.name, entries, plan=dataset.plan)


def _misname(dataset: Dataset) -> None:
    entries = [replace(entry, category="hat") for entry in dataset.entries]
    write_manifest(dataset.folder, dataset.name, entries, plan=dataset.plan)


def _unfinish(dataset: Dataset) -> None:
    write_manifest(dataset.folder, dataset.name, dataset.entries, complete=False, plan=dataset.plan)


@pytest.mark.parametrize(
    ("harm", "problem"),
    [
        (_flip_a_byte, "its hash differs"),
        (_remove, "cannot be read"),
        (_add, "the manifest does not list it"),
        (_leak, "is both trained on and held out"),
        (_misname, "the manifest says 'hat'"),
        (_unfinish, "is unfinished"),
    ],
)
def test_check_finds(dataset: Dataset, harm: Callable[[Dataset], None], problem: str) -> None:
    harm(dataset)
    assert any(problem in said for said in check_dataset(open_dataset(dataset.folder)).problems)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("schema", 2, "'schema'"),
        ("sequences", [{}], "'sequences.0'"),
        ("sha256", "abc", "'sha256'"),
    ],
)
def test_a_wrong_manifest_is_refused(dataset: Dataset, key: str, value: object, message: str) -> None:
    path = dataset.folder / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), key: value}))
    with pytest.raises(GarmentcError, match=message):
        open_dataset(dataset.folder)


def test_no_file_outside_the_folder_is_read(dataset: Dataset) -> None:
    path = dataset.folder / "manifest.json"
    document = json.loads(path.read_text())
    document["sequences"][0]["file"] = "sequences/../../secret.npz"
    path.write_text(json.dumps(document))
    with pytest.raises(GarmentcError, match=r"'sequences\.0\.file'"):
        open_dataset(dataset.folder)


def test_no_dataset(tmp_path: Path) -> None:
    with pytest.raises(GarmentcError, match=r"it has no manifest\.json"):
        open_dataset(tmp_path)
    (tmp_path / "manifest.json").write_text("{")
    with pytest.raises(GarmentcError, match="is no JSON"):
        open_dataset(tmp_path)


def test_splits_of_imported_data_do_not_leak() -> None:
    pairs = [(f"outfit{i % 23}", f"motion{i % 17}") for i in range(391)]
    splits = split_pairs(pairs, seed=0)
    entries = [(outfit, motion, split) for (outfit, motion), split in splits.items()]
    assert leaks(entries) == []
    assert set(splits.values()) == set(SPLITS)
    assert splits == split_pairs(pairs[::-1], seed=0)
    held_out = {outfit for outfit, _, split in entries if split in ("test", "test_outfits")}
    assert len(held_out) == 23 // 5


def test_a_fifth_of_the_outfits_is_held_out_and_stays_so() -> None:
    first = [is_block_held_out(index, 3) for index in range(100)]
    assert sum(first) == 20
    assert first != [is_block_held_out(index, 4) for index in range(100)]
