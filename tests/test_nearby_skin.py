"""Outfit and body in many poses at once, and contacts found from few candidates, against the plain ways."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_samples import make_rig
from worn import BODY, trousers

from garmentc.evaluation.metrics import signed_distance
from garmentc.outfit.topology import vertex_normals
from garmentc.passes.body_contacts import DEPTH, FAR, REACH, Planes, Skin, find_clearance, in_contact
from garmentc.passes.covering import DEEPEST, Covering
from garmentc.passes.nearby_skin import NearbySkin
from garmentc.passes.pose_set import farthest_apart
from garmentc.passes.posed_skinning import posed_body, posed_outfit
from garmentc.rig import Rig
from garmentc.smpl.pose_sampler import sample_poses
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_NAMES

POSES = sample_poses(120, seed=5)
BETAS = np.array([0.5, -1.0])


def test_the_outfit_is_posed_as_the_rig_says() -> None:
    rig = make_rig()
    posed = posed_outfit(rig, POSES[:5])
    np.testing.assert_allclose(posed.vertices.transpose(2, 1, 0), rig.posed(POSES[:5]), atol=1e-5)


def moved_by(rig: Rig, step: np.ndarray) -> Rig:
    return replace(rig, template=rig.template + step)


def normals_of(rig: Rig) -> np.ndarray:
    return vertex_normals(rig.template, rig.triangles)


def test_turn_is_the_derivative_of_a_posed_vertex() -> None:
    rig, step = make_rig(), np.array([0.01, -0.02, 0.03])
    turned = np.einsum("ijnp,j->pni", posed_outfit(rig, POSES[:5]).turn, step)
    np.testing.assert_allclose(turned, moved_by(rig, step).posed(POSES[:5]) - rig.posed(POSES[:5]), atol=1e-6)
    assert np.linalg.norm(turned - step, axis=-1).max() > 0.01


def test_the_body_and_parts_of_it_are_posed_as_the_model_says() -> None:
    whole = BODY.posed(POSES[:3], BETAS)
    np.testing.assert_allclose(posed_body(BODY, BETAS, POSES[:3]).transpose(2, 1, 0), whole, atol=1e-5)
    rows = np.arange(100, 7000, 37)
    part = BODY.of_vertices(rows).posed(POSES[:3], BETAS)
    np.testing.assert_allclose(part, whole[:, rows], atol=1e-12)


def test_clearances_are_distances_to_the_skin() -> None:
    rig = trousers()
    for pose, clearance in zip(POSES[:3], find_clearance(rig, BODY, None, POSES[:3]), strict=True):
        close = clearance < FAR
        assert close.mean() > 0.2
        exact = signed_distance(rig.posed(pose)[close], BODY.posed(pose), BODY.faces)
        assert np.percentile(np.abs(clearance[close] - exact), 90) < 0.002


def search(rig: Rig, poses: np.ndarray) -> np.ndarray:
    """Clearances (n, P) from the nearest of all triangles, on the side of the cloth; FAR without contact."""
    skin = Skin.of(BODY, rig)
    covering = Covering.of(rig.template, normals_of(rig), BODY.shaped(), skin.faces)
    planes, points = Planes.of(posed_body(BODY, None, poses), skin.faces), posed_outfit(rig, poses).vertices
    rows = planes.nearest(points, 2 * DEEPEST, covering.marks)
    found = rows < len(skin.faces)
    rows[~found] = 0
    distance = planes.offset(points, rows)[0]
    found &= in_contact(distance, covering.depths(rows))
    vertices = np.broadcast_to(np.arange(len(rows))[:, None], rows.shape)
    found &= skin.joined(vertices.ravel(), rows.ravel()).reshape(rows.shape)
    return np.where(found, distance, FAR)


@pytest.mark.parametrize(("gap", "missed"), [(0.005, 0.01), (0.05, 0.06)])  # metres, share
def test_candidates_find_what_a_search_of_all_the_skin_finds(gap: float, missed: float) -> None:
    rig = trousers(gap=gap)
    skin = NearbySkin.of(rig, normals_of(rig), BODY, None, farthest_apart(POSES[:100], 20))
    unseen = POSES[100:]
    assert len(skin.body.faces) < len(BODY.faces) / 2
    clearance, normals = skin.contacts(posed_outfit(rig, unseen), skin.planes(unseen))
    searched = search(rig, unseen)
    contact, true = normals.any(axis=0), searched < FAR
    assert (contact != true).mean() < missed * true.mean()
    both = contact & true
    assert np.abs(clearance - searched)[both].mean() < 3e-4
    assert not clearance[~contact].any()
    assert (clearance[both] < REACH).all()
    assert (clearance[both] > -DEEPEST).all()


def skirt() -> Rig:
    """A tube round both thighs, one finger off them, that follows each of its legs half."""
    around, heights = np.linspace(0, 2 * np.pi, 48, endpoint=False), np.linspace(-0.75, -0.35, 20)
    angle, height = (grid.ravel() for grid in np.meshgrid(around, heights))
    template = np.stack([0.2 * np.sin(angle), height, 0.12 * np.cos(angle)], axis=1)
    row, column = (grid.ravel() for grid in np.mgrid[:19, :48])
    a, b = 48 * row + column, 48 * row + (column + 1) % 48
    triangles = np.concatenate([np.stack([a, b, b + 48], axis=1), np.stack([a, b + 48, a + 48], axis=1)])
    weights = np.zeros((len(template), 24), np.float32)
    weights[:, JOINT_NAMES.index("pelvis")] = 0.7
    weights[template[:, 0] > 0, JOINT_NAMES.index("left_hip")] = 0.3
    weights[template[:, 0] <= 0, JOINT_NAMES.index("right_hip")] = 0.3
    still = make_rig()
    return replace(
        still,
        template=template,
        triangles=triangles.astype(np.int32),
        joints=BODY.joints(),
        weights=weights,
        blend_shapes=np.zeros((still.morph_count, len(template), 3), np.float32),
        blend_normals=None,
    )


def test_a_raised_thigh_is_left_by_its_front() -> None:
    rig = skirt()
    poses = np.zeros((3, 24, 3))
    poses[:, JOINT_NAMES.index("left_hip"), 0] = -np.radians([15, 20, 25])
    skin = NearbySkin.of(rig, normals_of(rig), BODY, None, poses)
    normals = skin.contacts(posed_outfit(rig, poses), skin.planes(poses))[1]
    ahead = axis_angle_to_matrix(poses[:, JOINT_NAMES.index("left_hip")])[:, :, 2]  # where the thigh's front looks
    skins = [signed_distance(rig.posed(pose), BODY.posed(pose), BODY.faces) for pose in poses]
    deep = (np.stack(skins, axis=1) < -DEPTH) & (normals_of(rig)[:, 2] > 0.7)[:, None]
    assert deep.sum() > 20
    assert (np.einsum("inp,pi->np", normals, ahead)[deep] > 0.3).mean() > 0.5


def test_normals_are_how_clearance_changes() -> None:
    rig = trousers()
    skin = NearbySkin.of(rig, normals_of(rig), BODY, None, POSES[:4])
    step = np.array([3e-4, -2e-4, 1e-4])
    before, moved = (posed_outfit(cloth, POSES[:4]) for cloth in (rig, moved_by(rig, step)))
    clearance, normals = skin.contacts(before, skin.planes(POSES[:4]))
    after, after_normals = skin.contacts(moved, skin.planes(POSES[:4]))
    same = (normals == after_normals).all(axis=0) & normals.any(axis=0)  # the same triangle is nearest
    assert same.mean() > 0.2
    np.testing.assert_allclose(np.linalg.norm(normals[:, same], axis=0), 1, atol=1e-5)
    outwards = np.einsum("inp,inp->np", normals, moved.vertices - before.vertices)
    np.testing.assert_allclose((after - clearance)[same], outwards[same], atol=1e-6)
