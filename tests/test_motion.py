"""Motions in AMASS's layout, their up axis, resampling, and writing them back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from garmentc.errors import GarmentcError
from garmentc.smpl import Motion, load_default_body
from garmentc.smpl.amass import read_amass, write_amass
from garmentc.smpl.read_motion import read_motion

TO_Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
REST_PELVIS = np.array([0.0, -0.22, 0.03])


def walking(frames: int = 30, width: int = 72, seed: int = 0) -> dict[str, Any]:
    """A Y-up clip of a body that sways and turns around once."""
    random = np.random.default_rng(seed)
    poses = random.normal(scale=0.3, size=(frames, width))
    turn = Rotation.from_euler("y", np.linspace(0, 360, frames)[:, None], degrees=True)
    poses[:, :3] = (turn * Rotation.from_rotvec(random.normal(scale=0.1, size=(frames, 3)))).as_rotvec()
    return {
        "poses": poses,
        "trans": random.normal(loc=(0, 0.9, 0), size=(frames, 3)),
        "betas": random.normal(size=10),
        "gender": np.array("female"),
        "mocap_framerate": np.array(120.0),
    }


def save(folder: Path, arrays: dict[str, Any]) -> Path:
    np.savez(folder / "clip.npz", **arrays)
    return folder / "clip.npz"


def matrices(rotation_vectors: NDArray[Any]) -> NDArray[Any]:
    return Rotation.from_rotvec(rotation_vectors.reshape(-1, 3)).as_matrix().reshape(*rotation_vectors.shape, 3)


@pytest.mark.parametrize("width", [66, 72, 156, 165])
def test_layouts(tmp_path: Path, width: int) -> None:
    arrays = walking(width=width)
    motion = read_amass(save(tmp_path, arrays))
    assert motion.poses.shape == (30, 24, 3)
    assert (motion.fps, motion.gender, len(motion)) == (120, "female", 30)
    kept = 24 if width == 72 else 22
    np.testing.assert_allclose(
        matrices(motion.poses[:, :kept]), matrices(arrays["poses"][:, : 3 * kept].reshape(30, kept, 3)), atol=1e-12
    )
    assert not motion.poses[:, kept:].any()
    assert np.linalg.norm(motion.poses, axis=-1).max() <= np.pi + 1e-12
    np.testing.assert_array_equal(motion.trans, arrays["trans"])
    np.testing.assert_array_equal(motion.betas, arrays["betas"])
    assert [warning.code for warning in motion.warnings] == (["fingers-dropped"] if width > 72 else [])
    assert "Y up (detected" in motion.source


@pytest.mark.parametrize("key", ["mocap_framerate", "mocap_frame_rate", "fps"])
def test_frame_rate_names(tmp_path: Path, key: str) -> None:
    arrays = walking()
    arrays[key] = np.array([arrays.pop("mocap_framerate")]) / 2
    assert read_amass(save(tmp_path, arrays)).fps == 60


def z_up(arrays: dict[str, Any]) -> dict[str, Any]:
    """The same clip in a Z-up world. The pelvis stays at trans + REST_PELVIS, so trans is not just turned."""
    root = Rotation.from_matrix(TO_Z_UP) * Rotation.from_rotvec(arrays["poses"][:, :3])
    poses = np.concatenate([root.as_rotvec(), arrays["poses"][:, 3:]], axis=1)
    return arrays | {"poses": poses, "trans": (arrays["trans"] + REST_PELVIS) @ TO_Z_UP.T - REST_PELVIS}


@pytest.mark.parametrize("stated", ["detected", "asked", "in the file"])
def test_z_up_is_turned(tmp_path: Path, stated: str) -> None:
    """Posed vertices of the turned clip are those of its Y-up twin, for a body whose pelvis is off the origin."""
    upright = walking()
    arrays = z_up(upright) | ({"up_axis": np.array("z")} if stated == "in the file" else {})
    motion = read_amass(save(tmp_path, arrays), "z" if stated == "asked" else None, REST_PELVIS)
    assert "Z up" in motion.source
    assert not motion.warnings
    np.testing.assert_allclose(motion.trans, upright["trans"], atol=1e-12)
    np.testing.assert_allclose(matrices(motion.poses[:, 0]), matrices(upright["poses"][:, :3]), atol=1e-12)
    body = load_default_body()
    np.testing.assert_allclose(
        body.posed(motion.poses[7], None, motion.trans[7]),
        body.posed(upright["poses"][7], None, upright["trans"][7]),
        atol=1e-12,
    )


def test_up_axis_can_be_overruled(tmp_path: Path) -> None:
    path = save(tmp_path, walking() | {"up_axis": np.array("z")})
    assert "Y up (as asked)" in read_amass(path, "y").source
    assert "Z up (stated in the file)" in read_amass(path).source


def test_unsure_up_axis_is_a_warning(tmp_path: Path) -> None:
    """A body that lies half of the time gives no clear vertical."""
    arrays = walking()
    arrays["poses"][:, :3] = 0
    arrays["poses"][::2, 0] = np.pi / 2
    motion = read_amass(save(tmp_path, arrays))
    assert [warning.code for warning in motion.warnings] == ["motion-up-unsure"]
    assert "--motion-up" in motion.warnings[0].message


def test_missing_translation_is_a_warning(tmp_path: Path) -> None:
    arrays = walking()
    del arrays["trans"], arrays["betas"], arrays["gender"]
    motion = read_amass(save(tmp_path, arrays))
    assert not motion.trans.any()
    assert (motion.betas, motion.gender) == (None, None)
    assert [warning.code for warning in motion.warnings] == ["no-translation"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"poses": np.zeros((5, 71))}, "'poses' has shape 5 x 71, expected T x 72"),
        ({"poses": np.zeros((30, 24, 3))}, "'poses' has shape 30 x 24 x 3"),
        ({"poses": np.zeros((0, 72))}, "'poses' has shape 0 x 72"),
        ({"poses": np.full((30, 72), np.nan)}, "'poses' holds NaN"),
        ({"poses": np.array([[1, {}]], dtype=object)}, "'poses' holds Python objects.*save it as a plain number array"),
        ({"trans": np.zeros((29, 3))}, "'trans' has shape 29 x 3, expected 30 x 3"),
        ({"mocap_framerate": np.array(0.0)}, "'mocap_framerate' is 0"),
        ({"mocap_framerate": np.array([1.0, 2])}, "'mocap_framerate' has shape 2"),
        ({"mocap_framerate": np.array("fast")}, "'mocap_framerate' holds no numbers"),
        ({"up_axis": np.array("x")}, "'up_axis' is 'x', expected y or z"),
        ({"gender": np.array("x")}, "unknown gender 'x'"),
        ({"poses": None}, "'poses' is missing"),
        ({"mocap_framerate": None}, "has no frame rate; add a number named 'mocap_framerate'"),
    ],
)
def test_wrong_files(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    arrays = {key: value for key, value in (walking() | change).items() if value is not None}
    path = save(tmp_path, arrays)
    with pytest.raises(GarmentcError, match=message) as caught:
        read_motion(path)
    assert caught.value.file == path


def test_kinds_of_file(tmp_path: Path) -> None:
    with pytest.raises(GarmentcError, match=r"unknown kind of motion '\.fbx'"):
        read_motion(tmp_path / "a.fbx")
    with pytest.raises(GarmentcError, match="unknown up axis 'x'"):
        read_motion(tmp_path / "a.npz", up="x")
    with pytest.raises(GarmentcError, match="cannot be read"):
        read_motion(tmp_path / "a.npz")
    (tmp_path / "a.npz").write_bytes(b"text")
    with pytest.raises(GarmentcError, match=r"is not a whole \.npz"):
        read_motion(tmp_path / "a.npz")


def clip(frames: int = 13, fps: float = 30.0) -> Motion:
    random = np.random.default_rng(4)
    poses = Rotation.from_rotvec(random.normal(scale=2, size=(frames * 24, 3))).as_rotvec().reshape(frames, 24, 3)
    return Motion("clip", poses, random.normal(size=(frames, 3)), fps, np.ones(10), "male")


@pytest.mark.parametrize("fps", [30, 60, 24, 120, 7.5])
def test_resampling_is_slerp(fps: float) -> None:
    """Against scipy's Slerp at the same instants, rotations of any size."""
    motion = clip()
    new = motion.resampled(fps)
    assert len(new) == int(12 / 30 * fps + 1e-6) + 1
    assert new.times[-1] <= motion.times[-1] + 1e-9
    for joint in range(24):
        expected = Slerp(motion.times, Rotation.from_rotvec(motion.poses[:, joint]))(np.minimum(new.times, 0.4))
        np.testing.assert_allclose(matrices(new.poses[:, joint]), expected.as_matrix(), atol=1e-9)
    for axis in range(3):
        np.testing.assert_allclose(new.trans[:, axis], np.interp(new.times, motion.times, motion.trans[:, axis]))
    assert (new.gender, new.fps) == ("male", fps)


