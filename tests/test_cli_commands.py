"""The commands that look at a compiled .glb, and the body command."""

from __future__ import annotations

import json
import os
import pty
import re
import select
import subprocess
import sys
import termios
from pathlib import Path

import numpy as np
import pytest
import trimesh
from cli_samples import CommandLine, write_top

import garmentc
from garmentc.cli import COMMANDS
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.pose_sampler import sample_poses


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> CommandLine:
    return CommandLine(capsys)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """top.glb with an animation of 9 frames at 24 fps, and steps.npz, from which it came."""
    folder = tmp_path_factory.mktemp("compiled")
    poses = sample_poses(9, seed=5)
    np.savez(folder / "steps.npz", poses=poses.reshape(9, 72), trans=np.zeros((9, 3)), mocap_framerate=24.0)
    garmentc.compile_outfit(
        write_top(folder),
        folder / "top.glb",
        gender="female",
        motion=folder / "steps.npz",
        motion_up="y",
        animation_morphs=0,  # the animation is the network's
    )
    return folder


@pytest.fixture
def glb(folder: Path) -> Path:
    return folder / "top.glb"


def test_help_names_every_command_and_imports_nothing_heavy() -> None:
    script = """
import sys
from garmentc.cli import main
main(["--help"])
heavy = {"numpy", "scipy", "onnx", "onnxruntime", "trimesh", "pygltflib", "PIL", "torch"} & set(sys.modules)
assert not heavy, heavy
"""
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert all(f"\n  {name}  " in result.stdout for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(run: CommandLine, name: str) -> None:
    result = run(name, "--help")
    assert result.code == 0
    assert result.out.startswith(f"Usage: garmentc {name} ")


def test_a_compile_never_imports_torch_or_trimesh(folder: Path) -> None:
    script = f"""
import sys, garmentc
garmentc.compile_outfit({str(folder / "top.obj")!r}, {str(folder / "again.glb")!r}, gender="female")
heavy = {{"torch", "trimesh"}} & set(sys.modules)
assert not heavy, heavy
"""
    subprocess.run([sys.executable, "-c", script], check=True)


def test_progress_is_shown_on_a_terminal_and_cleared(folder: Path, tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 80))
    command = [sys.executable, "-m", "garmentc", "compile", folder / "top.obj", "-o", tmp_path / "a.glb", "--json"]
    result = subprocess.run([*command, "--gender", "female"], stdout=subprocess.PIPE, stderr=theirs, check=True)
    shown = b""
    while select.select([ours], [], [], 0)[0]:
        shown += os.read(ours, 100_000)
    os.close(theirs)
    os.close(ours)
    assert json.loads(result.stdout)["rig"]["joints"] == 24
    for stage in ("align", "infer", "optimise", "emit"):
        assert stage.encode() in shown
    assert shown.rstrip(b" ").endswith(b"\r"), "the bar is cleared at the end"


def test_version(run: CommandLine) -> None:
    assert run("--version").out == f"garmentc {garmentc.__version__}\n"


def test_inspect(run: CommandLine, glb: Path) -> None:
    document = json.loads(run("inspect", glb, "--json").out)
    assert document["bytes"] == glb.stat().st_size == sum(document["bytes_by_kind"].values())
    text = run("inspect", glb).out
    for word in ("GARMENTC_mesh_pose_keys", "morph targets", "cloth", "hem", "steps", "image/png"):
        assert word in text


def test_validate_finds_nothing_in_our_own_files(run: CommandLine, glb: Path) -> None:
    assert run("validate", glb).code == 0
    assert json.loads(run("validate", glb, "--json").out) == []


def test_validate_finds_a_fault(run: CommandLine, glb: Path, tmp_path: Path) -> None:
    data = glb.read_bytes()
    spoilt = tmp_path / "spoilt.glb"
    spoilt.write_bytes(data.replace(b'"left_knee', b'"left_knie').replace(b'\\"left_knee', b'\\"left_knie'))
    result = run("validate", spoilt)
    assert result.code == 1
    assert "left_knie" in result.out
    assert json.loads(run("validate", spoilt, "--json").out)[0]["severity"] == "error"


