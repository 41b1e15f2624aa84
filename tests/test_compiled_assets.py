"""The compiler's real output in other people's programs: the Khronos validator, glTF-Transform and three.js.

What is compared with the rig was written with every keyframe kept, by the pipeline's own stages; one test compares what
`compile_outfit` writes, with its keyframes reduced. The Khronos validator sees both. GARMENTC_FULL=1 runs every
garment, profile and setting.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import engine_runs
import numpy as np
import pytest
from compiled import (
    EXAMPLES,
    FLOAT,
    FRAMES,
    MOTION,
    TIMES,
    Case,
    Measured,
    case,
    compile_case,
    largest,
    measure,
    obj_points,
)

from garmentc import compile_outfit
from garmentc.options import PROFILES
from garmentc.smpl.pose_sampler import sample_poses

FULL = os.environ.get("GARMENTC_FULL") == "1"

SKIRT, TROUSERS = EXAMPLES / "tee_and_skirt.obj", EXAMPLES / "tee_and_trousers.obj"

PRUNED = 2e-2
"""Metres. Coarser than the pipeline's own, which leaves too few zeros for any sparse shape among 8 or 128 floats."""

SETTINGS = [
    case(SKIRT, PRUNED, influences=influences, morphs=morphs, sparse=sparse, quantize=quantize)
    for influences, morphs, sparse, quantize in product((4, 8), (8, 32, 128), ("auto", "never"), (False, True))
    # By default: mobile and web are quantized, desktop and reference have eight influences.
    if FULL
    or (sparse == "auto" and (influences, morphs) == (4, 32))
    or (not quantize and (sparse == "auto" or influences == 4))
]
EXAMPLE_CASES = [*(case(outfit, profile=profile) for outfit in (SKIRT, TROUSERS) for profile in PROFILES), *SETTINGS]

GARMENTS = (
    "fedora",
    "female_casualsuit01",
    "female_casualsuit01_apose_dm",
    "female_casualsuit01_penetrating",
    "female_casualsuit01_unwelded",
    "female_casualsuit01_zup",
    "female_sportsuit01",
    "female_sportsuit01_nouv",
    "male_casualsuit01",
    "male_casualsuit04",
    "male_casualsuit04_cm_floor",
    "male_casualsuit04_ngon_negative_crlf",
    "male_casualsuit04_triangulated",
    "male_casualsuit04_zup_cm_floor",
    "male_outfit_casualsuit04_shoes01_fedora",
    "male_worksuit01",
    "shoes01",
)
WORN = GARMENTS if FULL else ("female_sportsuit01_nouv", "male_casualsuit04_zup_cm_floor")
WORN_PROFILES = tuple(PROFILES) if FULL else ("web",)

Record = Callable[[str, object], None]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    engine_runs.require_engines()
    return tmp_path_factory.mktemp("compiled")


@pytest.fixture(scope="module")
def examples(folder: Path) -> dict[Case, Measured]:
    return measure(EXAMPLE_CASES, folder)


@pytest.fixture(scope="module", params=WORN)
def worn(request: pytest.FixtureRequest, shared: Path, folder: Path) -> dict[str, Measured]:
    """One of the shared garments, by profile."""
    outfit = shared / "data" / "garments" / "makehuman" / f"{request.param}.obj"
    to_body = np.array(facts(outfit)["to_reference"])
    measured = measure([case(outfit, profile=profile) for profile in WORN_PROFILES], folder, to_body)
    return dict(zip(WORN_PROFILES, measured.values(), strict=True))


def facts(outfit: Path) -> dict[str, Any]:
    """What the makers of a shared garment wrote down about it."""
    known: dict[str, Any] = json.loads((outfit.parent / "metadata.json").read_text())["files"][outfit.name]
    return known


def assert_sound(measured: Measured) -> None:
    """Nothing to find, but that three.js leaves out influences where a file has eight."""
    for report in measured.khronos:
        engine_runs.assert_valid(report)
    others = [finding for finding in measured.findings if finding.code != "influence-limit"]
    assert others == []
    if measured.case.options.settings.influences == 4:
        assert measured.findings == ()


def assert_stored_as_asked(measured: Measured) -> None:
    if measured.case.pruned is not None:
        assert (measured.sparse > 0) == (measured.case.options.settings.sparse == "auto")


def assert_moves_as_the_rig(measured: Measured) -> None:
    assert measured.gltf_transform <= measured.tolerance
    assert measured.three <= measured.tolerance


def assert_rests_as_authored(measured: Measured) -> None:
    """The OBJ's own positions within a micrometre, or half a step of the quantization and that."""
    assert bool(measured.step) == measured.case.options.settings.quantize
    assert measured.step < 1e-4
    assert measured.rest <= 1e-6 + measured.step / 2


def test_every_way_to_store_a_rig_is_among_the_cases() -> None:
    settings = [each.options.settings for each in EXAMPLE_CASES]
    assert {each.influences for each in settings} == {4, 8}
    assert {each.morphs for each in settings} == {8, 32, 64, 128, None}
    assert {(each.quantize, each.sparse) for each in settings} >= {(False, "auto"), (False, "never"), (True, "auto")}


@pytest.mark.parametrize("example", EXAMPLE_CASES, ids=str)
def test_an_example_is_sound(examples: dict[Case, Measured], example: Case) -> None:
    assert_sound(examples[example])
    assert_stored_as_asked(examples[example])


