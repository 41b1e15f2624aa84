"""CLOTH3D's and TailorNet's published layouts, from small files written here; each checked against plain skinning."""

from __future__ import annotations

import pickle
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io

from garmentc.errors import GarmentcError
from garmentc.simulation.dataset_check import check_dataset
from garmentc.simulation.importers.cloth3d import cloth3d_samples, read_cloth3d_sample
from garmentc.simulation.importers.import_dataset import import_dataset
from garmentc.simulation.importers.point_cache import read_point_cache
from garmentc.simulation.importers.tailornet import read_tailornet_sequence, tailornet_sequences
from garmentc.smpl.body import BodyModel
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.smpl.rotations import axis_angle_to_matrix, matrix_to_quaternion, quaternion_to_axis_angle

FRAMES = 6


def _write_point_cache(path: Path, vertices: np.ndarray, kind: type = np.float16) -> None:
    header = struct.pack("<12siiffi", b"POINTCACHE2\0", 1, vertices.shape[1], 0.0, 1.0, len(vertices))
    path.write_bytes(header + vertices.astype(kind).tobytes())


def _turned(matrix: np.ndarray, axis_angle: np.ndarray) -> np.ndarray:
    return quaternion_to_axis_angle(matrix_to_quaternion(matrix @ axis_angle_to_matrix(axis_angle)))


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return load_default_body("female")


@pytest.fixture(scope="module")
def skin_patch(body: BodyModel) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (indices) and triangles of a part of the body's trunk: a garment whose every pose is known."""
    near = np.linalg.norm(body.v_template - body.v_template[body.v_template[:, 2].argmax()], axis=1) < 0.35
    faces = body.faces[near[body.faces].all(axis=1)]
    used, triangles = np.unique(faces, return_inverse=True)
    return used, triangles.reshape(-1, 3)


@pytest.fixture
def cloth3d(tmp_path: Path, body: BodyModel, skin_patch: tuple[np.ndarray, np.ndarray]) -> Path:
    """A sample as CLOTH3D stores it: Z up, cloth about the pelvis, before zrot."""
    used, triangles = skin_patch
    folder = tmp_path / "cloth3d" / "135_02_s8"
    folder.mkdir(parents=True)
    betas = np.array([0.8, -0.5, *[0.0] * 8])
    z_up = axis_angle_to_matrix(np.array([np.pi / 2, 0, 0]))
    pelvis_at_rest = body.joints(betas)[0]
    poses = 0.5 * sample_poses(FRAMES, seed=4)
    pelvis = np.random.default_rng(0).normal(0, 1, (FRAMES, 3))
    stored = poses.copy()
    stored[:, 0] = _turned(z_up, poses[:, 0])
    cloth = body.posed(stored, betas)[:, used] - pelvis_at_rest
    star = np.zeros((24, 3))
    star[0, 0], star[1, 2], star[2, 2] = np.pi / 2, 0.15, -0.15
    rest = body.posed(star, betas, correctives=False)[used] - pelvis_at_rest
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in rest] + [f"f {a} {b} {c}" for a, b, c in triangles + 1]
    (folder / "Tshirt.obj").write_text("\n".join(lines) + "\n")
    _write_point_cache(folder / "Tshirt.pc16", cloth)
    info = {
        "poses": stored.reshape(FRAMES, 72).T,
        "trans": pelvis.T,
        "shape": betas,
        "gender": 0,
        "zrot": 0.7,
        "tightness": np.array([0.3, -0.2]),
        "outfit": {"Tshirt": {"fabric": "cotton", "texture": {"type": "color", "data": np.ones(3)}}},
    }
    scipy.io.savemat(folder / "info.mat", info)
    return folder.parent


