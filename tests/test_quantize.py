"""The reported cost of quantization is that of the written file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gltf_samples import corner_vertices, make_asset

from garmentc.gltf.evaluate import world_mesh
from garmentc.gltf.posing import state_at_pose
from garmentc.gltf.read import read_glb
from garmentc.gltf.write import write_glb
from garmentc.passes.pose_set import plausible_poses
from garmentc.passes.quantize import Quantize, quantize

POSES = plausible_poses(fit=8, check=5)


@pytest.mark.parametrize("influences", [4, 8])
def test_the_error_is_that_of_the_file(tmp_path: Path, influences: int) -> None:
    asset = make_asset(influences=influences, quantize=True, uv=False, parts=1)
    asset = replace(asset, clips=())
    write_glb(asset, tmp_path / "gown.glb")
    _, report = quantize(asset.rig, Quantize(influences), POSES)
    written = read_glb(tmp_path / "gown.glb")
    # The network's own rounding is none of quantization's business, so the keys are given.
    keys = asset.rig.pose_keys(POSES.check)
    exact = asset.rig.posed(POSES.check)[:, corner_vertices(asset)]
    posed = [world_mesh(written, state_at_pose(written, p, keys=k))[0] for p, k in zip(POSES.check, keys, strict=True)]
    distance = 1000 * np.linalg.norm(np.array(posed) - exact, axis=-1)
    assert report.error is not None
    assert report.error.mean_mm == pytest.approx(distance.mean(), rel=0.02)
    assert report.error.max_mm == pytest.approx(distance.max(), rel=0.05)
    assert 0.001 < report.error.mean_mm < 0.1


def test_the_rig_stays_as_it_is() -> None:
    rig = make_asset().rig
    assert quantize(rig, Quantize(), POSES)[0] is rig
