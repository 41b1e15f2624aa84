"""The semantic diff: silent about storage, loud about meaning."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_samples import make_asset, make_motion

from garmentc.gltf.asset import Asset, Clip
from garmentc.gltf.diff import diff_glb
from garmentc.gltf.difference import DiffTolerances, unequal
from garmentc.gltf.glb_asset import GlbAsset
from garmentc.gltf.read import read_glb
from garmentc.gltf.write import write_glb
from garmentc.outfit.outfit import Texture
from garmentc.rig import KeyNetwork

PNG = b"\x89PNG\r\n\x1a\n" + bytes(30)


def glb(folder: Path, asset: Asset) -> GlbAsset:
    write_glb(asset, folder / "x.glb")
    return read_glb(folder / "x.glb")


def places(folder: Path, left: Asset, right: Asset, **tolerances: float) -> list[str]:
    found = diff_glb(glb(folder, left), glb(folder, right), DiffTolerances(**tolerances))
    assert all("\n" not in str(difference) for difference in found)
    return [difference.where for difference in found]


def with_rig(asset: Asset, **changes: Any) -> Asset:
    return replace(asset, rig=replace(asset.rig, **changes))


def test_equal_files_and_other_storage_are_no_difference(tmp_path: Path) -> None:
    assert places(tmp_path, make_asset(), make_asset()) == []
    assert places(tmp_path, make_asset(), make_asset(sparse=False)) == []
    assert places(tmp_path, make_asset(), replace(make_asset(), generator="other", extras={"a": 1})) == []


def test_quantized_and_float_are_the_same_within_a_tenth_of_a_millimetre(tmp_path: Path) -> None:
    assert places(tmp_path, make_asset(), make_asset(quantize=True), position=1e-4, texcoord=1e-4) == []
    assert places(tmp_path, make_asset(), make_asset(quantize=True), position=1e-7) != []


def test_left_out_keyframes_are_no_difference_within_the_tolerance(tmp_path: Path) -> None:
    full, reduced = make_asset(key_tolerance=0), make_asset(key_tolerance=1e-3)
    assert places(tmp_path, full, reduced, position=1.1e-3, rotation=1e-2, key=0.1) == []
    assert places(tmp_path, full, reduced, rotation=1e-5) != []


def moved(asset: Asset) -> Asset:
    template = asset.rig.template.copy()
    template[20] += [0, 2e-5, 0]
    return with_rig(asset, template=template)


def morphed(asset: Asset) -> Asset:
    shapes = asset.rig.blend_shapes.copy()
    shapes[3, 50, 2] += 2e-5
    return with_rig(asset, blend_shapes=shapes)


def reweighted(asset: Asset) -> Asset:
    weights = asset.rig.weights.copy()
    largest, second = np.argsort(weights[60])[::-1][:2]
    weights[60, largest] += 0.01
    weights[60, second] -= 0.01
    return with_rig(asset, weights=weights)


def rejointed(asset: Asset) -> Asset:
    return with_rig(asset, joints=asset.rig.joints + np.array([0, 3e-5, 0]))


def rekeyed(asset: Asset) -> Asset:
    keys = asset.rig.keys
    assert keys is not None
    last = replace(keys.layers[-1], weight=keys.layers[-1].weight * 1.5)
    return with_rig(asset, keys=KeyNetwork((*keys.layers[:-1], last)))


def recoloured(asset: Asset) -> Asset:
    return replace(asset, materials=(replace(asset.materials[0], roughness=0.9), *asset.materials[1:]))


def textured(asset: Asset) -> Asset:
    texture = Texture("t.png", PNG, "image/png")
    return replace(asset, materials=(asset.materials[0], replace(asset.materials[1], base_color_texture=texture)))


def turned(asset: Asset) -> Asset:
    motion = make_motion()
    motion.poses[12, 16, 0] += 0.01
    return replace(asset, clips=(Clip(motion, (asset.rig.pose_keys(make_motion().poses),)),))


def faster(asset: Asset) -> Asset:
    return replace(asset, clips=(Clip(replace(make_motion(), fps=60.0)),))


def retextured(asset: Asset) -> Asset:
    first = asset.primitives[0]
    assert first.texcoords is not None
    changed = replace(first, texcoords=first.texcoords + np.float32([0, 0.01]))
    return replace(asset, primitives=(changed, *asset.primitives[1:]))


def flipped(asset: Asset) -> Asset:
    first = asset.primitives[0]
    return replace(asset, primitives=(replace(first, triangles=first.triangles[:, ::-1]), *asset.primitives[1:]))


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (moved, {"meshes/0/primitives/0/POSITION"}),
        (morphed, {"meshes/0/primitives/0/targets/3/POSITION"}),
        (reweighted, {"meshes/0/primitives/0/WEIGHTS"}),
        (retextured, {"meshes/0/primitives/0/TEXCOORD_0"}),
        (flipped, {"meshes/0/primitives/0/indices"}),
        (rejointed, {"nodes/translation", "animations/0/pelvis/translation"}),
        (rekeyed, {"nodes/25/pose_keys", "animations/0/gown/weights"}),
        (recoloured, {"meshes/0/primitives/0/material/pbrMetallicRoughness/roughnessFactor"}),
        (turned, {"animations/0/left_shoulder/rotation"}),
    ],
)
def test_every_change_is_found_where_it_is(
    tmp_path: Path, change: Callable[[Asset], Asset], expected: set[str]
) -> None:
    asset = make_asset(columns=16, rows=12)
    assert set(places(tmp_path, asset, change(asset))) == expected


def test_textures_are_compared_by_their_content(tmp_path: Path) -> None:
    asset = make_asset()
    found = places(tmp_path, asset, textured(asset))
    assert "meshes/0/primitives/1/material/pbrMetallicRoughness/baseColorTexture/image" in found
    assert places(tmp_path, textured(asset), textured(asset)) == []


def test_other_speed_is_another_duration(tmp_path: Path) -> None:
    assert "animations/0/duration" in places(tmp_path, make_asset(), faster(make_asset()))


def test_another_structure_is_told_first(tmp_path: Path) -> None:
    assert places(tmp_path, make_asset(parts=2), make_asset(parts=3)) == ["meshes/0/primitives"]
    assert places(tmp_path, make_asset(morphs=4), make_asset(morphs=5)) == [
        "meshes/0/targets",
        "meshes/0/extras/targetNames",
    ]
    assert places(tmp_path, make_asset(), make_asset(pose_keys=False)) == ["nodes/25/pose_keys"]
    assert places(tmp_path, make_asset(), replace(make_asset(), clips=())) == ["animations"]


def test_of_long_lists_the_items_that_differ_are_told() -> None:
    names = [f"joint{number}" for number in range(24)]
    renamed = [*names[:20], "hand", "glove", *names[22:]]
    assert [str(difference) for difference in unequal("nodes", names, renamed)] == [
        "nodes: 2 of 24 differ, number 20 from 'joint20' to 'hand'"
    ]
    assert [str(difference) for difference in unequal("nodes", names, names[:3])] == ["nodes: 24 became 3"]
    assert not list(unequal("nodes", names, [*names]))


def test_another_topology_is_told_as_counts(tmp_path: Path) -> None:
    found = places(tmp_path, make_asset(parts=1, columns=24), make_asset(parts=1, columns=25))
    assert found[:2] == ["meshes/0/primitives/0/vertices", "meshes/0/primitives/0/triangles"]
