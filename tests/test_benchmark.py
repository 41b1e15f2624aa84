"""The benchmark: written files against rigs, baselines, tables."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gltf_samples import corner_vertices, make_asset

from garmentc.errors import GarmentcError
from garmentc.evaluation.baselines import nearest_skinning
from garmentc.evaluation.benchmark import benchmark
from garmentc.evaluation.evaluate import EvaluationOptions, body_frames, evaluate, summarise
from garmentc.evaluation.open_arms import open_arms
from garmentc.evaluation.posed_outfit import RigOutfit, read_outfit
from garmentc.evaluation.table import markdown, table_row, to_json
from garmentc.gltf.asset import Clip
from garmentc.gltf.write import write_glb
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.motion import Motion
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_NAMES

BODY = load_default_body("neutral")
MOTION = Motion("sampled", sample_poses(6, 3), np.zeros((6, 3)), 30.0)


def written(folder: Path, **extras: str) -> Path:
    path = folder / "gown.glb"
    write_glb(replace(make_asset(parts=2), extras=extras), path)
    return path


def test_a_file_is_measured_as_its_rig_is(tmp_path: Path) -> None:
    """Split corners at the seam count once, and every number is that of the rig."""
    asset = make_asset(parts=2)
    outfit = read_outfit(written(tmp_path))
    assert len(outfit.rest) == asset.rig.vertex_count < len(corner_vertices(asset))
    assert len(outfit.triangles) == len(asset.rig.triangles)
    frames = body_frames(BODY, None, MOTION, EvaluationOptions(step=1))
    from_file, from_rig = (evaluate(source, BODY, frames) for source in (outfit, RigOutfit(asset.rig)))
    for name in ("collision", "deep", "bared", "edge_mm", "bend"):
        np.testing.assert_allclose(getattr(from_file, name), getattr(from_rig, name), atol=2e-3, err_msg=name)
    assert from_rig.collision.max() > 0


def test_nearest_skinning_takes_the_weights_of_the_nearest_body_vertex() -> None:
    skin = BODY.shaped()
    chosen = np.arange(0, len(skin), 37)
    rig = nearest_skinning(skin[chosen] + 1e-5, np.zeros((0, 3), np.int32), BODY)
    np.testing.assert_allclose(rig.weights, BODY.weights[chosen], atol=1e-6)
    posed = BODY.posed(MOTION.poses, correctives=False)[:, chosen]
    np.testing.assert_allclose(rig.posed(MOTION.poses), posed, atol=1e-4)


def test_summaries_over_clean_and_over_all_frames() -> None:
    frames = body_frames(BODY, None, MOTION, EvaluationOptions(step=1))
    scores = evaluate(RigOutfit(make_asset().rig), BODY, replace(frames, clean=np.array([1, 0, 0, 1, 0, 0], bool)))
    everything, clean = summarise([scores, scores], clean_only=False), summarise([scores], clean_only=True)
    assert (everything.frames, clean.frames) == (12, 2)
    assert everything.collision == pytest.approx(scores.collision.mean())
    assert clean.edge_mm == pytest.approx((scores.edge_mm[0] + scores.edge_mm[3]) / 2)
    nothing = summarise([replace(scores, clean=np.zeros(6, bool))], clean_only=True)
    assert (nothing.frames, nothing.collision) == (0, None)


def test_the_table_says_what_the_json_says() -> None:
    frames = body_frames(BODY, None, MOTION, EvaluationOptions(step=2))
    scores = evaluate(RigOutfit(make_asset().rig), BODY, frames)
    rows = [table_row("gown", "compiled", [scores])]
    data = json.loads(to_json(rows))
    line = next(line for line in markdown(rows).split("All frames")[1].splitlines() if "gown" in line)
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    assert cells[:3] == ["gown", "compiled", "3"]
    assert float(cells[3]) == pytest.approx(100 * data[0]["all"]["collision"], abs=0.006)
    assert float(cells[5]) == pytest.approx(100 * data[0]["all"]["bared"], abs=0.006)
    assert float(cells[6]) == pytest.approx(data[0]["all"]["edge_mm"], abs=0.006)


def test_opened_arms_point_away_from_the_trunk() -> None:
    pose = np.zeros((24, 3))
    for name, sign in (("left_shoulder", -1), ("right_shoulder", 1)):
        pose[JOINT_NAMES.index(name), 2] = sign * np.radians(80)  # arms hang
    opened = open_arms(pose, 15)
    for name, sign in (("left_shoulder", -1), ("right_shoulder", 1)):
        np.testing.assert_allclose(opened[JOINT_NAMES.index(name)], [0, 0, sign * np.radians(65)], atol=1e-9)
    np.testing.assert_array_equal(open_arms(pose, 0)[3], pose[3])
    hand = JOINT_NAMES.index("left_hand")
    assert BODY.posed(opened)[BODY.weights[:, hand].argmax(), 0] > BODY.posed(pose)[BODY.weights[:, hand].argmax(), 0]


def save_motion(folder: Path) -> Path:
    path = folder / "sampled.npz"
    arrays = {"poses": MOTION.poses.reshape(6, 72), "trans": MOTION.trans, "mocap_framerate": np.array(30.0)}
    np.savez(path, **arrays)
    return path


def test_the_benchmark_puts_a_file_beside_its_baseline(tmp_path: Path) -> None:
    path = written(tmp_path, body="default neutral", gender="neutral", betas="")
    rows = benchmark([path], [save_motion(tmp_path)], options=EvaluationOptions(step=3))
    assert [(row.outfit, row.method) for row in rows] == [("gown", "nearest"), ("gown", "compiled")]
    assert rows[0].all.frames == rows[1].all.frames == 2


def test_the_command_prints_the_table(tmp_path: Path) -> None:
    path = written(tmp_path, body="default neutral", gender="neutral", betas="0.5,-0.5")
    command = [sys.executable, "-m", "garmentc", "evaluate", str(path), "--motion", str(save_motion(tmp_path))]
    done = subprocess.run([*command, "--step", "6"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "| gown | nearest | 1 |" in done.stdout.split("All frames")[1]
    refused = subprocess.run([*command, "--step", "0"], capture_output=True, text=True)
    assert refused.returncode == 2
    assert len(refused.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("extras", "words"),
    [
        ({}, "--gender"),
        ({"gender": "male", "body": "SMPL male"}, "--body"),
        ({"gender": "male", "body": "default male", "betas": "many"}, "betas"),
    ],
)
def test_a_file_that_does_not_name_its_body_is_refused(tmp_path: Path, extras: dict[str, str], words: str) -> None:
    path = written(tmp_path, **extras)
    with pytest.raises(GarmentcError, match=words):
        benchmark([path], [save_motion(tmp_path)])


def test_a_file_is_measured_along_its_own_animations(tmp_path: Path) -> None:
    """Where their keys are the network's, as along the motion that was compiled in, wherever that walks."""
    asset = replace(make_asset(parts=2), clips=(Clip(replace(MOTION, trans=np.full((6, 3), 2.0))),))
    path = tmp_path / "gown.glb"
    extras = {"body": "default neutral", "gender": "neutral", "betas": "", "fps:sampled": 30.0}
    write_glb(replace(asset, extras=extras, options=replace(asset.options, key_tolerance=0)), path)
    options = EvaluationOptions(step=2)
    own, along = benchmark([path], [], options=options), benchmark([path], [save_motion(tmp_path)], options=options)
    assert [row.method for row in own] == [row.method for row in along]
    for one, other in zip(own, along, strict=True):
        assert one.all.frames == other.all.frames == 3
        for name in ("collision", "deep", "bared", "edge_mm", "bend"):
            assert getattr(one.all, name) == pytest.approx(getattr(other.all, name), abs=1e-4)


