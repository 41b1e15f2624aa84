"""Cloth along motions of all kinds: slow and fast frames, cuts, single poses, meshes of any fineness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from worn import BODY, skirt, trousers

from garmentc.families.held_cloth import held_cloth
from garmentc.outfit.topology import edges
from garmentc.passes import stretches
from garmentc.passes.anchored_cloth import AnchoredCloth
from garmentc.passes.anchors import Anchors
from garmentc.passes.animated_cloth import AnimatedCloth, Falling, Settling
from garmentc.passes.stretches import Stretches, with_way_in
from garmentc.rig import Rig
from garmentc.smpl.motion import Motion
from garmentc.smpl.nearest import nearest_body_weights, signed_distance
from garmentc.smpl.pose_sampler import sample_poses


def still(frames: int, fps: float = 30.0, trans: np.ndarray | None = None) -> Motion:
    return Motion("still", np.zeros((frames, 24, 3)), np.zeros((frames, 3)) if trans is None else trans, fps)


def walk(frames: int, fps: float) -> Motion:
    start, end = sample_poses(2, 3)
    share = np.linspace(0, 1, frames)[:, None, None]
    return Motion("walk", (1 - share) * start + share * end, np.zeros((frames, 3)), fps)


@pytest.fixture(scope="module")
def worn() -> tuple[Rig, np.ndarray]:
    """A skirt that moves with the pelvis and the thighs, and how firmly it is held."""
    template, triangles = skirt()
    rig = replace(
        trousers(),
        template=template,
        triangles=triangles.astype(np.int32),
        weights=nearest_body_weights(template, BODY.shaped(), BODY).astype(np.float32),
        blend_shapes=np.zeros((48, len(template), 3), np.float32),
    )
    return rig, held_cloth(template, edges(triangles), BODY).firmness


def animated(rig: Rig, firmness: np.ndarray, poses: np.ndarray, falling: Falling | None = None) -> AnimatedCloth:
    def anchored(anchors: Anchors) -> AnchoredCloth:
        return AnchoredCloth.of(rig, anchors, BODY, None, poses)

    settling = Settling()
    return AnimatedCloth.of(rig, Anchors.of(rig, settling.anchors), anchored, firmness, falling or Falling(), settling)


def played(worn: tuple[Rig, np.ndarray], motion: Motion, falling: Falling | None = None) -> np.ndarray:
    """Vertices (T, N, 3) without translation."""
    cloth = animated(*worn, np.concatenate([with_way_in(motion).poses[::8], motion.poses[-1:]]), falling)
    return along(cloth, motion, worn[0])


def along(cloth: AnimatedCloth, motion: Motion, rig: Rig) -> np.ndarray:
    vertices = np.zeros((len(motion), *rig.template.shape))
    for some in Stretches.of([motion], rig.joints):
        for number, settled in cloth.along(some):
            counts = some.shares[number] > 0
            if settled is None:
                assert not counts.any()
                continue
            vertices[some.frames[number, counts]] += (settled * some.shares[number])[:, :, counts].T
    return vertices


def test_a_skirt_hangs_down_on_a_leaning_body(worn: tuple[Rig, np.ndarray]) -> None:
    """Skinning keeps its back away from the legs, which are beneath it now. Its weight lays it down on them."""
    lean = np.zeros((24, 3))
    lean[0, 0] = np.radians(50)  # forwards
    motion = replace(still(20), poses=np.repeat(lean[None], 20, axis=0))
    rig, firmness = worn
    posed = rig.posed(lean)
    down = played(worn, motion)[-1]
    low, behind = rig.template[:, 1] < rig.template[:, 1].min() + 0.1, rig.template[:, 2] < -0.15
    assert (low & behind).sum() > 20
    assert down[low & behind, 1].mean() < posed[low & behind, 1].mean() - 0.04
    assert np.linalg.norm(down - posed, axis=1)[firmness > 0.99].max() < 1e-3
    assert (signed_distance(down, BODY.posed(lean), BODY.faces) < -0.001).mean() < 0.01


def test_what_would_fall_off_a_body_that_just_stands_is_held(worn: tuple[Rig, np.ndarray]) -> None:
    """Nobody has said that the skirt's waistband holds it."""
    rig, firmness = worn
    motion, unknown = walk(12, 30.0), (rig, np.zeros_like(firmness))
    posed = rig.posed(motion.poses)
    held, lost = (played(unknown, motion, Falling(stays=stays)) - posed for stays in (0.05, np.inf))
    assert lost[:, :, 1].mean() < -0.1
    assert abs(held[:, :, 1].mean()) < 0.02


