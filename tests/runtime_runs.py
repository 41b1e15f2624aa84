"""Runs the programs in tests/runtime, which use examples/runtime as an engine's developers do."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import engine_runs
import pytest

from garmentc.gltf.read import read_glb
from garmentc.rig import KeyNetwork

PROGRAMS = Path(__file__).parent / "runtime"
EXAMPLES = Path(__file__).parents[1] / "examples"


def node(*command: str | Path) -> str:
    """What node prints; the test is skipped where it is missing."""
    if shutil.which("node") is None:
        pytest.skip("node is not installed; the runtime's tests need node 20.11 or later")
    environment = {**os.environ, "CHROMIUM": shutil.which(engine_runs.chromium()) or ""}
    command = ("node", *map(str, command))
    result = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert result.returncode == 0, result.stderr
    return result.stdout


def network_of(glb: Path) -> KeyNetwork:
    """The pose-key network of the first mesh."""
    found = read_glb(glb).meshes[0].pose_keys
    assert found is not None
    return KeyNetwork(found.layers, found.encoding)
