"""Cloth that falls in many poses, and keys that say so in poses that it has not been in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gltf_samples import make_rig
from worn import BODY, PELVIS, skirt, trousers, tube

from garmentc.evaluation.metrics import edge_mm
from garmentc.families.held_cloth import held_cloth
from garmentc.outfit.topology import edge_lengths, edges
from garmentc.passes.anchored_cloth import AnchoredCloth
from garmentc.passes.anchors import Anchors
from garmentc.passes.let_fall import LetFall, let_fall
from garmentc.passes.pose_set import plausible_poses
from garmentc.rig import DenseLayer, KeyNetwork, Rig

POSES = plausible_poses(fit=512, check=24)
SETTINGS = LetFall(poses=192)


def fallen(rig: Rig, firmness: np.ndarray, settings: LetFall = SETTINGS, start: Rig | None = None) -> Rig:
    start = start or rig
    cloth = AnchoredCloth.of(start, Anchors.of(start, 3000), BODY, None, POSES.some(settings.poses))
    return let_fall(rig, cloth, settings, POSES, firmness)[0]


@pytest.fixture(scope="module")
def worn() -> tuple[Rig, np.ndarray]:
    """A stiff skirt that only the pelvis moves, with the numbers of a pose as keys; and how firmly it is held."""
    template, triangles = skirt()
    weights = np.zeros((len(template), 24), np.float32)
    weights[:, 0] = 1
    keys = KeyNetwork((DenseLayer(np.eye(72, dtype=np.float32), np.zeros(72, np.float32)),))
    shapes = np.zeros((72, len(template), 3), np.float32)
    rig = Rig(template, triangles.astype(np.int32), BODY.joints(), weights, shapes, keys)
    return rig, held_cloth(template, edges(triangles), BODY).firmness


def test_what_hangs_swings_towards_the_ground(worn: tuple[Rig, np.ndarray]) -> None:
    """A wide bell held at its rim tilts with the pelvis, in unseen poses; its hem comes back to be below the rim."""
    template, _ = tube(PELVIS, PELVIS[1] + 0.1, 0.5, 0.4)
    bell = replace(worn[0], template=template)  # of as many vertices
    rim, hem = slice(48), slice(-48, None)
    firmness = np.zeros(len(template))
    firmness[rim] = 1
    tilted = POSES.check[np.linalg.norm(POSES.check[:, 0], axis=1) > 0.3]

    def aside(rig: Rig) -> float:
        """Horizontal metres from rim to hem, on average over poses."""
        vertices = rig.posed(tilted)
        apart = vertices[:, hem].mean(axis=1) - vertices[:, rim].mean(axis=1)
        return float(np.linalg.norm(apart[:, [0, 2]], axis=1).mean())

    assert len(tilted) > 5
    assert aside(fallen(bell, firmness, LetFall(poses=192, rounds=400, ridge=0.002))) < 0.95 * aside(bell)


def test_edges_come_back_to_their_lengths_in_unseen_poses() -> None:
    loose = trousers(gap=0.02)
    pairs = edges(loose.triangles)
    rest = edge_lengths(loose.template, pairs)
    before, after = (
        np.mean([edge_mm(vertices, rest, pairs) for vertices in rig.posed(POSES.check)])
        for rig in (loose, fallen(loose, np.zeros(loose.vertex_count)))
    )
    assert after < 0.97 * before


def test_what_is_held_goes_where_the_networks_have_it(worn: tuple[Rig, np.ndarray]) -> None:
    """Passes have bent the rig since: it comes back as far as its keys can say."""
    rig, _ = worn
    bent = replace(rig, blend_shapes=rig.blend_shapes.copy())
    bent.blend_shapes[3] = [0.0, 0.0, 0.02]
    everything = np.ones(rig.vertex_count)
    unmoved = fallen(rig, everything)
    assert np.abs(unmoved.blend_shapes).max() < 1e-6
    away = [
        np.linalg.norm(each.posed(POSES.check) - rig.posed(POSES.check), axis=-1).mean()
        for each in (bent, fallen(bent, everything, start=rig))
    ]
    assert away[1] < 0.5 * away[0]


def test_the_rest_pose_stays_and_the_same_comes_out_twice(worn: tuple[Rig, np.ndarray]) -> None:
    rig, firmness = worn
    once, again = fallen(rig, firmness), fallen(rig, firmness)
    np.testing.assert_allclose(once.posed(np.zeros((24, 3))), rig.template, atol=1e-6)
    np.testing.assert_array_equal(once.blend_shapes, again.blend_shapes)
    assert once.keys is rig.keys


def test_without_keys_that_move_nothing_can_be_said(worn: tuple[Rig, np.ndarray]) -> None:
    rig, firmness = worn
    still = KeyNetwork((DenseLayer(np.zeros((72, 72), np.float32), np.zeros(72, np.float32), "linear"),))
    for unchanged in (replace(rig, keys=still), replace(rig, keys=None, blend_shapes=make_rig(morphs=0).blend_shapes)):
        cloth = AnchoredCloth.of(rig, Anchors.of(rig, 3000), BODY, None, POSES.fit[:4])
        assert let_fall(unchanged, cloth, SETTINGS, POSES, firmness)[0] is unchanged