def test_where_a_body_stands_means_nothing(worn: tuple[Rig, np.ndarray]) -> None:
    motion = walk(12, 30.0)
    there = replace(motion, trans=np.repeat([[50.0, 3.0, -20.0]], 12, axis=0))
    assert np.abs(played(worn, motion) - played(worn, there)).max() < 5e-3


def test_a_body_that_speeds_up_leaves_its_skirt_behind(worn: tuple[Rig, np.ndarray]) -> None:
    # A tube that is held at its top is stiff: it bends as a beam does.
    x = 0.5 * 6.0 * (np.arange(15) / 30) ** 2  # 6 m/s2 forwards
    trans = np.column_stack([0 * x, 0 * x, x])
    way = played(worn, still(15, trans=trans)) - played(worn, still(15))
    assert way[-1, worn[1] < 0.01, 2].mean() < -0.005
    assert np.abs(way[-1, worn[1] > 0.99, 2]).max() < 1e-3


def test_a_body_that_is_on_its_way_from_the_start_does_not(worn: tuple[Rig, np.ndarray]) -> None:
    """What moves evenly is at rest."""
    x = 3.0 * np.arange(15) / 30
    trans = np.column_stack([x, 0 * x, 0 * x])
    assert np.abs(played(worn, still(15, trans=trans)) - played(worn, still(15))).max() < 5e-3


def test_a_cut_starts_anew(worn: tuple[Rig, np.ndarray]) -> None:
    """The body is somewhere else at once: cloth must not be torn along."""
    trans = np.zeros((10, 3))
    trans[5:, 0] = 100.0
    jumped = played(worn, still(10, trans=trans))
    assert np.abs(jumped - played(worn, still(10))).max() < 0.02


def test_where_a_stretch_begins_does_not_matter(worn: tuple[Rig, np.ndarray], monkeypatch: pytest.MonkeyPatch) -> None:
    motion = walk(90, 30.0)
    whole = played(worn, motion)
    monkeypatch.setattr(stretches, "_LONGEST", 1.0)
    parts = played(worn, motion)
    moved = np.linalg.norm(whole - worn[0].posed(motion.poses), axis=-1).mean()
    assert np.linalg.norm(parts - whole, axis=-1).mean() < 0.1 * moved
    # One goes over into the next: no jump where they meet.
    shaken = [np.linalg.norm(np.diff(each, n=2, axis=0), axis=-1).mean(axis=1).max() for each in (parts, whole)]
    assert shaken[0] < 1.5 * shaken[1]


def test_frame_rates_are_sampled_from_one_movement(worn: tuple[Rig, np.ndarray]) -> None:
    """Ten frames a second are too few to simulate, so frames are put between."""
    ends = [played(worn, walk(frames, fps)) for frames, fps in ((10, 10.0), (28, 30.0), (55, 60.0))]
    assert [len(end) for end in ends] == [10, 28, 55]
    moved = np.linalg.norm(ends[1][-1] - ends[1][0], axis=-1).mean()
    for end in ends:
        assert np.linalg.norm(end[-1] - ends[1][-1], axis=-1).mean() < 0.1 * moved


def test_frames_of_a_pose_library_are_poses_by_themselves(worn: tuple[Rig, np.ndarray]) -> None:
    poses = sample_poses(3, 8)
    motion = Motion("poses", poses, np.zeros((3, 3)), 1.0)
    cloth = animated(*worn, poses)
    together = along(cloth, motion, worn[0])
    alone = np.concatenate([along(cloth, motion.clipped(k, k + 1), worn[0]) for k in range(3)])
    np.testing.assert_allclose(together, alone, atol=1e-4)  # sums of matrices round as many poses as there are


def test_what_is_fine_goes_with_what_falls(worn: tuple[Rig, np.ndarray]) -> None:
    motion = walk(12, 30.0)
    whole, some = (played(worn, motion, Falling(anchors=count)) for count in (4000, 250))
    assert worn[0].vertex_count > 500
    moved = np.linalg.norm(whole - worn[0].posed(motion.poses), axis=-1).mean()
    assert np.linalg.norm(some - whole, axis=-1).mean() < 0.4 * moved


def test_cloth_that_nothing_bears_does_not_fall(worn: tuple[Rig, np.ndarray]) -> None:
    rig, firmness = worn
    weights = np.zeros_like(rig.weights)
    weights[:, 0] = 1
    apart = replace(rig, template=rig.template + np.array([0, 0, 3.0]), weights=weights)
    still_there = played((apart, np.zeros_like(firmness)), still(10))
    assert np.abs(still_there - apart.template).max() < 1e-4
