"""BVH motions: parsing, retargeting, and errors that name the line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from garmentc.errors import GarmentcError
from garmentc.smpl import load_default_body
from garmentc.smpl.bvh import read_bvh
from garmentc.smpl.read_motion import read_motion
from garmentc.smpl.skeleton import JOINT_NAMES, PARENTS

BODY = load_default_body("neutral")
JOINTS = BODY.joints()
ID = {name: k for k, name in enumerate(JOINT_NAMES)}

MIXAMO = dict(
    zip(
        ("pelvis", "spine1", "spine2", "spine3", "neck", "head"),
        ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head"),
        strict=True,
    )
)
for _side in ("left", "right"):
    for _joint, _name in {
        "hip": "UpLeg",
        "knee": "Leg",
        "ankle": "Foot",
        "foot": "ToeBase",
        "collar": "Shoulder",
        "shoulder": "Arm",
        "elbow": "ForeArm",
        "wrist": "Hand",
        "hand": "HandIndex1",
    }.items():
        MIXAMO[f"{_side}_{_joint}"] = _side.capitalize() + _name
CMU = MIXAMO | {"spine1": "LowerBack", "spine2": "Spine", "spine3": "Spine1", "neck": "Neck1"}


@dataclass
class Skeleton:
    """A BVH skeleton with SMPL's hierarchy; children are written depth first, as BVH nests them."""

    names: dict[str, str]
    rest: NDArray[np.float64]  # (24, 3) zero pose
    order: str = "ZXY"

    def write(
        self, path: Path, world: NDArray[np.float64], root: NDArray[np.float64], seconds: float = 1 / 120
    ) -> Path:
        """`world` (T, 24, 3, 3) are rotations relative to the zero pose, root (T, 3) positions."""
        lines = ["HIERARCHY"]
        listed: list[int] = []

        def joint(k: int, indent: str) -> None:
            listed.append(k)
            offset = self.rest[k] - (self.rest[PARENTS[k]] if k else 0)
            lines.append(f"{indent}{'JOINT' if k else 'ROOT'} {self.names[JOINT_NAMES[k]]}")
            lines.append(f"{indent}{{")
            lines.append(f"{indent}\tOFFSET " + " ".join(f"{x:.12g}" for x in offset))
            channels = " ".join(f"{axis}rotation" for axis in self.order)
            positions = "" if k else "Xposition Yposition Zposition "
            lines.append(f"{indent}\tCHANNELS {3 if k else 6} {positions}{channels}")
            children = np.flatnonzero(np.equal(PARENTS, k))
            for child in children:
                joint(int(child), indent + "\t")
            if not len(children):
                lines.extend([f"{indent}\tEnd Site", f"{indent}\t{{", f"{indent}\t\tOFFSET 0 1 0", f"{indent}\t}}"])
            lines.append(f"{indent}}}")

        joint(0, "")
        local = world.copy()
        local[:, 1:] = np.swapaxes(world[:, PARENTS[1:]], -1, -2) @ world[:, 1:]
        lines += ["MOTION", f"Frames: {len(world)}", f"Frame Time: {seconds:.7f}"]
        angles = Rotation.from_matrix(local[:, listed].reshape(-1, 3, 3)).as_euler(self.order, degrees=True)
        for place, row in zip(root, angles.reshape(len(world), -1), strict=True):
            lines.append(" ".join(f"{x:.10f}" for x in (*place, *row)))
        path.write_text("\n".join(lines) + "\n")
        return path


