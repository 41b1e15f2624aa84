"""Every failure that a user can cause: one line that says what to do, exit code 2, nothing half-written."""

from __future__ import annotations

import json
import os
import pickle
import shutil
from pathlib import Path

import numpy as np
import onnx
import pytest
from cli_samples import CommandLine, write_top

from garmentc.families.bundle import DEFAULT_BUNDLE

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> CommandLine:
    return CommandLine(capsys)


@pytest.fixture
def top(tmp_path: Path) -> Path:
    return write_top(tmp_path)


@pytest.fixture
def output(tmp_path: Path) -> Path:
    """An earlier result, which no failure may touch."""
    path = tmp_path / "out.glb"
    path.write_bytes(b"earlier")
    return path


@pytest.fixture(autouse=True)
def _nothing_is_written(tmp_path: Path, output: Path, request: pytest.FixtureRequest) -> object:
    yield
    assert output.read_bytes() == b"earlier"
    assert not list(tmp_path.glob(".*.tmp"))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"# only a comment\n", "no vertices and no faces"),
        (bytes(range(256)) * 40, "binary"),
        (TRIANGLE.encode(), "no faces"),
        (TRIANGLE.encode() + b"f 1 2\n", ":4: "),
        (TRIANGLE.encode() + b"f 1 2 4\n", ":4: face refers to 'v' number 4, but the file has 3"),
        (TRIANGLE.encode() + b"f 1 2 -4\n", ":4: "),
        (TRIANGLE.encode() + b"f 1/1 2/1 3/1\n", ":4: face refers to 'vt' number 1, but the file has 0"),
        (b"v 0 0 nan\n" + TRIANGLE.encode() + b"f 1 2 3\n", ":1: "),
        (b"v 0 0 0\nv 1 0\n" + b"f 1 2 1\n", ":2: "),
        (b"v 0 0 0\nv 1e400 0 0\nv 0 1 0\nf 1 2 3\n", ":2: "),
        (b"v 0 0 0\nv one 0 0\nv 0 1 0\nf 1 2 3\n", ":2: "),
        (TRIANGLE.encode() + b"f 1 2 3\nv 0 0.1", ":5: "),
        (b"v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", "no area"),
        (b"v 0 1000000 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", "no area"),
    ],
    ids=[
        "empty", "comments", "binary", "no faces", "two corners", "index", "negative index", "texcoord index", "nan",
        "two numbers", "infinite", "word", "truncated", "flat", "far thinner than long",
    ],
)  # fmt: skip
def test_obj(run: CommandLine, tmp_path: Path, output: Path, content: bytes, message: str) -> None:
    path = tmp_path / "outfit.obj"
    path.write_bytes(content)
    line = run.fails("compile", path, "-o", output)
    assert str(path) in line
    assert message in line


def test_obj_that_is_not_there(run: CommandLine, tmp_path: Path, output: Path) -> None:
    line = run.fails("compile", tmp_path / "nothing.obj", "-o", output)
    assert "nothing.obj: no such file" in line
    assert "folder" in run.fails("compile", tmp_path, "-o", output)


@pytest.mark.parametrize("name", ["outfit.gltf", "outfit"])
def test_output_that_engines_would_not_take_for_a_glb(run: CommandLine, top: Path, tmp_path: Path, name: str) -> None:
    assert "name a .glb" in run.fails("compile", top, "-o", tmp_path / name)
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--betas", "1,x"], "numbers"),
        (["--betas", "1,nan"], "people are within about 3"),
        (["--betas", "1e300"], "people are within about 3"),
        (["--betas", "1,2,3,4,5,6,7,8,9,10,11"], "has 10; leave the rest out"),
        (["--morph-tolerance", "3"], "0.5mm"),
        (["--morph-tolerance", "..mm"], "0.5mm"),
        (["--report", "-"], "'-' is no file"),
        (["--report", ""], "is empty"),
        (["--influences", "5"], "'4', '8'"),
        (["--profile", "huge"], "'mobile', 'web', 'desktop', 'reference'"),
        (["--morphs", "4", "--morph-tolerance", "1mm"], "choose one"),
        (["--up", "y", "--front", "y"], "choose two different axes"),
        (["--nonsense"], "garmentc compile --help"),
    ],
)
def test_arguments(run: CommandLine, top: Path, output: Path, arguments: list[str], message: str) -> None:
    assert message in run.fails("compile", top, "-o", output, *arguments)