def test_resampling_edges() -> None:
    assert len(clip(1).resampled(60)) == 1
    assert len(clip(2).resampled(1)) == 1
    for fps in (0, -1, np.nan, np.inf):
        with pytest.raises(GarmentcError, match="cannot resample"):
            clip().resampled(fps)


def test_clipping() -> None:
    motion = clip()
    np.testing.assert_array_equal(motion.clipped(3, 7).poses, motion.poses[3:7])
    np.testing.assert_array_equal(motion.clipped(3).trans, motion.trans[3:])
    with pytest.raises(GarmentcError, match="frames 0 to 12"):
        motion.clipped(13)


def test_written_motions_come_back(tmp_path: Path) -> None:
    motion = clip()
    for name in ("a.npz", "b.npz"):
        write_amass(motion, tmp_path / name)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    back = read_motion(tmp_path / "a.npz")
    np.testing.assert_array_equal(back.poses, motion.poses)
    np.testing.assert_array_equal(back.trans, motion.trans)
    np.testing.assert_array_equal(back.betas, motion.betas)
    assert (back.fps, back.gender) == (30, "male")
    assert "Y up (stated in the file)" in back.source


def test_shared_clips(shared: Path) -> None:
    """All recorded clips are recognised as Y up, and surely."""
    paths = sorted((shared / "data/motion").glob("cmu_*.npz"))
    assert paths
    for path in paths:
        motion = read_motion(path)
        assert motion.fps == 30
        assert "Y up" in motion.source
        assert not motion.warnings
