"""What other people's programs make of our files: the Khronos validator, glTF-Transform, three.js, Babylon.js."""

from __future__ import annotations

import io
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import engine_runs
import numpy as np
import pytest
from conformance.gowns import QUICK, Gown
from conformance.subject import FLOAT, Subject, of_gowns
from gltf_samples import corner_vertices, make_asset, make_keys
from PIL import Image

from garmentc.gltf.write import write_glb
from garmentc.outfit.outfit import Material, Texture
from garmentc.rig import ENCODING_WIDTHS
from garmentc.smpl.pose_sampler import sample_poses


@dataclass(frozen=True)
class Moved:
    """World positions (T, S, 3) of every gown, by an engine that reads so many influences."""

    influences: int
    positions: dict[Gown, np.ndarray]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    engine_runs.require_engines()
    return tmp_path_factory.mktemp("engines")


@pytest.fixture(scope="module")
def subjects(folder: Path) -> dict[Gown, Subject]:
    return dict(zip(QUICK, of_gowns(QUICK, folder), strict=True))


@pytest.fixture(scope="module")
def reports(subjects: dict[Gown, Subject], folder: Path) -> dict[Gown, dict]:
    glbs = [subject.glb for subject in subjects.values()]
    return dict(zip(subjects, engine_runs.khronos_reports(glbs, folder), strict=True))


@pytest.fixture(scope="module", params=["gltf_transform.mjs", "three_cpu.mjs", "babylon.mjs"])
def moved(request: pytest.FixtureRequest, subjects: dict[Gown, Subject], folder: Path) -> Moved:
    """What each engine makes of all files."""
    glbs, times = [subject.glb for subject in subjects.values()], subjects[QUICK[0]].times
    found = engine_runs.animated_positions(request.param, glbs, times, folder)
    return Moved(4 if request.param == "three_cpu.mjs" else 8, dict(zip(subjects, found, strict=True)))


@pytest.mark.parametrize("gown", QUICK, ids=str)
def test_the_khronos_validator_is_content(reports: dict[Gown, dict], gown: Gown) -> None:
    engine_runs.assert_valid(reports[gown])


@pytest.mark.parametrize("gown", QUICK, ids=str)
def test_an_engine_moves_every_vertex_as_the_rig_does(moved: Moved, subjects: dict[Gown, Subject], gown: Gown) -> None:
    expected = subjects[gown].positions(moved.influences)
    np.testing.assert_allclose(moved.positions[gown], expected, atol=subjects[gown].tolerance, rtol=0)


@pytest.mark.parametrize("encoding", ENCODING_WIDTHS)
def test_three_drives_the_pose_keys_as_the_document_says(encoding: str, folder: Path) -> None:
    asset = make_asset(morphs=32)
    asset = replace(asset, rig=replace(asset.rig, keys=make_keys(32, np.random.default_rng(7), encoding)))
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