def test_command_that_does_not_exist(run: CommandLine) -> None:
    assert "garmentc --help" in run.fails("knit")


class Evil:
    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.system, (f"touch {Evil.trace}",)

    trace = ""


def test_malicious_pickle_as_body(run: CommandLine, tmp_path: Path, top: Path, output: Path) -> None:
    Evil.trace = str(tmp_path / "was-here")
    body = tmp_path / "model.pkl"
    body.write_bytes(pickle.dumps({"v_template": Evil()}))
    line = run.fails("compile", top, "-o", output, "--body", body)
    assert "system" in line
    assert not Path(Evil.trace).exists()


def test_malicious_npz_as_body_and_as_motion(run: CommandLine, tmp_path: Path, top: Path, output: Path) -> None:
    Evil.trace = str(tmp_path / "was-here")
    path = tmp_path / "evil.npz"
    evil = np.array([Evil()], dtype=object)
    np.savez(path, v_template=evil, poses=evil)
    for option in ("--body", "--motion", "--params"):
        assert str(path) in run.fails("compile", top, "-o", output, option, path)
    assert not Path(Evil.trace).exists()


def test_body_with_the_wrong_number_of_joints(run: CommandLine, tmp_path: Path, top: Path, output: Path) -> None:
    path = tmp_path / "model.npz"
    np.savez(
        path,
        v_template=np.zeros((10, 3)),
        f=np.array([[0, 1, 2]]),
        weights=np.full((10, 19), 1 / 19),
        shapedirs=np.zeros((10, 3, 10)),
        posedirs=np.zeros((10, 3, 162)),
        J_regressor=np.full((19, 10), 0.1),
        kintree_table=np.stack([np.arange(-1, 18), np.arange(19)]),
    )
    line = run.fails("compile", top, "-o", output, "--body", path)
    assert "19" in line
    assert "24" in line


@pytest.mark.parametrize("shape", [(5, 71), (72,), (5, 24), (0, 72), (2, 3, 4, 5)])
def test_motion_with_poses_of_a_bad_shape(
    run: CommandLine, tmp_path: Path, top: Path, output: Path, shape: tuple[int, ...]
) -> None:
    path = tmp_path / "motion.npz"
    np.savez(path, poses=np.zeros(shape), trans=np.zeros((5, 3)), mocap_framerate=30.0)
    line = run.fails("compile", top, "-o", output, "--motion", path)
    assert "poses" in line


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ("{", ":1: is not JSON"),
        ('{"gender": "other"}', "gender"),
        ('{"betas": "many"}', "betas"),
        ('{"pose": [1, 2, 3]}', "pose"),
        ('{"shoes": 1}', "shoes"),
    ],
)
def test_parameters(run: CommandLine, tmp_path: Path, top: Path, output: Path, document: str, message: str) -> None:
    path = tmp_path / "params.json"
    path.write_text(document)
    line = run.fails("compile", top, "-o", output, "--params", path)
    assert str(path) in line
    assert message in line


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    """A copy of the bundle that ships with garmentc, to be spoilt."""
    return Path(shutil.copytree(DEFAULT_BUNDLE, tmp_path / "bundle"))


def test_bundle_that_is_not_there(run: CommandLine, tmp_path: Path, top: Path, output: Path) -> None:
    assert "manifest.json" in run.fails("compile", top, "-o", output, "--bundle", tmp_path / "nothing")


def test_bundle_with_a_bad_hash(run: CommandLine, top: Path, output: Path, bundle: Path) -> None:
    with (bundle / "outfit.onnx").open("ab") as file:
        file.write(b"\0")
    line = run.fails("compile", top, "-o", output, "--bundle", bundle)
    assert "SHA-256" in line
    assert "outfit.onnx" in line


def rewrite(bundle: Path, model: onnx.ModelProto) -> None:
    """Put `model` in place of the outfit graph, with its right hash."""
    import hashlib

    data = model.SerializeToString()
    (bundle / "outfit.onnx").write_bytes(data)
    manifest = json.loads((bundle / "manifest.json").read_text())
    manifest["files"]["outfit"]["sha256"] = hashlib.sha256(data).hexdigest()
    (bundle / "manifest.json").write_text(json.dumps(manifest))


def test_bundle_with_a_missing_input(run: CommandLine, top: Path, output: Path, bundle: Path) -> None:
    model = onnx.load(bundle / "outfit.onnx")
    model.graph.input[0].name = "something_else"
    rewrite(bundle, model)
    assert "vertices" in run.fails("compile", top, "-o", output, "--bundle", bundle)