def test_cloth3d_sample(cloth3d: Path, body: BodyModel, skin_patch: tuple[np.ndarray, np.ndarray]) -> None:
    used, triangles = skin_patch
    sequence = read_cloth3d_sample(cloth3d_samples(cloth3d)[0], {"female": body})
    facts = sequence.facts
    assert (facts.name, facts.motion, facts.category, facts.fabric) == ("135_02_s8", "135_02", "top", "cotton")
    assert (facts.gender, facts.parts, facts.tightness) == ("female", ("Tshirt",), (0.3, -0.2))
    np.testing.assert_array_equal(sequence.faces, triangles)
    posed = body.posed(sequence.poses.astype(np.float64), sequence.betas, sequence.trans)[:, used]
    np.testing.assert_allclose(sequence.vertices, posed, atol=6e-4)  # half precision within a metre
    for frame in sequence.vertices:
        assert np.corrcoef(frame[:, 1], sequence.template[:, 1])[0, 1] > 0.7, "what is up at rest is up"
    error = np.linalg.norm(sequence.template - body.shaped(sequence.betas)[used], axis=1)
    assert np.median(error) < 2e-4
    assert error.max() < 0.005


def test_cloth3d_zrot_turns_about_the_vertical(cloth3d: Path, body: BodyModel) -> None:
    folder = cloth3d / "135_02_s8"
    before = read_cloth3d_sample(folder, {"female": body})
    info = {key: value for key, value in scipy.io.loadmat(folder / "info.mat").items() if key[0] != "_"}
    scipy.io.savemat(folder / "info.mat", {**info, "zrot": 0.7 + np.pi / 2})
    after = read_cloth3d_sample(folder, {"female": body})
    x, y, z = np.moveaxis(before.vertices, -1, 0)
    np.testing.assert_allclose(after.vertices, np.stack([z, y, -x], axis=-1), atol=1e-5)


def _cut_cache(folder: Path) -> None:
    path = folder / "Tshirt.pc16"
    path.write_bytes(path.read_bytes()[:-10])


def _no_cache(folder: Path) -> None:
    (folder / "Tshirt.pc16").write_bytes(b"something else" * 9)


def _other_mesh(folder: Path) -> None:
    (folder / "Tshirt.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")


def _no_mat(folder: Path) -> None:
    (folder / "info.mat").write_bytes(b"no MATLAB" * 30)


def _escaping_name(folder: Path) -> None:
    info = {key: value for key, value in scipy.io.loadmat(folder / "info.mat").items() if key[0] != "_"}
    scipy.io.savemat(folder / "info.mat", {**info, "outfit": np.zeros(3)})


def _male(folder: Path) -> None:
    info = {key: value for key, value in scipy.io.loadmat(folder / "info.mat").items() if key[0] != "_"}
    scipy.io.savemat(folder / "info.mat", {**info, "gender": 1})


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (_cut_cache, "is cut short: it says 6 frames"),
        (_no_cache, "does not start with POINTCACHE2"),
        (_other_mesh, "but the OBJ has 3 vertices"),
        (_no_mat, "is no MATLAB file"),
        (_escaping_name, "names no garments"),
        (_male, "give SMPL's male model too"),
    ],
)
def test_damaged_cloth3d(cloth3d: Path, body: BodyModel, harm: Callable[[Path], None], message: str) -> None:
    harm(cloth3d / "135_02_s8")
    with pytest.raises(GarmentcError, match=message):
        read_cloth3d_sample(cloth3d / "135_02_s8", {"female": body})


def test_point_cache_of_either_precision(tmp_path: Path) -> None:
    vertices = np.random.default_rng(0).normal(size=(3, 5, 3))
    _write_point_cache(tmp_path / "a.pc2", vertices, np.float32)
    np.testing.assert_array_equal(read_point_cache(tmp_path / "a.pc2"), vertices.astype(np.float32))
    _write_point_cache(tmp_path / "a.pc16", vertices)
    np.testing.assert_array_equal(read_point_cache(tmp_path / "a.pc16"), vertices.astype(np.float16))


