"""Outfit and body in many poses at once, and contacts found from few candidates, against the plain ways."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_samples import make_rig
from worn import BODY, trousers

from garmentc.evaluation.metrics import signed_distance
from garmentc.passes.body_contacts import DEPTH, FAR, REACH, find_clearance
from garmentc.passes.nearby_skin import NearbySkin
from garmentc.passes.pose_set import farthest_apart
from garmentc.passes.posed_skinning import posed_body, posed_outfit
from garmentc.rig import Rig
from garmentc.smpl.pose_sampler import sample_poses

POSES = sample_poses(120, seed=5)
BETAS = np.array([0.5, -1.0])


def test_the_outfit_is_posed_as_the_rig_says() -> None:
    rig = make_rig()
    posed = posed_outfit(rig, POSES[:5])
    np.testing.assert_allclose(posed.vertices.transpose(2, 1, 0), rig.posed(POSES[:5]), atol=1e-5)


def moved_by(rig: Rig, step: np.ndarray) -> Rig:
    return replace(rig, template=rig.template + step)


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


@pytest.mark.parametrize(("gap", "missed"), [(0.005, 0.01), (0.05, 0.06)])  # metres, share
def test_candidates_find_what_a_search_of_all_the_skin_finds(gap: float, missed: float) -> None:
    rig = trousers(gap=gap)
    skin = NearbySkin.of(rig, BODY, None, farthest_apart(POSES[:100], 20))
    unseen = POSES[100:]
    assert len(skin.body.faces) < len(BODY.faces) / 2
    clearance, normals = skin.contacts(posed_outfit(rig, unseen), unseen)
    searched = find_clearance(rig, BODY, None, unseen).T
    contact, true = normals.any(axis=0), searched < FAR
    assert (contact != true).mean() < missed * true.mean()
    both = contact & true
    assert np.abs(clearance - searched)[both].mean() < 2e-4
    assert not clearance[~contact].any()
    assert (clearance[both] < REACH).all()
    assert (clearance[both] > -DEPTH).all()


def test_normals_are_how_clearance_changes() -> None:
    rig = trousers()
    skin = NearbySkin.of(rig, BODY, None, POSES[:4])
    step = np.array([3e-4, -2e-4, 1e-4])
    before, moved = (posed_outfit(cloth, POSES[:4]) for cloth in (rig, moved_by(rig, step)))
    clearance, normals = skin.contacts(before, POSES[:4])
    after, after_normals = skin.contacts(moved, POSES[:4])
    same = (normals == after_normals).all(axis=0) & normals.any(axis=0)  # the same triangle is nearest
    assert same.mean() > 0.2
    np.testing.assert_allclose(np.linalg.norm(normals[:, same], axis=0), 1, atol=1e-5)
    outwards = np.einsum("inp,inp->np", normals, moved.vertices - before.vertices)
    np.testing.assert_allclose((after - clearance)[same], outwards[same], atol=1e-6)
