"""Gravity in every joint: in mirrored poses, and on the way from training to a .glb."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
from gltf_samples import make_asset, tube
from train_samples import SMALL_NETWORK, swinging_patches

from garmentc.families.bundle import load_bundle
from garmentc.gltf.posing import evaluate_network, state_at_pose
from garmentc.gltf.read import read_glb
from garmentc.gltf.validate import validate_glb
from garmentc.gltf.write import write_glb
from garmentc.pipeline import compile_outfit
from garmentc.rig import ENCODING_GRAVITY_JOINTS, encode_pose
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.smpl.skeleton import MIRROR

torch = pytest.importorskip("torch")

from garmentc.training.bundle_record import export_run  # noqa: E402
from garmentc.training.checkpoint import DataFacts, read_checkpoint  # noqa: E402
from garmentc.training.deepsd_network import Deepsd, DeepsdConfig  # noqa: E402
from garmentc.training.mirroring import mirrored_poses  # noqa: E402
from garmentc.training.recipe import DataStage, PhysicsStage, Recipe  # noqa: E402
from garmentc.training.simulated_outfits import read_outfits  # noqa: E402
from garmentc.training.train_deepsd import train  # noqa: E402
from garmentc.training.write_bundle import write_bundle  # noqa: E402

IGNORED = (7, 10, 15)


def made() -> Deepsd:
    torch.manual_seed(2)
    widths = {**SMALL_NETWORK, "pose_head": (90, 80), "keys": 39}
    network = Deepsd(DeepsdConfig(**widths, pose_encoding=ENCODING_GRAVITY_JOINTS, ignored_joints=IGNORED))  # type: ignore[arg-type]
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.add_(0.1 * torch.randn_like(parameter))
    return network


def gown(path: Path) -> Path:
    """A small outfit in a file."""
    vertices, triangles, _ = tube(16, 12)
    lines = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in triangles + 1]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_torch_bundle_graph_and_glb_agree(tmp_path: Path) -> None:
    network = made()
    write_bundle(network, tmp_path / "bundle", version="0", description="test", training={})
    bundle = load_bundle(tmp_path / "bundle")
    poses = sample_poses(30, seed=6)
    poses[:, 0] = np.random.default_rng(0).normal(size=(30, 3))
    poses[0], poses[1, 4] = 0, [0, 4.0, 0]
    with torch.no_grad():
        features = torch.from_numpy(encode_pose(poses, ENCODING_GRAVITY_JOINTS)).float()
        expected = network.pose_keys(features).numpy()
    assert np.abs(expected).max() > 0.05
    np.testing.assert_allclose(bundle.network(poses), expected, atol=5e-6)
    found = onnxruntime.InferenceSession(bundle.keys).run(None, {"pose": poses.astype(np.float32)})[0]
    np.testing.assert_allclose(found, expected, atol=5e-6)
    asset = make_asset(morphs=39)
    write_glb(replace(asset, rig=replace(asset.rig, keys=bundle.network)), tmp_path / "a.glb")
    assert [finding for finding in validate_glb(read_glb(tmp_path / "a.glb")) if finding.severity == "error"] == []
    glb = read_glb(tmp_path / "a.glb")
    for stored in (glb.meshes[0].pose_keys, glb.nodes[25].pose_keys):
        assert stored is not None
        keys = [evaluate_network(glb, stored, state_at_pose(glb, pose)) for pose in poses]
        np.testing.assert_allclose(keys, bundle.network(poses), atol=1e-9)


def test_gravity_in_joints_is_mirrored_as_poses_are() -> None:
    poses = sample_poses(5, seed=3)
    flip, turn = np.array([-1, 1, 1]), np.array([1, -1, -1])
    ours, other = (encode_pose(x, ENCODING_GRAVITY_JOINTS) for x in (poses, mirrored_poses(poses)))
    np.testing.assert_allclose(other[:, :3], ours[:, :3] * flip, atol=1e-12)
    sides = ours[:, 3:].reshape(5, 23, 6)[:, MIRROR[1:] - 1] * np.concatenate([flip, turn])
    np.testing.assert_allclose(other[:, 3:].reshape(5, 23, 6), sides, atol=1e-12)


def test_a_run_is_trained_exported_and_compiled_with(tmp_path: Path) -> None:
    outfits = read_outfits(swinging_patches(tmp_path / "data", outfits=2), "train")
    network = DeepsdConfig(**SMALL_NETWORK, pose_encoding=ENCODING_GRAVITY_JOINTS)  # type: ignore[arg-type]
    recipe = Recipe(
        data=DataStage(8, outfits_per_step=(1,), poses=6, vertices=20),
        physics=PhysicsStage(2, outfits_per_step=(1,), poses=2, bodies=2, random_bodies=1),
        network=network,
        measure_every=0,
    )
    run = tmp_path / "run"
    assert train(recipe, outfits, [], DataFacts("tiny", "0" * 64, 4, 44), run).finished
    checkpoint = read_checkpoint(run)
    assert checkpoint is not None
    export_run(checkpoint, run / "bundle")
    compile_outfit(gown(tmp_path / "gown.obj"), tmp_path / "a.glb", bundle=run / "bundle", profile="reference")
    assert [finding for finding in validate_glb(read_glb(tmp_path / "a.glb")) if finding.severity == "error"] == []
    network_read = read_glb(tmp_path / "a.glb").meshes[0].pose_keys
    assert network_read is not None
    assert network_read.encoding == ENCODING_GRAVITY_JOINTS