def _fine_body(path: Path) -> dict[str, Any]:
    """A body of few vertices as TailorNet's scripts save the fine SMPL: `kintree_table` is the parents alone."""
    rng = np.random.default_rng(1)
    count = 60
    regressor = rng.dirichlet(np.full(count, 0.2), 24)
    arrays = {
        "v_template": rng.normal(0, 0.5, (count, 3)),
        "f": rng.integers(0, count, (40, 3)),
        "weights": rng.dirichlet(np.full(24, 0.1), count),
        "shapedirs": rng.normal(0, 0.02, (count, 3, 10)),
        "posedirs": rng.normal(0, 0.01, (count, 3, 207)),
        "J_regressor": regressor,
        "kintree_table": np.array([-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21]),
    }
    arrays = {key: np.asarray(value, np.float32 if value.dtype.kind == "f" else int) for key, value in arrays.items()}
    path.parent.mkdir(parents=True)
    np.savez(path, **arrays)
    return arrays


@pytest.fixture
def tailornet(tmp_path: Path) -> tuple[Path, dict[str, Any]]:
    """Two styles of a T-shirt and a skirt, on a body of 60 vertices."""
    root = tmp_path / "tailornet"
    arrays = _fine_body(root / "smpl" / "smpl_hres_female.npz")
    rng = np.random.default_rng(2)
    picked = np.arange(5, 35)
    faces = rng.integers(0, 30, (20, 3))
    info = {"t-shirt": {"f": faces, "vert_indices": picked}, "skirt": {"f": faces, "vert_indices": None}}
    (root / "garment_class_info.pkl").write_bytes(pickle.dumps(info, 2))
    means = rng.dirichlet(np.full(60, 0.1), 30)
    np.savez(root / "skirt_weight.npz", w=means)
    written: dict[str, Any] = {"body": arrays, "picked": picked, "means": means, "faces": faces}
    for garment in ("t-shirt", "skirt"):
        folder = root / f"{garment}_female"
        for part in ("shape", "style", "style_shape"):
            (folder / part).mkdir(parents=True)
        np.save(folder / "shape" / "beta_000.npy", np.concatenate([rng.normal(size=10), np.zeros(290)]))
        for style in ("001", "023"):
            (folder / "pose" / f"000_{style}").mkdir(parents=True)
            np.save(folder / "style" / f"gamma_{style}.npy", rng.normal(size=4))
            np.save(folder / "style_shape" / f"beta000_gamma{style}.npy", rng.normal(0, 0.01, (30, 3)))
            for part in ("000", "001"):
                thetas = rng.normal(0, 0.4, (4, 72)).astype(np.float32)
                offsets = rng.normal(0, 0.01, (4, 30, 3)).astype(np.float32)
                np.savez(folder / "pose" / f"000_{style}" / f"poses_{part}.npz", thetas=thetas)
                np.save(folder / "pose" / f"000_{style}" / f"unposed_{part}.npy", offsets)
    return root, written


def _transforms(pose: np.ndarray, joints: np.ndarray, parents: np.ndarray) -> np.ndarray:
    """SMPL's equations 3 and 4 with 4x4 matrices, one joint at a time."""
    world: list[np.ndarray] = []
    for k in range(24):
        local = np.eye(4)
        local[:3, :3] = axis_angle_to_matrix(pose[k])
        local[:3, 3] = joints[k] - (joints[parents[k]] if k else 0)
        world.append(local if k == 0 else world[parents[k]] @ local)
    for k in range(24):
        away = np.eye(4)
        away[:3, 3] = -joints[k]
        world[k] = world[k] @ away
    return np.stack(world)


