"""`garmentc compile` and the Python API: what they print, write and report."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
from cli_samples import CommandLine, write_top

import garmentc
from garmentc.errors import GarmentcError
from garmentc.gltf.inspect import inspect_glb
from garmentc.gltf.read import read_glb
from garmentc.options import PROFILES, CompileOptions
from garmentc.outfit.obj import read_obj
from garmentc.schema import check_schema
from garmentc.smpl.pose_sampler import sample_poses


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> CommandLine:
    return CommandLine(capsys)


@pytest.fixture
def top(tmp_path: Path) -> Path:
    return write_top(tmp_path)


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("motion") / "steps.npz"
    poses = sample_poses(12, seed=5).reshape(12, 72)
    trans = np.linspace(0, 1, 12)[:, None] * [0.0, 0.0, 1.0]
    np.savez(path, poses=poses, trans=trans, mocap_framerate=24.0, gender="female", betas=np.zeros(10))
    return path


def test_a_compile_reports_what_it_did(run: CommandLine, tmp_path: Path, top: Path, motion: Path) -> None:
    output, report = tmp_path / "top.glb", tmp_path / "report.json"
    arguments = ["--gender", "female", "--motion", motion, "--motion-up", "y", "--report", report]
    result = run("compile", top, "-o", output, *arguments)
    assert result.code == 0, result.err
    assert result.err == ""
    for word in ("metres, Y up, facing Z, T-pose, female body", "1170 vertices", "12 frames at 24 fps", str(output)):
        assert word in result.out
    document = json.loads(report.read_text())
    check_schema(document, "report")
    assert document["output"]["bytes"] == output.stat().st_size
    assert document["output"]["sha256"] == hashlib.sha256(output.read_bytes()).hexdigest()
    assert document["input"]["sha256"] == hashlib.sha256(top.read_bytes()).hexdigest()
    assert [stage["name"] for stage in document["stages"]] == ["read", "align", "infer", "optimise", "emit"]
    assert document["outfit"]["materials"] == ["cloth", "hem"]
    assert document["outfit"]["vertices"] == document["outfit"]["welded"] == 1170
    assert document["outfit"]["texcoords"] == "authored"
    assert document["outfit"]["corners"] > 1170  # split between the materials
    lossy = {step["name"] for step in document["passes"] if step["error"] is not None}
    assert {"limit influences", "reduce blend shapes"} <= lossy


def test_the_fabric_makes_a_difference_and_must_be_known(run: CommandLine, tmp_path: Path, top: Path) -> None:
    made = {}
    for fabric in (None, "silk", "leather"):
        report = garmentc.compile_outfit(top, tmp_path / "a.glb", gender="female", fabric=fabric)
        assert report.model.fabric == fabric
        made[fabric] = read_glb(tmp_path / "a.glb").meshes[0].primitives[0].morph_positions
    assert np.abs(made["silk"] - made["leather"]).max() > 1e-3
    assert np.abs(made["silk"] - made[None]).max() > 1e-4
    result = run("compile", top, "-o", tmp_path / "b.glb", "--fabric", "tweed")
    assert result.code == 2
    assert "knows no fabric 'tweed'; choose one of cotton, silk, denim, leather" in result.err
    assert not (tmp_path / "b.glb").exists()


def test_json_goes_to_stdout_and_warnings_to_stderr(run: CommandLine, tmp_path: Path, top: Path) -> None:
    (tmp_path / "weave.png").unlink()
    arguments = ["compile", top, "-o", tmp_path / "a.glb", "--gender", "female"]
    result = run(*arguments, "--json")
    assert result.code == 0, result
    document = json.loads(result.out)
    check_schema(document, "report")
    assert result.err.startswith("garmentc: warning: ")
    assert len(result.err.splitlines()) == len(document["warnings"]) == 1
    assert "weave.png" in document["warnings"][0]["message"]
    assert run(*arguments, "--quiet") == replace(result, out="", err="")


def test_missing_material_library_is_a_warning(run: CommandLine, tmp_path: Path, top: Path) -> None:
    (tmp_path / "top.mtl").unlink()
    result = run("compile", top, "-o", tmp_path / "a.glb", "--gender", "female", "-q", "--json")
    assert result.code == 0
    assert any("top.mtl" in entry["message"] for entry in json.loads(result.out)["warnings"])


@pytest.mark.parametrize(
    ("mode", "said", "entry"),
    [("auto", ", texture coordinates made", "made"), ("never", ", no texture coordinates", "none")],
)
def test_made_texture_coordinates_are_reported(
    run: CommandLine, tmp_path: Path, mode: str, said: str, entry: str
) -> None:
    plain, report = tmp_path / "plain.obj", tmp_path / "r.json"
    plain.write_text("v 0 0.2 0.15\nv 0.1 0.2 0.15\nv 0 0.3 0.15\nf 1 2 3\n")
    arguments = ["--gender", "female", "--units", "m", "--up", "y", "--front", "z", "--report", report]
    result = run("compile", plain, "-o", tmp_path / "a.glb", "--unwrap", mode, "--profile", "mobile", *arguments)
    assert result.code == 0, result
    assert f"1 triangles{said}" in result.out
    document = json.loads(report.read_text())
    check_schema(document, "report")
    assert document["outfit"]["texcoords"] == entry


def test_a_texture_outside_the_folder_needs_a_word(run: CommandLine, tmp_path: Path) -> None:
    folder = tmp_path / "asset"
    folder.mkdir()
    top = write_top(folder)
    (folder / "weave.png").rename(tmp_path / "weave.png")
    materials = folder / "top.mtl"
    materials.write_text(materials.read_text().replace("weave.png", "../weave.png"))
    line = run.fails("compile", top, "-o", tmp_path / "a.glb")
    assert f"{materials}:3: '../weave.png' lies outside" in line
    assert "--allow-external-textures" in line
    assert not (tmp_path / "a.glb").exists()
    allowed = run("compile", top, "-o", tmp_path / "a.glb", "--allow-external-textures", "--json", "-q")
    assert json.loads(allowed.out)["outfit"]["textures"] == 1


def test_command_line_and_python_api_make_the_same_bytes(
    run: CommandLine, tmp_path: Path, top: Path, motion: Path
) -> None:
    cli, api = tmp_path / "cli.glb", tmp_path / "api.glb"
    run(
        *("compile", top, "-o", cli, "--profile", "desktop", "--betas", "1,-0.5", "--gender", "female"),
        *("--morphs", 5, "--animation-morphs", 2, "--influences", 4, "--no-pose-keys"),
        *("--motion", motion, "--motion-up", "y", "--name", "x"),
    )
    progress: list[tuple[str, float]] = []
    report = garmentc.compile_outfit(
        str(top),
        str(api),
        CompileOptions(profile="desktop", betas=(1, -0.5), morphs=3),
        on_progress=lambda stage, done: progress.append((stage, done)),
        gender="female",
        morphs=5,
        animation_morphs=2,
        influences=4,
        pose_keys=False,
        motion=str(motion),
        motion_up="y",
        name="x",
    )
    assert progress == [("read", 0), ("align", 0), ("infer", 0), ("infer", 1), ("optimise", 0), ("emit", 0)]
    assert api.read_bytes() == cli.read_bytes()
    assert report.rig.morphs == 5 + 2
    assert report.alignment.betas == (1.0, -0.5)


def test_wrong_options_of_the_api_are_refused(tmp_path: Path, top: Path) -> None:
    with pytest.raises(GarmentcError, match="profile is 'huge'; choose one of mobile, web, desktop, reference"):
        garmentc.compile_outfit(top, tmp_path / "a.glb", profile="huge")
    with pytest.raises(TypeError, match="colour"):
        garmentc.compile_outfit(top, tmp_path / "a.glb", colour="red")


@pytest.mark.parametrize("profile", PROFILES)
def test_profiles(tmp_path: Path, top: Path, profile: str) -> None:
    output = tmp_path / "a.glb"
    report = garmentc.compile_outfit(top, output, profile=profile, gender="female")
    settings = PROFILES[profile]
    summary = inspect_glb(read_glb(output))
    assert not [finding for finding in summary.findings if finding.severity == "error"]
    assert len(summary.morphs) == report.rig.morphs == (settings.morphs or 128)
    assert max(primitive.influences for primitive in summary.primitives) <= settings.influences
    stored = {primitive.attributes["POSITION"] for primitive in summary.primitives}
    assert stored == ({"int16 normalised"} if settings.quantize else {"float32"})
    assert summary.pose_keys


def test_rest_pose_of_the_reference_profile_is_the_authored_mesh(tmp_path: Path, top: Path, run: CommandLine) -> None:
    output = tmp_path / "a.glb"
    garmentc.compile_outfit(top, output, profile="reference", gender="female")
    assert run("pose", output, "-o", tmp_path / "rest.obj").code == 0
    authored, posed = read_obj(top).vertices, read_obj(tmp_path / "rest.obj").vertices
    for left, right in ((authored, posed), (posed, authored)):
        assert np.linalg.norm(left[:, None] - right[None], axis=2).min(axis=1).max() < 1e-6


def test_parameters_file_gives_what_the_options_do_not(tmp_path: Path, top: Path) -> None:
    params = tmp_path / "params.json"
    params.write_text(json.dumps({"gender": "female", "betas": [0.5]}))
    report = garmentc.compile_outfit(top, tmp_path / "a.glb", params=params)
    assert (report.alignment.gender, report.alignment.betas) == ("female", (0.5,))
    report = garmentc.compile_outfit(top, tmp_path / "a.glb", params=params, gender="neutral", betas=[])
    assert (report.alignment.gender, report.alignment.betas) == ("neutral", ())


def test_pose_keys_as_onnx_are_the_ones_in_the_glb(tmp_path: Path, top: Path) -> None:
    from garmentc.gltf.posing import state_at_pose

    output, keys = tmp_path / "a.glb", tmp_path / "keys.onnx"
    garmentc.compile_outfit(top, output, gender="female", keys_onnx=keys)
    asset = read_glb(output)
    poses = sample_poses(5, seed=1)
    session = onnxruntime.InferenceSession(keys, providers=["CPUExecutionProvider"])
    found = session.run(["keys"], {"pose": poses.astype(np.float32)})[0]
    expected = np.array([state_at_pose(asset, pose).weights[asset.mesh_nodes[0]] for pose in poses])
    np.testing.assert_allclose(found, expected, atol=1e-3)  # float32; keys of faint shapes have large factors
    shapes = np.concatenate([part.morph_positions for part in asset.meshes[0].primitives], axis=1)
    assert np.linalg.norm(np.tensordot(found - expected, shapes, axes=1), axis=-1).max() < 1e-5  # metres


def test_several_motions_become_several_animations(tmp_path: Path, top: Path, motion: Path) -> None:
    other = tmp_path / "other.npz"
    np.savez(other, poses=sample_poses(3, seed=9).reshape(3, 72), trans=np.zeros((3, 3)), mocap_framerate=10.0)
    output = tmp_path / "a.glb"
    folder = tmp_path / "take2"
    folder.mkdir()
    namesake = other.rename(folder / "steps.npz")
    np.savez(other, poses=sample_poses(3, seed=8).reshape(3, 72), trans=np.zeros((3, 3)), mocap_framerate=10.0)
    report = garmentc.compile_outfit(top, output, gender="female", motion=[motion, other, namesake], motion_up="y")
    asset = read_glb(output)
    assert [animation.name for animation in asset.animations] == ["steps", "other", "steps_2"]
    assert (asset.extras["fps:steps"], asset.extras["fps:steps_2"]) == (24.0, 10.0)
    assert [warning.code for warning in report.warnings] == ["motion-renamed"]
