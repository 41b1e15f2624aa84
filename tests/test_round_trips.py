"""Files stay drivable after other people's tools: glTF-Transform and gltfpack read them and write them again."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import engine_runs
import pytest
from conformance.gowns import Gown
from conformance.round_trips import (
    COMPRESSED,
    COPY,
    DENSE,
    FLOAT_PACKED,
    MESHOPT,
    OPTIMIZED,
    PACKED,
    TIDY,
    TRIPS,
    Returned,
    Trip,
    clipped,
    farthest,
    make_trips,
)
from conformance.subject import Subject, of_gowns

GOWNS = [Gown(4, 32, True, False), Gown(4, 32, True, True, parts=4), Gown(4, 32, False, True)]
"""Float and sparse as desktop; quantized and sparse, which only `--sparse auto` writes; quantized and dense as web."""

SKIN_WEIGHTS_IN_8_BITS = 3e-3
"""Metres. Neither tool writes better ones, whatever it is asked."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    engine_runs.require_engines()
    return tmp_path_factory.mktemp("round trips")


@pytest.fixture(scope="module")
def subjects(folder: Path) -> list[Subject]:
    return of_gowns(GOWNS, folder)


@pytest.fixture(scope="module")
def returned(subjects: list[Subject], folder: Path) -> dict[tuple[Trip, int], Returned]:
    """What comes back, by tool and number of the subject."""
    journeys = list(product(TRIPS, range(len(subjects))))
    made = make_trips([(trip, subjects[number]) for trip, number in journeys], folder)
    return dict(zip(journeys, made, strict=True))


def driven(returned: Returned) -> float:
    assert isinstance(returned.driven, float), returned.driven
    return returned.driven


@pytest.mark.parametrize(
    ("trip", "number"), [(COPY, 0), (COPY, 2), (DENSE, 0), (DENSE, 1), (TIDY, 0), (TIDY, 1), (TIDY, 2)], ids=str
)
def test_gltf_transform_keeps_a_file_as_it_is(
    returned: dict[tuple[Trip, int], Returned], subjects: list[Subject], trip: Trip, number: int
) -> None:
    back = returned[trip, number]
    assert back.issues == ()
    assert max(back.clip, driven(back)) <= 2 * subjects[number].tolerance


@pytest.mark.parametrize("number", range(len(GOWNS)))
def test_gltf_transform_resamples_animations_and_nothing_else(
    returned: dict[tuple[Trip, int], Returned], subjects: list[Subject], number: int
) -> None:
    back = returned[OPTIMIZED, number]
    assert back.clip <= 5e-4
    assert driven(back) <= 2 * subjects[number].tolerance


@pytest.mark.parametrize("number", range(len(GOWNS)))
@pytest.mark.parametrize("trip", [MESHOPT, FLOAT_PACKED, PACKED, COMPRESSED], ids=str)
def test_what_a_tool_quantizes_stays_drivable(
    returned: dict[tuple[Trip, int], Returned], trip: Trip, number: int
) -> None:
    assert driven(returned[trip, number]) <= SKIN_WEIGHTS_IN_8_BITS


def test_gltfpack_brings_the_morph_weights_of_animations_between_0_and_1(
    returned: dict[tuple[Trip, int], Returned], subjects: list[Subject], folder: Path
) -> None:
    """So a clip loses what its network sets below 0 or above 1; driven by the network the file does not."""
    subject = subjects[0]
    glb = returned[FLOAT_PACKED, 0].glb
    [found] = engine_runs.animated_positions("three_cpu.mjs", [glb], subject.times, folder)
    assert farthest(found, clipped(subject)) <= SKIN_WEIGHTS_IN_8_BITS < farthest(found, subject.positions())
