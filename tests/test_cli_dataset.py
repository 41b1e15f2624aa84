"""garmentc simulate and garmentc dataset, with a stand-in for physics."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from cli_samples import CommandLine
from PIL import Image
from simulation_stand_in import fail_some, skinned_patch

from garmentc.outfit.obj import read_obj
from garmentc.simulation.dataset import open_dataset
from garmentc.simulation.outfits import sample_parameters
from garmentc.simulation.plan import make_plan
from garmentc.simulation.presets import PRESETS
from garmentc.simulation.task_graph import run_plan


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> CommandLine:
    return CommandLine(capsys)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return run_plan(make_plan(PRESETS["small"], seed=2), tmp_path / "data", skinned_patch).folder


def test_check_prints_the_statistics(run: CommandLine, folder: Path) -> None:
    result = run("dataset", "check", folder)
    assert result.code == 0
    assert "frames accepted" in result.out
    assert "110 of 120 (91.7%)" in result.out
    assert open_dataset(folder).sha256 in result.out
    document = json.loads(run("dataset", "check", folder, "--json").out)
    assert document["total"]["accepted"] == 110
    assert document["problems"] == []


def test_check_of_a_damaged_dataset(run: CommandLine, folder: Path) -> None:
    next(iter((folder / "sequences").iterdir())).write_bytes(b"damaged")
    result = run("dataset", "check", folder)
    assert result.code == 1
    assert "problem: sequences/" in result.out


def test_preview_draws_bodies_and_cloth(run: CommandLine, folder: Path, tmp_path: Path) -> None:
    sheet = tmp_path / "sheet.png"
    assert run("dataset", "preview", folder, "-o", sheet, "--count", "2").code == 0
    first = sheet.read_bytes()
    with Image.open(sheet) as image:
        pixels = np.asarray(image)
    assert pixels.shape[1] % 240 == 0
    cell = pixels[:320, :240].astype(int)
    assert 0.05 < (np.abs(cell - cell[0, 0]).max(axis=2) > 15).mean() < 0.6, "something is drawn, on an empty ground"
    assert (cell[..., 2] - cell[..., 0] > 40).any(), "some of it is blue cloth"
    run("dataset", "preview", folder, "-o", sheet, "--count", "2")
    assert sheet.read_bytes() == first


def test_no_dataset(run: CommandLine, tmp_path: Path) -> None:
    for arguments in (["check", tmp_path], ["preview", tmp_path, "-o", tmp_path / "a.png"]):
        result = run("dataset", *arguments)
        assert result.code == 2
        assert result.error_lines == [f"garmentc: error: {tmp_path}: is no dataset: it has no manifest.json"]


def test_list_outfits(run: CommandLine) -> None:
    result = run("simulate", "--preset", "small", "--list-outfits", "--outfits", "7", "--category", "skirt")
    lines = result.out.splitlines()
    assert result.code == 0
    assert len(lines) == 8
    assert all(" skirt " in line for line in lines[1:])


def test_export_outfit(run: CommandLine, tmp_path: Path) -> None:
    assert run("simulate", "--export-outfit", "3", tmp_path / "out.obj").code == 0
    outfit = read_obj(tmp_path / "out.obj")
    assert len(outfit.vertices) > 100
    assert outfit.has_texcoords
    options = next(line for line in (tmp_path / "out.obj").read_text().splitlines() if "--gender" in line).split()[-4:]
    assert options[:3] == ["--gender", sample_parameters(3).gender, "--betas"]
    assert [float(beta) for beta in options[3].split(",")] == list(sample_parameters(3).betas)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--preset", "huge", "--out", "d"],
            "'huge'; the presets are benchmark-v1, wardrobe-v1, wardrobe-v2, tshirt, small",
        ),
        (["--category", "toga", "--out", "d"], "unknown category 'toga'"),
        (["--motion", "missing.npz", "--out", "d"], "missing.npz: cannot be read"),
        (["--export-outfit", "1", "out.ply"], "name the file .obj"),
        ([], "give a folder for the dataset: --out DIR"),
    ],
)
def test_mistakes(
    run: CommandLine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run("simulate", *arguments)
    assert result.code == 2
    assert len(result.error_lines) == 1
    assert message in result.error_lines[0]
    assert not list(tmp_path.iterdir()), "nothing is begun"


def test_simulation_needs_newton(run: CommandLine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "warp", None)
    assert "pip install 'garmentc[simulate]'" in run.fails("simulate", "--out", tmp_path / "data")
    assert not list(tmp_path.iterdir()), "nothing is begun"


def test_simulate_makes_and_resumes(run: CommandLine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("garmentc.simulation.simulate_task.simulate_task", fail_some)
    monkeypatch.setattr("garmentc.simulation.newton_cloth.import_newton", lambda: None)
    arguments = ("simulate", "--out", tmp_path / "data", "--seed", "5", "--workers", "1")
    first = run(*arguments)
    assert first.code == 0, first.err
    assert "frames accepted  22 of 24" in first.out
    assert run(*arguments) == first
    checked = run("dataset", "check", tmp_path / "data")
    assert checked.code == 0
    assert "sequences rejected  8" in checked.out