@pytest.mark.parametrize("example", EXAMPLE_CASES, ids=str)
def test_an_example_moves_in_engines_as_its_rig_does(
    examples: dict[Case, Measured], example: Case, record_property: Record
) -> None:
    _record(examples[example], record_property)
    assert_moves_as_the_rig(examples[example])


@pytest.mark.parametrize("example", EXAMPLE_CASES, ids=str)
def test_an_example_rests_as_its_obj(examples: dict[Case, Measured], example: Case) -> None:
    assert_rests_as_authored(examples[example])


def test_compile_outfit_writes_what_the_stages_write_and_reduces_keyframes_as_it_says(folder: Path) -> None:
    """The first and the last frame are always kept; between them the report says how far the outfit is off.

    It measures every 20th vertex or so, but all frames: twice its figure bounds all vertices at four frames.
    """
    frames = [0, *FRAMES[:-1], 119]
    times = [float(np.float32(frame / 30)) for frame in frames]
    settings = {"profile": "web", "quantize": False}
    by_stages = compile_case(case(SKIRT, **settings), folder)
    report = compile_outfit(SKIRT, folder / "tee_and_skirt.glb", motion=(MOTION,), **settings)
    assert (folder / "tee_and_skirt.glb").read_bytes() == by_stages.written.path.read_bytes()
    assert report.rig.keyframes < report.rig.all_keyframes

    expected = by_stages.moved(by_stages.rig, frames)
    for program in ("gltf_transform.mjs", "three_cpu.mjs"):
        [found] = engine_runs.animated_positions(program, [folder / "tee_and_skirt.glb"], times, folder)
        off = np.linalg.norm(found - expected, axis=-1).max(axis=1)
        assert off[[0, -1]].max() <= FLOAT
        assert off.max() <= 2e-3 * report.rig.keyframe_error_mm + FLOAT


def test_three_drives_a_compiled_file_by_its_pose_key_network(folder: Path) -> None:
    made = compile_case(case(TROUSERS, influences=4, morphs=128, quantize=False, name="driven"), folder)
    poses, translations = sample_poses(5, seed=8), np.random.default_rng(8).normal(size=(5, 3))
    poses[0], translations[0] = 0, 0
    [found] = engine_runs.posed_positions([made.path], poses, translations, folder)
    assert largest(found - made.rig.posed(poses, translations)[:, made.corner_vertices]) <= FLOAT
    assert largest(found[0] - obj_points(TROUSERS)[made.obj_vertices]) <= 1e-6


def test_engines_would_notice_another_rig(folder: Path) -> None:
    """The comparison can fail: a tenth of a millimetre on one blend shape shows."""
    made = compile_case(case(SKIRT, influences=4, morphs=8, quantize=False, name="noticed"), folder)
    shapes = made.rig.blend_shapes.copy()
    shapes[:, 100] += 1e-4
    [found] = engine_runs.animated_positions("gltf_transform.mjs", [made.path], TIMES, folder)
    assert largest(found - made.moved(made.rig, FRAMES)) <= FLOAT
    assert largest(found - made.moved(replace(made.rig, blend_shapes=shapes), FRAMES)) > FLOAT


@pytest.mark.parametrize("profile", WORN_PROFILES)
def test_a_shared_garment_is_sound(worn: dict[str, Measured], profile: str) -> None:
    assert_sound(worn[profile])


@pytest.mark.parametrize("profile", WORN_PROFILES)
def test_a_shared_garment_moves_in_engines_as_its_rig_does(
    worn: dict[str, Measured], profile: str, record_property: Record
) -> None:
    _record(worn[profile], record_property)
    assert_moves_as_the_rig(worn[profile])


@pytest.mark.parametrize("profile", WORN_PROFILES)
def test_a_shared_garment_rests_as_its_obj(worn: dict[str, Measured], profile: str) -> None:
    """Whatever its units, axes and origin: its makers know where they put it on the body."""
    if facts(worn[profile].case.outfit)["pose"] != "T":
        pytest.skip("its pose is undone, so it does not rest as authored")
    assert_rests_as_authored(worn[profile])


@pytest.mark.skipif(not FULL, reason="set GARMENTC_FULL=1 to compile all of them")
def test_all_shared_garments_are_listed(shared: Path) -> None:
    assert sorted(path.stem for path in (shared / "data" / "garments" / "makehuman").glob("*.obj")) == list(GARMENTS)


def _record(measured: Measured, record_property: Record) -> None:
    """Figures for `--junitxml`."""
    issues = [report["issues"] for report in measured.khronos]
    record_property("outfit", measured.case.outfit.stem)
    record_property("settings", " ".join(f"{name}={value}" for name, value in measured.case.given))
    record_property("khronos", " ".join(f"{each['numErrors']}/{each['numWarnings']}" for each in issues))
    record_property("findings", "; ".join(map(str, measured.findings)))
    record_property("three", measured.three)
    record_property("gltf_transform", measured.gltf_transform)
    record_property("rest", measured.rest)
    record_property("step", measured.step)
    record_property("sparse", measured.sparse)
    record_property("bytes", measured.bytes)
    record_property("summary", measured.summary)
    record_property("warnings", "; ".join(measured.warnings))
