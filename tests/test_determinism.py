"""The same input gives the same bytes, whatever the process, its hash seed, its threads and its folder."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cli_samples import write_top

from garmentc.smpl.pose_sampler import sample_poses


@pytest.fixture(scope="module")
def outfit(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("outfit")
    np.savez(folder / "motion.npz", poses=sample_poses(20, seed=5).reshape(20, 72), mocap_framerate=30.0,
             trans=np.zeros((20, 3)))  # fmt: skip
    return write_top(folder)


def compiled(outfit: Path, folder: Path, hash_seed: str, threads: int) -> bytes:
    """The bytes of a .glb made by a new process that may use `threads` cores."""
    folder.mkdir()
    variables = {name: str(threads) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    command = [sys.executable, "-m", "garmentc", "compile", str(outfit), "-o", "out.glb", "--quiet"]
    command += ["--motion", str(outfit.parent / "motion.npz"), "--keys-onnx", "keys.onnx"]
    if threads == 1 and hasattr(os, "sched_setaffinity"):
        core = min(os.sched_getaffinity(0))
        command = [sys.executable, "-c", _ON_ONE_CORE, str(core), *command[1:]]
    subprocess.run(command, cwd=folder, env={**os.environ, **variables, "PYTHONHASHSEED": hash_seed}, check=True)
    return (folder / "out.glb").read_bytes() + (folder / "keys.onnx").read_bytes()


_ON_ONE_CORE = """
import os, sys
os.sched_setaffinity(0, {int(sys.argv[1])})
os.execv(sys.executable, [sys.executable, *sys.argv[2:]])
"""


def test_bytes_depend_on_the_input_alone(outfit: Path, tmp_path: Path) -> None:
    first = compiled(outfit, tmp_path / "a", hash_seed="0", threads=2)
    assert compiled(outfit, tmp_path / "b", hash_seed="0", threads=2) == first
    assert compiled(outfit, tmp_path / "c", hash_seed="4711", threads=1) == first
    assert compiled(outfit, tmp_path / "d", hash_seed="random", threads=4) == first
