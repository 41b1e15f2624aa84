"""examples/runtime/viewer.html in headless Chromium: the same with baked keys and live, and joints to drag."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import engine_runs
import numpy as np
import pytest
from PIL import Image
from runtime_runs import EXAMPLES, PROGRAMS, network_of, node
from scipy.spatial.transform import Rotation

import garmentc
from garmentc import emission
from garmentc.gltf.asset import GltfOptions
from garmentc.rig import KeyNetwork
from garmentc.smpl.skeleton import JOINT_NAMES


@dataclass(frozen=True)
class Viewed:
    """What viewer.mjs says about the first example with all its keyframes, and the folder of its pictures."""

    network: KeyNetwork
    said: dict[str, Any]
    folder: Path

    def picture(self, name: str) -> np.ndarray:
        """(H, W, 3) of 0 to 255, without the bar below."""
        return np.asarray(Image.open(self.folder / f"{name}.png").convert("RGB"))[:480].astype(np.int32)

    def difference(self, one: str, other: str) -> float:
        """Mean over all pixels and colours."""
        return float(np.abs(self.picture(one) - self.picture(other)).mean())


@pytest.fixture(scope="module")
def viewed(tmp_path_factory: pytest.TempPathFactory) -> Viewed:
    engine_runs.require_engines()
    if shutil.which(engine_runs.chromium()) is None:
        pytest.skip("the viewer is tested in Chromium, which is not installed (CHROMIUM names it)")
    folder = tmp_path_factory.mktemp("viewed")
    motion = (EXAMPLES / "motions" / "step_turn_raise.npz",)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(emission, "GltfOptions", partial(GltfOptions, key_tolerance=0))
        garmentc.compile_outfit(EXAMPLES / "tee_and_skirt.obj", folder / "a.glb", motion=motion, animation_morphs=0)
    times = [str(float(np.float32(frame / 30))) for frame in (43, 78)]
    said = json.loads(node(PROGRAMS / "viewer.mjs", folder / "a.glb", folder, *times))
    return Viewed(network_of(folder / "a.glb"), said, folder)


def test_the_viewer_shows_the_same_live_and_baked(viewed: Viewed) -> None:
    assert viewed.said["complaints"] == []
    for number, frame in enumerate(viewed.said["frames"]):
        assert np.abs(frame["baked"]).max() > 0.1
        np.testing.assert_allclose(frame["live"], frame["baked"], atol=1e-4, rtol=0)
        assert viewed.difference(f"baked-{number}", f"live-{number}") < 1e-3
    assert viewed.difference("live-0", "live-1") > 1
    assert viewed.difference("live-1", "without") > 0.1


def test_a_dragged_joint_moves_the_cloth(viewed: Viewed) -> None:
    dragged = viewed.said["dragged"]
    np.testing.assert_allclose(viewed.said["rest"], 0, atol=1e-4)
    pose = Rotation.from_quat(dragged["rotations"]).as_rotvec()
    assert [JOINT_NAMES[joint] for joint in np.flatnonzero(np.linalg.norm(pose, axis=1) > 1e-6)] == ["left_shoulder"]
    assert dragged["elbow"]["y"] - dragged["from"]["y"] > 40  # down, with the pointer
    np.testing.assert_allclose(dragged["weights"], [viewed.network(pose)], atol=1e-5, rtol=0)
    assert viewed.difference("rest", "dragged") > 0.5
