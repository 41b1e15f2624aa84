"""What other people's programs make of our files: the Khronos validator, glTF-Transform and three.js."""

from __future__ import annotations

import io
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path

import engine_runs
import numpy as np
import pytest
from gltf_samples import corner_vertices, make_asset
from PIL import Image

from garmentc.gltf.asset import Asset
from garmentc.gltf.write import write_glb
from garmentc.outfit.outfit import Material, Texture
from garmentc.rig import Rig
from garmentc.smpl.pose_sampler import sample_poses

FLOAT, QUANTIZED = 2e-6, 2e-4  # metres
FRAMES = (0, 7, 17, 29)


@dataclass(frozen=True)
class Case:
    influences: int
    morphs: int
    sparse: bool
    quantize: bool
    parts: int = 2
    normals: bool = True

    def __str__(self) -> str:
        words = ["sparse" if self.sparse else "dense", "quantized" if self.quantize else "float"]
        words += [f"{self.parts}parts"] if self.parts != 2 else []
        words += [] if self.normals else ["nonormals"]
        return f"{self.influences}-{self.morphs}-" + "-".join(words)

    def asset(self) -> Asset:
        return _asset(self)


@cache
def _asset(case: Case) -> Asset:
    options = {"sparse": case.sparse, "quantize": case.quantize, "key_tolerance": 0}
    return make_asset(case.morphs, case.influences, case.parts, case.normals, **options)


CASES = [
    *(Case(*values) for values in product((4, 8), (8, 32, 128), (False, True), (False, True))),
    Case(4, 8, True, False, parts=1),
    Case(4, 8, True, True, parts=4),
    Case(4, 8, True, False, normals=False),
    Case(4, 0, True, False),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    engine_runs.require_engines()
    return tmp_path_factory.mktemp("engines")


@pytest.fixture(scope="module")
def glbs(folder: Path) -> list[Path]:
    paths = [folder / f"{case}.glb" for case in CASES]
    for case, path in zip(CASES, paths, strict=True):
        write_glb(case.asset(), path)
    return paths


@pytest.fixture(scope="module")
def times() -> list[float]:
    return [float(np.float32(frame / 30)) for frame in FRAMES]


@pytest.fixture(scope="module")
def reports(glbs: list[Path], folder: Path) -> dict[Case, dict]:
    return dict(zip(CASES, engine_runs.khronos_reports(glbs, folder), strict=True))


@pytest.fixture(scope="module")
def in_gltf_transform(glbs: list[Path], times: list[float], folder: Path) -> dict[Case, np.ndarray]:
    found = engine_runs.animated_positions("gltf_transform.mjs", glbs, times, folder)
    return dict(zip(CASES, found, strict=True))


@pytest.fixture(scope="module")
def in_three(glbs: list[Path], times: list[float], folder: Path) -> dict[Case, np.ndarray]:
    return dict(zip(CASES, engine_runs.animated_positions("three_cpu.mjs", glbs, times, folder), strict=True))


def expected(asset: Asset, rig: Rig) -> np.ndarray:
    motion = asset.clips[0].motion
    return rig.posed(motion.poses[list(FRAMES)], motion.trans[list(FRAMES)])[:, corner_vertices(asset)]


@pytest.mark.parametrize("case", CASES, ids=str)
def test_the_khronos_validator_is_content(reports: dict[Case, dict], case: Case) -> None:
    engine_runs.assert_valid(reports[case])


@pytest.mark.parametrize("case", CASES, ids=str)
def test_gltf_transform_moves_every_vertex_as_the_rig_does(
    in_gltf_transform: dict[Case, np.ndarray], case: Case
) -> None:
    asset = case.asset()
    tolerance = QUANTIZED if case.quantize else FLOAT
    np.testing.assert_allclose(in_gltf_transform[case], expected(asset, asset.rig), atol=tolerance, rtol=0)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_three_moves_every_vertex_as_the_rig_does(in_three: dict[Case, np.ndarray], case: Case) -> None:
    asset = case.asset()
    rig = engine_runs.first_four(asset.rig) if case.influences > 4 else asset.rig
    tolerance = QUANTIZED if case.quantize else FLOAT
    np.testing.assert_allclose(in_three[case], expected(asset, rig), atol=tolerance, rtol=0)


def test_three_drives_the_pose_keys_as_the_document_says(folder: Path) -> None:
    asset = make_asset(morphs=32)
    write_glb(asset, folder / "keys.glb")
    poses, translations = sample_poses(6, seed=4), np.random.default_rng(4).normal(size=(6, 3))
    poses[1] = 0
    poses[2, 0] = [0, 2.5, 0]
    [found] = engine_runs.posed_positions([folder / "keys.glb"], poses, translations, folder)
    posed = asset.rig.posed(poses, translations)[:, corner_vertices(asset)]
    np.testing.assert_allclose(found, posed, atol=FLOAT, rtol=0)


def test_the_khronos_validator_is_content_with_materials_and_colours(folder: Path) -> None:
    def image(color: tuple[int, int, int], kind: str) -> bytes:
        file = io.BytesIO()
        Image.new("RGB", (8, 8), color).save(file, kind)
        return file.getvalue()

    red = Texture("red.png", image((255, 0, 0), "PNG"), "image/png", scale=(2.0, 2.0), offset=(0.5, 0.0))
    bumps = Texture("bumps.jpg", image((128, 128, 255), "JPEG"), "image/jpeg", clamp=True)
    materials = (
        Material("a", base_color_texture=red, normal_texture=bumps, specular_color=(0.2, 0.2, 0.2)),
        Material("b", emissive=(3.0, 0.0, 0.0), metallic_roughness_texture=red, alpha_mode="MASK"),
    )
    paths = []
    for quantize, uv in product((False, True), (False, True)):
        asset = replace(make_asset(uv=uv, quantize=quantize), materials=materials)
        colors = [np.random.default_rng(0).random((len(part.vertices), 3)) for part in asset.primitives]
        coloured = [replace(part, colors=color) for part, color in zip(asset.primitives, colors, strict=True)]
        paths.append(folder / f"materials-{quantize}-{uv}.glb")
        write_glb(replace(asset, primitives=tuple(coloured)), paths[-1])
    for report in engine_runs.khronos_reports(paths, folder):
        engine_runs.assert_valid(report)