def test_bundle_with_data_in_another_file(run: CommandLine, top: Path, output: Path, bundle: Path) -> None:
    model = onnx.load(bundle / "outfit.onnx")
    onnx.external_data_helper.convert_model_to_external_data(model, location="weights.bin", size_threshold=0)
    onnx.save(model, bundle / "outfit.onnx")
    rewrite(bundle, onnx.load(bundle / "outfit.onnx", load_external_data=False))
    line = run.fails("compile", top, "-o", output, "--bundle", bundle)
    assert "another file" in line


def test_bundle_without_a_manifest_entry(run: CommandLine, top: Path, output: Path, bundle: Path) -> None:
    manifest = json.loads((bundle / "manifest.json").read_text())
    del manifest["pose_encoding"]
    (bundle / "manifest.json").write_text(json.dumps(manifest))
    assert "pose_encoding" in run.fails("compile", top, "-o", output, "--bundle", bundle)


def test_output_that_cannot_be_written(run: CommandLine, tmp_path: Path, top: Path) -> None:
    (tmp_path / "file").touch()
    assert "does not exist" in run.fails("compile", top, "-o", tmp_path / "missing" / "out.glb")
    assert "is a file" in run.fails("compile", top, "-o", tmp_path / "file" / "out.glb")
    assert "it is a folder" in run.fails("compile", top, "-o", tmp_path)
    assert "does not exist" in run.fails("compile", top, "-o", tmp_path / "a.glb", "--report", "/nowhere/r.json")
    assert "does not exist" in run.fails("compile", top, "-o", tmp_path / "a.glb", "--keys-onnx", "/nowhere/k.onnx")
    assert not (tmp_path / "a.glb").exists()


def test_output_over_an_input(run: CommandLine, tmp_path: Path, top: Path) -> None:
    content = top.read_bytes()
    for arguments in (
        ["-o", top],
        ["-o", tmp_path / "a.glb", "--report", top],
        ["-o", tmp_path / "a.glb", "--keys-onnx", top],
    ):
        assert "name another file" in run.fails("compile", top, *arguments)
    assert top.read_bytes() == content
    assert not (tmp_path / "a.glb").exists()


def test_output_in_a_read_only_folder(run: CommandLine, tmp_path: Path, top: Path) -> None:
    folder = tmp_path / "locked"
    folder.mkdir()
    folder.chmod(0o555)
    if os.access(folder, os.W_OK):  # root may write anywhere but here
        folder = Path("/sys/kernel")
    line = run.fails("compile", top, "-o", folder / "out.glb")
    assert "writing there is not allowed" in line or "read-only" in line


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_full_disk(run: CommandLine, top: Path) -> None:
    assert "the disk is full" in run.fails("compile", top, "-o", "/dev/full")


@pytest.mark.parametrize("command", [["inspect"], ["validate"], ["pose", "-o", "a.obj"]])
@pytest.mark.parametrize("content", [b"", b"glTF", b"solid mesh" * 10, None])
def test_glb_that_is_none(
    run: CommandLine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: list[str], content: bytes | None
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "in.glb"
    if content is not None:
        path.write_bytes(content)
    assert str(path) in run.fails(command[0], path, *command[1:])


def test_unexpected_failures_of_the_machine_are_told_in_one_line(
    run: CommandLine, top: Path, output: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from garmentc import pipeline

    for error, message in (
        (MemoryError(), "out of memory"),
        (PermissionError(13, "Permission denied", "/some/file"), "/some/file: Permission denied"),
        (OSError(28, "No space left on device"), "No space left on device"),
    ):

        def fail(*arguments: object, error: BaseException = error) -> None:
            raise error

        monkeypatch.setattr(pipeline, "weld", fail)
        assert message in run.fails("compile", top, "-o", output)


def test_a_bug_still_shows_its_traceback(
    run: CommandLine, top: Path, output: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from garmentc import pipeline

    monkeypatch.setattr(pipeline, "weld", lambda outfit: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        run("compile", top, "-o", output)


def test_a_reader_that_leaves_early_is_no_failure() -> None:
    import subprocess
    import sys

    process = subprocess.Popen(
        [sys.executable, "-m", "garmentc", "--help"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    assert process.stderr.read() == b""
    process.wait()
