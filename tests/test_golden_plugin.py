"""The pytest plugin for golden .glb files, used as its users use it: in a test run of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from gltf_samples import make_asset

from garmentc.gltf.write import write_glb

pytest_plugins = ["pytester"]

TEST = """
def test_it(assert_glb_matches):
    assert_glb_matches("made.glb", "goldens/golden.glb"{tolerance})
"""


@pytest.fixture
def folder(pytester: pytest.Pytester) -> Path:
    """made.glb and a golden of it whose first vertex is 3 mm away."""
    asset = make_asset()
    moved = asset.rig.template.copy()
    moved[0, 1] += 0.003
    (pytester.path / "goldens").mkdir()
    write_glb(asset, pytester.path / "made.glb")
    write_glb(replace(asset, rig=replace(asset.rig, template=moved)), pytester.path / "goldens" / "golden.glb")
    pytester.makepyfile(TEST.format(tolerance=""))
    return pytester.path


def test_a_difference_fails_and_says_what_differs_by_how_much(pytester: pytest.Pytester, folder: Path) -> None:
    result = pytester.runpytest("-p", "no:cacheprovider")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            "made.glb differs from the golden goldens/golden.glb:",
            "  meshes/0/primitives/*/POSITION: * differ, number * by 3 mm (tolerance 0.01 mm)",
            "*run pytest --update-goldens*",
        ]
    )


def test_a_tolerance_lets_it_pass(pytester: pytest.Pytester, folder: Path) -> None:
    pytester.makepyfile(TEST.format(tolerance=", position=0.004"))
    pytester.runpytest().assert_outcomes(passed=1)


def test_goldens_are_rewritten_on_request_only(pytester: pytest.Pytester, folder: Path) -> None:
    golden = folder / "goldens" / "golden.glb"
    before = golden.read_bytes()
    pytester.runpytest().assert_outcomes(failed=1)
    assert golden.read_bytes() == before
    pytester.runpytest("--update-goldens").assert_outcomes(passed=1)
    assert golden.read_bytes() == (folder / "made.glb").read_bytes()
    pytester.runpytest().assert_outcomes(passed=1)


def test_a_golden_that_is_not_there_is_written_on_request(pytester: pytest.Pytester, folder: Path) -> None:
    golden = folder / "goldens" / "golden.glb"
    golden.unlink()
    golden.parent.rmdir()
    result = pytester.runpytest()
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["there is no golden goldens/golden.glb; run pytest --update-goldens to write it"])
    pytester.runpytest("--update-goldens").assert_outcomes(passed=1)
    assert golden.exists()
