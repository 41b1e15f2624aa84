"""The GLB container: layout, determinism, and what happens when writing fails."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pygltflib
import pytest
from gltf_samples import make_asset

from garmentc.errors import GarmentcError
from garmentc.gltf.glb import BinaryChunk, document_json, glb_writer, read_chunks
from garmentc.gltf.write import write_glb

TESTS = Path(__file__).parent


def run(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run `code` in a fresh Python that can import the samples."""
    paths = os.pathsep.join([str(TESTS), str(TESTS.parent)])
    environment = {**os.environ, "PYTHONPATH": paths, **environment}
    return subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)


def test_container_is_laid_out_as_the_specification_says(tmp_path: Path) -> None:
    write_glb(make_asset(), tmp_path / "a.glb")
    data = (tmp_path / "a.glb").read_bytes()
    assert struct.unpack_from("<4sII", data) == (b"glTF", 2, len(data))
    length, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    assert length % 4 == 0
    document = json.loads(data[20 : 20 + length])
    binary_length, kind = struct.unpack_from("<I4s", data, 20 + length)
    assert kind == b"BIN\0"
    assert 28 + length + binary_length == len(data)
    assert document["buffers"] == [{"byteLength": binary_length}]
    assert all(view["byteOffset"] % 4 == 0 for view in document["bufferViews"])


def test_pygltflib_reads_what_was_written(tmp_path: Path) -> None:
    write_glb(make_asset(morphs=3, parts=2), tmp_path / "a.glb")
    document = pygltflib.GLTF2().load(str(tmp_path / "a.glb"))
    assert len(document.meshes[0].primitives) == 2
    assert document.meshes[0].weights == [0.0, 0.0, 0.0]
    assert len(document.skins[0].joints) == 24
    assert document.scenes[0].nodes == [24, 25]
    assert document.nodes[25].skin == 0
    assert document.binary_blob() is not None


def test_equal_assets_give_equal_bytes_whatever_the_hash_seed(tmp_path: Path) -> None:
    files = [tmp_path / "1.glb", tmp_path / "2.glb"]
    for seed, file in enumerate(files, start=1):
        code = f"import gltf_samples, garmentc.gltf.write as w; w.write_glb(gltf_samples.make_asset(), {str(file)!r})"
        result = run(code, PYTHONHASHSEED=str(seed))
        assert result.returncode == 0, result.stderr
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.parametrize("failure", [OSError(28, "No space left on device"), KeyboardInterrupt(), ValueError("bug")])
def test_a_failure_leaves_the_former_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failure: BaseException
) -> None:
    target = tmp_path / "a.glb"
    target.write_bytes(b"former")

    def fail(self: BinaryChunk, file: object) -> None:
        raise failure

    monkeypatch.setattr(BinaryChunk, "copy_to", fail)
    with pytest.raises(GarmentcError if isinstance(failure, OSError) else type(failure)):
        write_glb(make_asset(), target)
    assert target.read_bytes() == b"former"
    assert list(tmp_path.iterdir()) == [target]


def test_running_out_of_space_says_so(tmp_path: Path) -> None:
    target = tmp_path / "a.glb"
    target.write_bytes(b"former")
    code = f"""
import resource
from gltf_samples import make_asset
from garmentc.errors import GarmentcError
from garmentc.gltf.write import write_glb
asset = make_asset()
resource.setrlimit(resource.RLIMIT_FSIZE, (30000, 30000))
try:
    write_glb(asset, {str(target)!r})
except GarmentcError as error:
    print(error)
"""
    result = run(code)
    assert "a.glb: cannot be written: the file grew beyond" in result.stdout, result.stderr
    assert target.read_bytes() == b"former"
    assert list(tmp_path.iterdir()) == [target]


def test_a_kill_leaves_the_former_file_whole(tmp_path: Path) -> None:
    target = tmp_path / "a.glb"
    target.write_bytes(b"former")
    code = f"""
import os, signal
from gltf_samples import make_asset
from garmentc.gltf import glb
from garmentc.gltf.write import write_glb
glb.os.fsync = lambda descriptor: os.kill(os.getpid(), signal.SIGKILL)
write_glb(make_asset(), {str(target)!r})
"""
    assert run(code).returncode == -9
    assert target.read_bytes() == b"former"


def test_missing_folder_is_an_error_with_a_remedy(tmp_path: Path) -> None:
    with pytest.raises(GarmentcError, match="folder does not exist"):
        write_glb(make_asset(), tmp_path / "nowhere" / "a.glb")


def test_nan_and_numpy_scalars_never_reach_the_json() -> None:
    with pytest.raises(ValueError, match="JSON compliant"):
        document_json(pygltflib.Node(translation=[float("nan"), 0.0, 0.0]))
    with pytest.raises(TypeError):
        document_json(pygltflib.Node(mesh=np.int32(1)))


def test_nan_in_the_rig_is_refused_and_named(tmp_path: Path) -> None:
    asset = make_asset(morphs=2)
    asset.rig.blend_shapes[1, 5, 0] = np.nan
    with pytest.raises(GarmentcError, match="blend shape 1"):
        write_glb(asset, tmp_path / "a.glb")
    assert not list(tmp_path.iterdir())


def test_a_document_without_binary_has_no_binary_chunk(tmp_path: Path) -> None:
    with glb_writer(tmp_path / "a.glb") as (document, _):
        document.asset = pygltflib.Asset(generator="test")
    chunks = read_chunks(tmp_path / "a.glb")
    assert chunks.document == {"asset": {"generator": "test", "version": "2.0"}}
    assert len(chunks.binary) == 0