def world_rotations(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """By scipy: (T, 24, 3) to (T, 24, 3, 3)."""
    world = Rotation.from_rotvec(poses.reshape(-1, 3)).as_matrix().reshape(*poses.shape[:2], 3, 3)
    for k in range(1, 24):
        world[:, k] = world[:, PARENTS[k]] @ world[:, k]
    return world


def positions(
    world: NDArray[np.float64], joints: NDArray[np.float64], root: NDArray[np.float64]
) -> NDArray[np.float64]:
    placed = np.zeros((*world.shape[:2], 3))
    placed[:, 0] = root
    for k in range(1, 24):
        placed[:, k] = placed[:, PARENTS[k]] + world[:, PARENTS[k]] @ (joints[k] - joints[PARENTS[k]])
    return placed


def smooth_poses(frames: int, seed: int) -> NDArray[np.float64]:
    """Poses that turn little by little, the hands at rest."""
    random = np.random.default_rng(seed)
    time = np.linspace(0, 2, frames)[:, None, None]
    poses = random.normal(scale=0.35, size=(1, 24, 3)) * np.sin(time * 2 + random.uniform(0, 6, size=(1, 24, 3)))
    poses[:, 22:] = 0
    return poses


@pytest.mark.parametrize("order", ["ZXY", "XYZ", "ZYX"])
@pytest.mark.parametrize("length", [1.0, 100 / 2.54])
def test_same_skeleton_gives_back_the_rotations(tmp_path: Path, order: str, length: float) -> None:
    """A T-posed source with the body's own joints: every rotation and the pelvis' path come back, in any unit."""
    poses = smooth_poses(20, 1)
    root = np.random.default_rng(2).normal(size=(20, 3))
    path = Skeleton(MIXAMO, JOINTS * length, order).write(tmp_path / "a.bvh", world_rotations(poses), root * length)
    motion = read_motion(path, joints=JOINTS)
    assert motion.fps == 120
    np.testing.assert_allclose(world_rotations(motion.poses), world_rotations(poses), atol=1e-6)
    np.testing.assert_allclose(motion.trans + JOINTS[0], root, atol=1e-6)


def test_positions_agree_with_the_file(tmp_path: Path) -> None:
    """The joints that the file itself places are where the posed body has them."""
    poses = smooth_poses(9, 3)
    path = Skeleton(MIXAMO, JOINTS).write(tmp_path / "a.bvh", world_rotations(poses), np.ones((9, 3)))
    clip, motion = read_bvh(path), read_motion(path, joints=JOINTS)
    of_file = clip.positions[:, [clip.names.index(MIXAMO[name]) for name in JOINT_NAMES]]
    np.testing.assert_allclose(of_file, positions(world_rotations(poses), JOINTS, np.ones((9, 3))), atol=1e-6)
    of_body = positions(world_rotations(motion.poses), JOINTS, motion.trans + JOINTS[0])
    np.testing.assert_allclose(of_body, of_file, atol=1e-6)


def test_another_body_with_a_shifted_origin(tmp_path: Path) -> None:
    """Where the body's rest pelvis is not the origin, as in SMPL, the posed joints stay where they were recorded."""
    poses = smooth_poses(9, 3)
    path = Skeleton(MIXAMO, JOINTS).write(tmp_path / "a.bvh", world_rotations(poses), np.ones((9, 3)))
    shifted = JOINTS + np.array([0, -0.22, 0.03])
    motion = read_motion(path, joints=shifted)
    expected = positions(world_rotations(poses), JOINTS, np.ones((9, 3)))
    of_body = positions(world_rotations(motion.poses), shifted, motion.trans + shifted[0])
    np.testing.assert_allclose(of_body, expected, atol=1e-6)


def cmu_like() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A rest with legs spread, arms lowered and brought forward, half the size; and the turn of each bone."""
    turns = np.tile(np.eye(3), (24, 1, 1))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        legs = Rotation.from_euler("z", sign * 20, degrees=True).as_matrix()
        arms = Rotation.from_euler("zy", [-sign * 30, -sign * 15], degrees=True).as_matrix()
        for joint in ("hip", "knee", "ankle", "foot"):
            turns[ID[f"{side}_{joint}"]] = legs
        for joint in ("shoulder", "elbow", "wrist", "hand"):
            turns[ID[f"{side}_{joint}"]] = arms
    return positions(turns[None], JOINTS, JOINTS[:1])[0] * 0.5, turns


def test_limb_directions_with_another_rest_pose(tmp_path: Path) -> None:
    """The source's rest pose differs; the posed body's limbs still point where the source's do."""
    rest, turns = cmu_like()
    wanted = world_rotations(smooth_poses(12, 5))
    path = Skeleton(CMU, rest).write(tmp_path / "a.bvh", wanted @ np.swapaxes(turns, -1, -2), np.zeros((12, 3)))
    motion = read_motion(path, joints=JOINTS)
    assert "CMU" in motion.source
    ours = positions(world_rotations(motion.poses), JOINTS, motion.trans + JOINTS[0])
    expected = positions(wanted, JOINTS, np.zeros((12, 3)))
    for side in ("left", "right"):
        for start, end in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist")):
            a, b = ID[f"{side}_{start}"], ID[f"{side}_{end}"]
            np.testing.assert_allclose(ours[:, b] - ours[:, a], expected[:, b] - expected[:, a], atol=1e-6)
    np.testing.assert_allclose((ours[:, 1] + ours[:, 2]), (expected[:, 1] + expected[:, 2]), atol=1e-6)


def test_cmu_forearm_twist_is_shared_between_elbow_and_wrist(tmp_path: Path) -> None:
    world = np.tile(np.eye(3), (2, 24, 1, 1))
    world[:, [ID["left_wrist"], ID["left_hand"]]] = Rotation.from_euler("x", 80, degrees=True).as_matrix()
    path = Skeleton(CMU, JOINTS).write(tmp_path / "a.bvh", world, np.zeros((2, 3)))
    poses = np.degrees(read_motion(path, joints=JOINTS).poses)
    bone = JOINTS[ID["left_wrist"]] - JOINTS[ID["left_elbow"]]
    along = bone / np.linalg.norm(bone)
    assert poses[0, ID["left_elbow"]] @ along == pytest.approx(40, abs=0.5)
    assert poses[0, ID["left_wrist"]] @ along == pytest.approx(40, abs=0.5)


def test_still_collars_follow_the_arms(tmp_path: Path) -> None:
    """Arms lifted with collars that were not recorded: the collar takes its share, the arm still points up."""
    world = np.tile(np.eye(3), (3, 24, 1, 1))
    lift = Rotation.from_euler("z", 60, degrees=True).as_matrix()
    world[:, [ID[f"left_{joint}"] for joint in ("shoulder", "elbow", "wrist", "hand")]] = lift
    motion = read_motion(Skeleton(CMU, JOINTS).write(tmp_path / "a.bvh", world, np.zeros((3, 3))), joints=JOINTS)
    assert np.degrees(motion.poses[0, ID["left_collar"], 2]) == pytest.approx(0.33 * 60, abs=1)
    np.testing.assert_allclose(
        world_rotations(motion.poses)[:, ID["left_elbow"]], world[:, ID["left_elbow"]], atol=1e-6
    )


def test_z_up_file_is_turned(tmp_path: Path) -> None:
    """A skeleton authored Z up, facing -Y, as Blender exports it: same motion as its Y-up twin."""
    to_z_up = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    poses = smooth_poses(10, 7) * 0.5
    root = np.random.default_rng(8).normal(size=(10, 3))
    world = world_rotations(poses)
    skeleton = Skeleton(MIXAMO, JOINTS @ to_z_up.T)
    path = skeleton.write(tmp_path / "a.bvh", to_z_up @ world @ to_z_up.T, root @ to_z_up.T)
    motion = read_motion(path, joints=JOINTS)
    assert "Z up" in motion.source
    np.testing.assert_allclose(world_rotations(motion.poses), world, atol=1e-6)
    np.testing.assert_allclose(motion.trans, root, atol=1e-6)


def test_short_spine_and_namespace(tmp_path: Path) -> None:
    """Two spine joints, no toes, names with a prefix and in the wrong case: the chest still turns as recorded."""
    names = {joint: f"mixamorig:{name.upper()}" for joint, name in MIXAMO.items()}
    names |= {"spine3": "Breast", "left_foot": "Other1", "right_foot": "Other2"}
    poses = smooth_poses(5, 9)
    poses[:, [ID["spine3"], ID["left_foot"], ID["right_foot"]]] = 0
    world = world_rotations(poses)
    motion = read_motion(Skeleton(names, JOINTS).write(tmp_path / "a.bvh", world, np.zeros((5, 3))), joints=JOINTS)
    ours = world_rotations(motion.poses)
    for joint in ("spine3", "head", "left_elbow", "left_foot"):
        np.testing.assert_allclose(ours[:, ID[joint]], world[:, ID[joint]], atol=1e-6)


def test_t_pose_frame_is_dropped(tmp_path: Path) -> None:
    poses = np.concatenate([np.zeros((1, 24, 3)), np.tile(smooth_poses(1, 11) * 4, (4, 1, 1))])
    motion = read_motion(Skeleton(CMU, JOINTS).write(tmp_path / "a.bvh", world_rotations(poses), np.zeros((5, 3))))
    assert len(motion) == 4
    assert [warning.code for warning in motion.warnings] == ["t-pose-frame-dropped"]


GOOD = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Left Leg
  {
    OFFSET 0 -1 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -1 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.0333333
0 0 0 90 0 0 0 0 0
0 2 0 0 0 0 0 0 0
"""


def test_parser_by_hand(tmp_path: Path) -> None:
    """CRLF, tabs, a name with a space, an end site; a quarter turn about Z takes -Y to +X."""
    path = tmp_path / "a.bvh"
    path.write_bytes(b"\xef\xbb\xbf" + GOOD.replace("  ", "\t").replace("\n", "\r\n").encode())
    clip = read_bvh(path)
    assert clip.names == ("Hips", "Left Leg", "Left Leg_end")
    assert clip.fps == 30
    np.testing.assert_allclose(clip.rest, [[0, 0, 0], [0, -1, 0], [0, -2, 0]])
    np.testing.assert_allclose(clip.positions[0], [[0, 0, 0], [1, 0, 0], [2, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(clip.positions[1], [[0, 2, 0], [0, 1, 0], [0, 0, 0]], atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("HIERARCHY", "SOLID", 1, "does not begin with HIERARCHY"),
        ("OFFSET 0 -1 0\n    CH", "OFFSET 0 x 0\n    CH", 8, "'x' is no number"),
        ("OFFSET 0 -1 0\n    CH", "OFFSET 0 nan 0\n    CH", 8, "'nan' is no number"),
        ("CHANNELS 3 Zrot", "CHANNELS 3 Wrot", 9, "unknown channel 'Wrotation'"),
        ("CHANNELS 3", "CHANNELS three", 9, "CHANNELS needs a count"),
        ("  JOINT", "  ROOT", 6, "ROOT is out of place"),
        ("  JOINT", "  JOIN", 6, "unexpected 'JOIN'"),
        ("      OFFSET 0 -1 0\n    }\n", "    }\n", 12, "without an OFFSET"),
        ("}\nMOTION", "MOTION", 14, "is never closed"),
        ("MOTION", "MOTIONS", None, "no MOTION section"),
        ("Frames: 2", "Frames: two", 17, "expected 'Frames: <number>'"),
        ("Frames: 2", "Frames: 0", 17, "no positive whole number"),
        ("Frames: 2", "Frames: 900000000000", 20, "the file is cut off"),
        ("0.0333333", "0", 18, "frame time is not positive"),
        ("0 0 0 90 0 0 0 0 0", "0 0 0 90 0 0 0 0", 19, "8 numbers, the skeleton has 9"),
        ("0 2 0", "0 2e 0", 20, "'2e' is no number"),
        ("0 2 0", "0 inf 0", 20, "'inf' is no number"),
        ("  CHANNELS 6", "  CHANNELS 7", 6, "unknown channel 'Joint'"),
    ],
)
def test_malformed(tmp_path: Path, old: str, new: str, line: int | None, message: str) -> None:
    path = tmp_path / "bad.bvh"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(GarmentcError, match=message) as caught:
        read_bvh(path)
    assert caught.value.line == line
    assert caught.value.file == path


def test_every_cut_is_an_error_or_whole(tmp_path: Path) -> None:
    """A file cut anywhere is refused with one line, never an exception of another kind."""
    path = tmp_path / "cut.bvh"
    for length in range(len(GOOD) - 20):
        path.write_text(GOOD[:length])
        with pytest.raises(GarmentcError):
            read_bvh(path)


def test_unknown_skeleton_lists_what_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "a.bvh"
    path.write_text(GOOD)
    with pytest.raises(GarmentcError, match=r"missing: .*UpLeg \(left_hip\).*RightHand \(right_wrist\)"):
        read_motion(path)


def test_zero_pose_that_does_not_stand_is_refused(tmp_path: Path) -> None:
    """Some exporters put every bone along one axis at zero rotation; directions cannot be told from that."""
    lying = np.zeros((24, 3))
    for k in range(1, 24):
        lying[k] = lying[PARENTS[k]] + [np.linalg.norm(JOINTS[k] - JOINTS[PARENTS[k]]), 0, 0]
    world = world_rotations(smooth_poses(3, 1))
    with pytest.raises(GarmentcError, match="zero pose"):
        read_motion(Skeleton(MIXAMO, lying).write(tmp_path / "a.bvh", world, np.zeros((3, 3))))