@pytest.mark.parametrize("garment", ["t-shirt", "skirt"])
def test_tailornet_sequence(tailornet: tuple[Path, dict[str, Any]], garment: str) -> None:
    root, written = tailornet
    found = [one for one in tailornet_sequences(root) if one.garment == garment]
    assert [one.name for one in found] == [
        f"{garment}_female_000_{s}.{p}" for s in ("001", "023") for p in ("000", "001")
    ]
    sequence = read_tailornet_sequence(found[-1])
    assert sequence.facts.category == ("top" if garment == "t-shirt" else "skirt")
    np.testing.assert_array_equal(sequence.faces, written["faces"])

    arrays = {key: np.asarray(value, np.float64) for key, value in written["body"].items() if key != "kintree_table"}
    rows = np.eye(60)[written["picked"]] if garment == "t-shirt" else written["means"]
    folder = root / f"{garment}_female"
    betas = np.load(folder / "shape" / "beta_000.npy")[:10]
    thetas = np.load(folder / "pose" / "000_023" / "poses_001.npz")["thetas"].astype(np.float64).reshape(-1, 24, 3)
    offsets = np.load(folder / "pose" / "000_023" / "unposed_001.npy")
    shaped = arrays["v_template"] + arrays["shapedirs"] @ betas
    for frame, pose in enumerate(thetas):
        correctives = arrays["posedirs"] @ (axis_angle_to_matrix(pose[1:]) - np.eye(3)).ravel()
        unposed = rows @ (shaped + correctives) + offsets[frame]
        transforms = _transforms(pose, arrays["J_regressor"] @ shaped, written["body"]["kintree_table"])
        blended = np.einsum("nk,kij->nij", rows @ arrays["weights"], transforms)
        posed = np.einsum("nij,nj->ni", blended, np.concatenate([unposed, np.ones((30, 1))], axis=1))[:, :3]
        np.testing.assert_allclose(sequence.vertices[frame], posed, atol=1e-5)
    at_rest = np.load(folder / "style_shape" / "beta000_gamma023.npy")
    np.testing.assert_allclose(sequence.template, rows @ shaped + at_rest, atol=1e-6)


def test_an_imported_dataset_is_sound_and_an_import_goes_on(
    tailornet: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    root, _ = tailornet
    (root / "skirt_female" / "pose" / "000_001" / "unposed_000.npy").write_bytes(b"damaged")
    dataset = import_dataset("tailornet", root, tmp_path / "out")
    assert len(dataset.entries) == 7
    assert check_dataset(dataset).problems == ()
    assert "is no plain .npy file" in (tmp_path / "out" / "rejected.jsonl").read_text()
    first = (tmp_path / "out" / dataset.entries[0].file).read_bytes()
    (tmp_path / "out" / dataset.entries[0].file).unlink()
    assert import_dataset("tailornet", root, tmp_path / "out") == dataset
    assert (tmp_path / "out" / dataset.entries[0].file).read_bytes() == first


class _Attack:
    def __reduce__(self) -> tuple[Any, ...]:
        return exec, ("raise SystemExit('executed')",)


def test_a_hostile_pickle_executes_nothing(tailornet: tuple[Path, dict[str, Any]]) -> None:
    root, _ = tailornet
    (root / "garment_class_info.pkl").write_bytes(pickle.dumps({"t-shirt": _Attack()}))
    one = next(one for one in tailornet_sequences(root) if one.garment == "t-shirt")
    with pytest.raises(GarmentcError, match=r"refuses to load builtins\.exec"):
        read_tailornet_sequence(one)


def test_objects_in_npy_files_are_refused(tailornet: tuple[Path, dict[str, Any]]) -> None:
    root, _ = tailornet
    np.save(root / "t-shirt_female" / "style" / "gamma_001.npy", np.array([_Attack()], dtype=object))
    one = next(one for one in tailornet_sequences(root) if one.gamma == "001" and one.garment == "t-shirt")
    with pytest.raises(GarmentcError, match=r"gamma_001\.npy: is no plain \.npy file"):
        read_tailornet_sequence(one)


def test_nothing_to_import(tmp_path: Path) -> None:
    with pytest.raises(GarmentcError, match="holds no TailorNet data"):
        import_dataset("tailornet", tmp_path, tmp_path / "out")
    with pytest.raises(GarmentcError, match="give its models"):
        import_dataset("cloth3d", tmp_path, tmp_path / "out")
    with pytest.raises(GarmentcError, match="holds no CLOTH3D samples"):
        cloth3d_samples(tmp_path)
    with pytest.raises(GarmentcError, match="unknown layout 'zip'"):
        import_dataset("zip", tmp_path, tmp_path / "out")
