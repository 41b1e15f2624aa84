"""Materials: factors, extensions, embedded and shared textures."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_samples import make_asset
from PIL import Image

from garmentc.gltf.glb import read_chunks
from garmentc.gltf.read import read_glb
from garmentc.gltf.write import write_glb
from garmentc.outfit.outfit import Material, Texture


def png(color: tuple[int, int, int]) -> bytes:
    file = io.BytesIO()
    Image.new("RGB", (4, 4), color).save(file, "PNG")
    return file.getvalue()


def written(tmp_path: Path, *materials: Material, uv: bool = True) -> dict[str, Any]:
    asset = replace(make_asset(morphs=0, parts=len(materials), uv=uv), materials=materials)
    write_glb(asset, tmp_path / "a.glb")
    return read_chunks(tmp_path / "a.glb").document


def test_factors(tmp_path: Path) -> None:
    material = Material("silk", base_color=(0.1, 0.2, 0.3, 0.5), metallic=0.25, roughness=0.75, alpha_mode="BLEND")
    [gltf] = written(tmp_path, material)["materials"]
    assert gltf["name"] == "silk"
    assert gltf["pbrMetallicRoughness"]["baseColorFactor"] == [0.1, 0.2, 0.3, 0.5]
    assert gltf["pbrMetallicRoughness"]["metallicFactor"] == 0.25
    assert gltf["pbrMetallicRoughness"]["roughnessFactor"] == 0.75
    assert gltf["alphaMode"] == "BLEND"
    assert gltf["doubleSided"] is True
    assert "alphaCutoff" not in gltf
    assert "extensions" not in gltf


def test_specular_and_strong_emission_are_extensions(tmp_path: Path) -> None:
    document = written(tmp_path, Material("lamp", specular_color=(0.5, 0.5, 1.5), emissive=(2.0, 1.0, 0.0)))
    [gltf] = document["materials"]
    assert gltf["emissiveFactor"] == [1.0, 0.5, 0.0]
    assert gltf["extensions"]["KHR_materials_emissive_strength"] == {"emissiveStrength": 2.0}
    assert gltf["extensions"]["KHR_materials_specular"] == {"specularColorFactor": [0.5, 0.5, 1.5]}
    assert document["extensionsUsed"] == ["KHR_materials_emissive_strength", "KHR_materials_specular"]
    assert "extensionsRequired" not in document


def test_numpy_numbers_in_a_material_are_written(tmp_path: Path) -> None:
    color = tuple(np.array([0.5, 0.25, 0.125, 1.0], np.float32))
    [gltf] = written(tmp_path, Material("m", base_color=color))["materials"]
    assert gltf["pbrMetallicRoughness"]["baseColorFactor"] == [0.5, 0.25, 0.125, 1.0]


def test_textures_are_embedded_and_shared(tmp_path: Path) -> None:
    red, blue = png((255, 0, 0)), png((0, 0, 255))
    first = Material("a", base_color_texture=Texture("red.png", red, "image/png"))
    second = Material(
        "b",
        base_color_texture=Texture("red.png", red, "image/png"),
        normal_texture=Texture("blue.png", blue, "image/png", clamp=True),
        normal_scale=0.5,
    )
    document = written(tmp_path, first, second)
    images = read_glb(tmp_path / "a.glb").images
    assert [image.data for image in images] == [red, blue]
    assert Image.open(io.BytesIO(images[1].data)).getpixel((0, 0)) == (0, 0, 255)
    assert len(document["textures"]) == 2
    a, b = document["materials"]
    texture = a["pbrMetallicRoughness"]["baseColorTexture"]["index"]
    assert b["pbrMetallicRoughness"]["baseColorTexture"]["index"] == texture
    assert b["normalTexture"]["scale"] == 0.5
    clamped = document["samplers"][document["textures"][b["normalTexture"]["index"]]["sampler"]]
    assert (clamped["wrapS"], clamped["wrapT"]) == (33071, 33071)


def test_scale_and_offset_sample_the_texel_that_the_mtl_means(tmp_path: Path) -> None:
    scale, offset = (2.0, 3.0), (0.25, 0.125)
    texture = Texture("t.png", png((1, 2, 3)), "image/png", scale=scale, offset=offset)
    document = written(tmp_path, Material("m", base_color_texture=texture))
    info = document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
    transform = info["extensions"]["KHR_texture_transform"]
    u, v = 0.3, 0.7  # OBJ convention
    meant = (u * scale[0] + offset[0], v * scale[1] + offset[1])
    given = (
        u * transform["scale"][0] + transform["offset"][0],
        (1 - v) * transform["scale"][1] + transform["offset"][1],
    )
    assert given == pytest.approx((meant[0], 1 - meant[1]))


def test_a_primitive_without_texture_coordinates_gets_no_textures(tmp_path: Path) -> None:
    texture = Texture("t.png", png((1, 2, 3)), "image/png")
    document = written(tmp_path, Material("m", base_color_texture=texture), uv=False)
    assert "baseColorTexture" not in document["materials"][0]["pbrMetallicRoughness"]
    assert "images" not in document


def test_unused_materials_are_left_out(tmp_path: Path) -> None:
    asset = make_asset(morphs=0, parts=1)
    asset = replace(asset, materials=(*asset.materials, Material("unused")))
    write_glb(asset, tmp_path / "a.glb")
    assert [material["name"] for material in read_chunks(tmp_path / "a.glb").document["materials"]] == ["cloth 0"]
