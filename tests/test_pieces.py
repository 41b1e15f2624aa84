"""The pieces of an outfit: what hangs together, what is sewn on, and which layer is which."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from gltf_samples import make_rig

from garmentc.outfit.topology import edges
from garmentc.passes.anchors import Anchors
from garmentc.passes.overlaps import Overlaps
from garmentc.passes.pieces import Pieces, layers, sewn_on


def grid(size: float, count: int, height: float) -> tuple[np.ndarray, np.ndarray]:
    """A square sheet at a height: vertices and triangles."""
    x, z = np.meshgrid(np.linspace(0, size, count), np.linspace(0, size, count), indexing="ij")
    vertices = np.column_stack([x.ravel(), np.full(x.size, height), z.ravel()])
    k, i = np.meshgrid(np.arange(count - 1), np.arange(count - 1), indexing="ij")
    a = (k * count + i).ravel()
    quads = np.stack([a, a + 1, a + count + 1, a + count], axis=1)
    return vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)


def together(*parts: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    starts = np.cumsum([0, *[len(vertices) for vertices, _ in parts]])
    triangles = [part[1] + start for part, start in zip(parts, starts, strict=False)]
    return np.concatenate([part[0] for part in parts]), np.concatenate(triangles).astype(np.int32)


def test_a_mark_spreads_over_its_piece_alone() -> None:
    vertices, triangles = together(grid(0.4, 5, 0), grid(0.4, 5, 0.1))
    pieces = Pieces.of(edges(triangles), len(vertices))
    assert pieces.count == 2
    marked = np.zeros((50, 2), bool)
    marked[3, 0] = True
    expected = np.zeros((50, 2), bool)
    expected[:25, 0] = True
    np.testing.assert_array_equal(pieces.any(marked), expected)


def test_a_button_is_sewn_on_what_is_beneath_and_a_lining_is_not() -> None:
    vertices, triangles = together(grid(0.4, 9, 0), grid(0.4, 9, 0.01), grid(0.02, 3, 0.015))
    joined, pieces = sewn_on(vertices, edges(triangles))
    assert pieces.count == 2
    threads = joined[len(edges(triangles)) :]
    assert set(threads[:, 0]) == set(range(162, 171))
    assert ((threads[:, 1] >= 81) & (threads[:, 1] < 162)).all()


def test_what_lies_far_off_is_not_sewn_on() -> None:
    vertices, triangles = together(grid(0.4, 9, 0), grid(0.02, 3, 0.1))
    joined, pieces = sewn_on(vertices, edges(triangles))
    assert pieces.count == 2
    np.testing.assert_array_equal(joined, edges(triangles))


def test_buttons_alone_are_left_alone() -> None:
    vertices, triangles = together(grid(0.02, 3, 0), grid(0.02, 3, 0.005))
    assert sewn_on(vertices, edges(triangles))[1].count == 2
    assert not layers(vertices, edges(triangles)).any()


def test_a_button_belongs_to_the_layer_that_it_is_on() -> None:
    vertices, triangles = together(grid(0.02, 3, 0.015), grid(0.4, 9, 0), grid(0.4, 9, 0.01))
    layer = layers(vertices, edges(triangles))
    np.testing.assert_array_equal(layer, np.repeat([1, 0, 1], [9, 81, 81]))


def test_anchors_of_one_layer_do_not_move_another() -> None:
    """Sheets a millimetre apart that face the same way."""
    vertices, triangles = together(grid(0.4, 21, 0), grid(0.4, 21, 0.001))
    rig = replace(make_rig(), template=vertices, triangles=triangles)
    anchors = Anchors.of(rig, 100)
    upper = np.concatenate([block @ (anchors.rows >= 441).astype(np.float32) for _, block in anchors.interpolators(64)])
    np.testing.assert_allclose(upper, np.repeat([0, 1], 441), atol=0.01)
    pairs = anchors.joined(edges(triangles))
    assert ((anchors.rows[pairs] >= 441).sum(axis=1) != 1).all()


def test_which_sheet_lies_over_which_is_seen_from_the_skin() -> None:
    """The skin is a floor, the upper sheet 1 cm above the lower one; a third is far above."""
    skin, faces = grid(1.0, 3, -0.01)
    faces = faces[:, ::-1] if np.cross(*np.diff(skin[faces[0]], axis=0))[1] < 0 else faces
    vertices, triangles = together(grid(0.4, 41, 0.01), grid(0.4, 41, 0), grid(0.4, 41, 0.1))
    up = np.tile([0.0, 1, 0], (len(vertices), 1))
    pairs = edges(triangles)
    overlaps = Overlaps.of(vertices, up, pairs, Pieces.of(pairs, len(vertices)), skin, faces)
    count = 41 * 41
    np.testing.assert_array_equal(overlaps.over, np.arange(count))
    np.testing.assert_array_equal(overlaps.beneath, np.arange(count, 2 * count))
    np.testing.assert_allclose(overlaps.gaps, 0.003, rtol=1e-6)


def test_a_strap_lies_over_what_it_is_sewn_to_at_its_ends() -> None:
    """Of one piece with what is beneath, and between its vertices; but not over itself, nor where it is sewn on."""
    skin, faces = grid(1.0, 3, -0.01)
    faces = faces[:, ::-1] if np.cross(*np.diff(skin[faces[0]], axis=0))[1] < 0 else faces
    sheet, triangles = grid(0.4, 21, 0)
    along = np.linspace(0, 0.4, 21)
    strap = np.concatenate([np.column_stack([along, 0 * along + 0.008, 0 * along + z]) for z in (0.19, 0.21)])
    vertices = np.concatenate([sheet, strap])
    first, second = 441 + np.arange(21), 462 + np.arange(21)
    pairs = [edges(triangles), *(np.column_stack([row[:-1], row[1:]]) for row in (first, second))]
    pairs += [np.column_stack([first, second]), np.array([[441, 9], [461, 429]])]
    up = np.tile([0.0, 1, 0], (len(vertices), 1))
    joined = np.concatenate(pairs)
    overlaps = Overlaps.of(vertices, up, joined, Pieces.of(joined, len(vertices)), skin, faces)
    assert {*first[4:-4], *second[4:-4]} <= set(overlaps.over) <= {*first[2:-2], *second[1:-1]}
    assert (overlaps.beneath < 441).all()
    assert np.linalg.norm(vertices[overlaps.over] - vertices[overlaps.beneath], axis=1).max() < 0.016
