"""The --params file: JSON and npz."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from garmentc.errors import GarmentcError
from garmentc.smpl.parameters import read_parameters

POSE = np.random.default_rng(0).normal(scale=0.4, size=(24, 3))


def write(path: Path, document: Any) -> Path:
    path.write_text(document if isinstance(document, str) else json.dumps(document))
    return path


@pytest.mark.parametrize("pose", [POSE.tolist(), POSE.reshape(72).tolist()])
def test_json(tmp_path: Path, pose: Any) -> None:
    document = {"gender": "male", "betas": [1, -0.5], "pose": pose}
    parameters = read_parameters(write(tmp_path / "a.json", document))
    assert parameters.gender == "male"
    assert parameters.betas is not None
    assert parameters.pose is not None
    np.testing.assert_array_equal(parameters.betas, [1, -0.5])
    np.testing.assert_array_equal(parameters.pose, POSE)


def test_everything_is_optional(tmp_path: Path) -> None:
    parameters = read_parameters(write(tmp_path / "a.json", {}))
    assert (parameters.gender, parameters.betas, parameters.pose) == (None, None, None)


@pytest.mark.parametrize("gender", [np.array("female"), np.array(b"female"), np.array(["F"]), np.array("Female")])
@pytest.mark.parametrize("shape", [(24, 3), (72,), (1, 72), (1, 24, 3)])
def test_npz(tmp_path: Path, gender: Any, shape: tuple[int, ...]) -> None:
    np.savez(tmp_path / "a.npz", gender=gender, betas=np.ones((1, 10)), pose=POSE.reshape(shape))
    parameters = read_parameters(tmp_path / "a.npz")
    assert parameters.gender == "female"
    assert parameters.betas is not None
    assert parameters.betas.shape == (10,)
    np.testing.assert_array_equal(parameters.pose, POSE)


def test_npz_with_fingers(tmp_path: Path) -> None:
    """An SMPL-H pose keeps its 22 body joints; hands continue the wrists."""
    np.savez(tmp_path / "a.npz", poses=np.concatenate([POSE[:22].reshape(66), np.ones(90)]))
    pose = read_parameters(tmp_path / "a.npz").pose
    assert pose is not None
    np.testing.assert_array_equal(pose[:22], POSE[:22])
    assert not pose[22:].any()


@pytest.mark.parametrize(
    ("document", "message", "line"),
    [
        ({"gender": "both"}, r"'gender' must be one of", None),
        ({"betas": [1, "x"]}, r"'betas\.1' must be number", None),
        ({"pose": [0] * 71}, r"'pose' is not what it should be: .*24 SMPL joints", None),
        ({"pose": [[0, 0, 0]] * 23}, r"'pose' is not what it should be: .*24 SMPL joints", None),
        ({"poses": [0] * 72}, r"poses", None),
        ([], r"must be object", None),
        ('{"betas": [NaN]}', r"'betas' holds NaN", None),
        ('{"betas": [1e999]}', r"'betas' holds NaN or infinity", None),
        ('{\n"gender": "male",\n}', r"is not JSON", 3),
        ("", r"is not JSON", 1),
        ("[" * 100_000, r"is not usable JSON|is not JSON", None),
    ],
)
def test_wrong_json(tmp_path: Path, document: Any, message: str, line: int | None) -> None:
    path = write(tmp_path / "a.json", document)
    with pytest.raises(GarmentcError, match=message) as caught:
        read_parameters(path)
    assert caught.value.file == path
    assert caught.value.line == line
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"pose": np.zeros(71)}, "'pose' has shape 71, expected one pose of 24 x 3 or 72 numbers$"),
        ({"poses": np.zeros((5, 72))}, "'poses' has shape 5 x 72, .*; pass a motion with --motion"),
        ({"pose": np.full(72, np.inf)}, "'pose' holds NaN or infinity"),
        ({"betas": np.zeros((2, 10))}, "'betas' has shape 2 x 10, expected S"),
        ({"gender": np.array("x")}, "unknown gender 'x'"),
        ({"gender": np.array(["male", "male"])}, "unknown gender"),
        ({"betas": np.array([1, "a"], dtype=object)}, "'betas' holds Python objects, which are never loaded"),
        ({"other": np.zeros(3)}, "holds none of the arrays gender, betas, pose"),
    ],
)
def test_wrong_npz(tmp_path: Path, arrays: dict[str, Any], message: str) -> None:
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(GarmentcError, match=message):
        read_parameters(tmp_path / "a.npz")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_bytes(b"\xff\xfe")
    for name, message in [
        ("a.json", "not UTF-8"),
        ("b.json", "cannot be read"),
        ("b.npz", "cannot be read"),
        ("a.txt", "unknown kind"),
    ]:
        with pytest.raises(GarmentcError, match=message):
            read_parameters(tmp_path / name)