def test_diff(run: CommandLine, folder: Path, glb: Path, tmp_path: Path) -> None:
    assert run("diff", glb, glb).out == "no differences\n"
    other = tmp_path / "other.glb"
    garmentc.compile_outfit(
        folder / "top.obj",
        other,
        gender="female",
        motion=folder / "steps.npz",
        motion_up="y",
        animation_morphs=0,
        quantize=False,
    )
    result = run("diff", glb, other, "-t", "position=1e-7")
    assert result.code == 1
    assert "POSITION" in result.out
    assert run("diff", glb, other, *(f"--tolerance={name}=2" for name in ("position", "normal", "weight"))).code == 0
    assert "choose from position" in run.fails("diff", glb, other, "-t", "smell=1")
    assert "position=1e-4" in run.fails("diff", glb, other, "-t", "position")


def test_pose_at_frame_time_and_parameters_agree(run: CommandLine, folder: Path, glb: Path, tmp_path: Path) -> None:
    pose = np.load(folder / "steps.npz")["poses"][6]
    (tmp_path / "pose.json").write_text(json.dumps({"pose": pose.tolist()}))
    choices = {"frame": 6, "time": 6 / 24, "params": tmp_path / "pose.json"}
    posed = {}
    for name, value in choices.items():
        for suffix in ("ply", "obj"):
            output = tmp_path / f"{name}.{suffix}"
            assert run("pose", glb, "-o", output, f"--{name}", value).code == 0
            posed[name, suffix] = np.asarray(trimesh.load(output, process=False).vertices)
    assert np.abs(posed["frame", "ply"] - posed["frame", "obj"]).max() < 1e-9
    run("pose", glb, "-o", tmp_path / "named.ply", "--frame", choices["frame"], "--animation", "steps")
    assert (tmp_path / "named.ply").read_bytes() == (tmp_path / "frame.ply").read_bytes()
    assert np.abs(posed["frame", "ply"] - posed["time", "ply"]).max() < 1e-6
    assert np.abs(posed["frame", "ply"] - posed["params", "ply"]).max() < 1e-3  # keyframes were left out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--frame", "9"], "ends after 0.333 s"),
        (["--frame", "0", "--animation", "1"], "has no animation '1'; it has "),
        (["--animation", "dance"], "has no animation 'dance'; it has "),
        (["--frame", "0", "--time", "0"], "choose one"),
        (["-o", "a.stl"], "name the file .obj or .ply"),
        (["-o", "/nowhere/a.obj"], "does not exist"),
    ],
)
def test_pose_that_there_is_not(
    run: CommandLine, glb: Path, tmp_path: Path, arguments: list[str], message: str
) -> None:
    assert message in run.fails("pose", glb, "-o", tmp_path / "a.obj", *arguments)


def test_body_at_betas_and_pose(run: CommandLine, tmp_path: Path) -> None:
    pose = sample_poses(1, seed=2)[0]
    params, output = tmp_path / "params.json", tmp_path / "body.ply"
    params.write_text(json.dumps({"gender": "female", "pose": pose.tolist()}))
    result = run("body", "--params", params, "--betas", "1.5,-1", "-o", output, "--json")
    expected = load_default_body("female").posed(pose, np.array([1.5, -1]))
    np.testing.assert_allclose(trimesh.load(output, process=False).vertices, expected, atol=1e-6)
    facts = json.loads(result.out)
    assert (facts["gender"], facts["vertices"], facts["joints"]) == ("female", 7002, 24)


def test_evaluate(run: CommandLine, folder: Path, glb: Path) -> None:
    result = run("evaluate", glb, "--motion", folder / "steps.npz", "--step", "4", "--json")
    assert result.code == 0, result.err
    rows = json.loads(result.out)
    assert [row["method"] for row in rows] == ["nearest", "compiled"]
    assert all(row["all"]["frames"] == 3 for row in rows)
    assert "| top | compiled | 3 |" in run("evaluate", glb, "--motion", folder / "steps.npz", "--step", "4").out


@pytest.mark.parametrize(
    "arguments",
    [
        ["pose", "a.glb", "-o", "a.obj", "--time", "nan"],
        ["evaluate", "a.glb", "--motion", "a.npz", "--open-arms", "nan"],
        ["diff", "a.glb", "a.glb", "-t", "position=nan"],
        ["diff", "a.glb", "a.glb", "-t", "position=-1e-5"],
    ],
)
def test_what_is_no_number_is_refused(run: CommandLine, arguments: list[str]) -> None:
    assert re.search("nan|-1e-05", run.fails(*arguments))
