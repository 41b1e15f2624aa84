"""Runs the programs in tests/engines on .glb files. Install their packages with `npm ci` in that folder."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from garmentc.rig import Rig

ENGINES = Path(__file__).parent / "engines"


def require_engines() -> None:
    """Skip the test where node or the packages are missing."""
    if shutil.which("node") is None:
        pytest.skip("node is not installed; engine tests need node 20.11 or later")
    if not (ENGINES / "node_modules").is_dir():
        pytest.skip("tests/engines/node_modules is missing; run `npm ci` in tests/engines")


def chromium() -> str:
    """The browser's command; the environment variable CHROMIUM replaces it."""
    return os.environ.get("CHROMIUM", "chromium")


@dataclass(frozen=True)
class Refused:
    """Why an engine gives nothing for a file, in its own words."""

    reason: str


def attempt(program: str, jobs: list[dict[str, Any]], folder: Path, python: Path | None = None) -> list[Path | Refused]:
    """Run `program` on all jobs in one process; the files that it wrote, one for each job, or why it did not.

    python  interpreter of a program in Python; the others run in node
    """
    require_engines()
    outs = [folder / f"{Path(program).stem}-{number}" for number in range(len(jobs))]
    errors = [out.with_name(f"{out.name}.error") for out in outs]
    for file in (*outs, *errors):
        file.unlink(missing_ok=True)
    listed = [{**job, "out": str(out)} for job, out in zip(jobs, outs, strict=True)]
    (folder / "jobs.json").write_text(json.dumps(listed))
    command = [python or "node", str(ENGINES / program), str(folder / "jobs.json")]
    result = subprocess.run(command, cwd=ENGINES, capture_output=True, text=True, check=False)
    broken = f"{program} ended early: {result.stderr.strip()}"
    return [
        out if out.exists() else Refused(error.read_text().strip() if error.exists() else broken)
        for out, error in zip(outs, errors, strict=True)
    ]


def run(program: str, jobs: list[dict[str, Any]], folder: Path) -> list[Path]:
    """`attempt` where every job must succeed."""
    outs = []
    for job, out in zip(jobs, attempt(program, jobs, folder), strict=True):
        assert isinstance(out, Path), f"{program} refuses {Path(job['glb']).name}: {out.reason}"
        outs.append(out)
    return outs


def khronos_reports(glbs: list[Path], folder: Path) -> list[dict[str, Any]]:
    """The Khronos validator's report on each file."""
    return [json.loads(out.read_text()) for out in run("validate.mjs", [{"glb": str(glb)} for glb in glbs], folder)]


def assert_valid(report: dict[str, Any]) -> None:
    """0 errors and 0 warnings."""
    issues = report["issues"]
    serious = [message for message in issues["messages"] if message["severity"] < 2]
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), serious[:5]


def animated_positions(program: str, glbs: list[Path], times: list[float], folder: Path) -> list[np.ndarray]:
    """World positions (T, S, 3) at times of each file's first animation.

    program  "gltf_transform.mjs", "three_cpu.mjs", "babylon.mjs", or "chromium.mjs" for three.js on the GPU
    """
    outs = run(program, [{"glb": str(glb), "times": times} for glb in glbs], folder)
    return [np.fromfile(out).reshape(len(times), -1, 3) for out in outs]


def posed_positions(glbs: list[Path], poses: np.ndarray, translations: np.ndarray, folder: Path) -> list[np.ndarray]:
    """World positions (T, S, 3) in poses (T, 24, 3), morph weights by three.js from each file's pose-key network."""
    found = []
    for glb, moved in zip(glbs, try_posed_positions(glbs, poses, translations, folder), strict=True):
        assert not isinstance(moved, Refused), f"{glb.name} is not driven: {moved.reason}"
        found.append(moved)
    return found


def try_posed_positions(
    glbs: list[Path], poses: np.ndarray, translations: np.ndarray, folder: Path
) -> list[np.ndarray | Refused]:
    """`posed_positions`, or why there are none."""
    listed = [
        {"rotations": pose.tolist(), "translation": moved.tolist()}
        for pose, moved in zip(poses, translations, strict=True)
    ]
    outs = attempt("three_pose_keys.mjs", [{"glb": str(glb), "poses": listed} for glb in glbs], folder)
    return [out if isinstance(out, Refused) else np.fromfile(out).reshape(len(poses), -1, 3) for out in outs]


def first_four(rig: Rig, normalized: bool = True) -> Rig:
    """The rig with the four largest influences of each vertex, scaled to sum to 1 as three.js does, or as they are."""
    weights = rig.weights.astype(np.float64)
    np.put_along_axis(weights, np.argsort(-weights, axis=1, kind="stable")[:, 4:], 0, axis=1)
    return replace(rig, weights=weights / weights.sum(axis=1, keepdims=True) if normalized else weights)