def test_an_animation_is_shown_with_its_own_keys(tmp_path: Path) -> None:
    asset = make_asset(parts=2)
    keys = np.random.default_rng(0).random((6, asset.rig.morph_count))
    path = tmp_path / "gown.glb"
    options = replace(asset.options, key_tolerance=0)
    write_glb(replace(asset, clips=(Clip(MOTION, (keys,)),), options=options), path)
    outfit = read_outfit(path)
    pose, vertices = outfit.animated(0, 4 / 30)
    np.testing.assert_allclose(axis_angle_to_matrix(pose), axis_angle_to_matrix(MOTION.poses[4]), atol=1e-6)
    lowest = [np.linalg.norm(vertices[:, None] - posed, axis=-1).min(axis=0).max() for posed in (
        asset.rig.posed(MOTION.poses[4], keys=keys[4]), asset.rig.posed(MOTION.poses[4]),
    )]  # fmt: skip
    assert lowest[0] < 1e-5 < 1e-3 < lowest[1]


def test_what_has_no_animation_needs_a_motion(tmp_path: Path) -> None:
    path = tmp_path / "gown.glb"
    extras = {"body": "default neutral", "gender": "neutral", "betas": ""}
    write_glb(replace(make_asset(parts=2), clips=(), extras=extras), path)
    with pytest.raises(GarmentcError, match="--motion"):
        benchmark([path], [])


def test_arms_are_not_opened_in_an_animation(tmp_path: Path) -> None:
    path = tmp_path / "gown.glb"
    extras = {"body": "default neutral", "gender": "neutral", "betas": ""}
    write_glb(replace(make_asset(parts=2), clips=(Clip(MOTION),), extras=extras), path)
    with pytest.raises(GarmentcError, match="--motion"):
        benchmark([path], [], options=EvaluationOptions(arms_opened=10.0))


def test_a_frame_rate_that_is_none_is_not_taken(tmp_path: Path) -> None:
    """Extras are anybody's: a word, nothing or zero in place of a number is no rate."""
    for written_rate in ("fast", None, 0, -3.0):
        path = tmp_path / "gown.glb"
        extras = {"body": "default neutral", "gender": "neutral", "betas": "", "fps:sampled": written_rate}
        write_glb(replace(make_asset(parts=2), clips=(Clip(MOTION),), extras=extras), path)
        assert benchmark([path], [], [], EvaluationOptions(step=1))[0].all.frames == 6
