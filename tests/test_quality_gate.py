"""The quality gate: each fault that is made is found, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from garmentc.simulation.quality_gate import QualityLimits, SequenceQuality, check_sequence
from tests.cloth_samples import ball, sheet

BODY, FACES = ball(0.1)
FLAT, TRIANGLES = sheet(0.2, 0.2, 11, 11)
REST = FLAT + np.array([0, 0.105, 0])


def judge(*frames: np.ndarray, limits: QualityLimits | None = None) -> SequenceQuality:
    bodies = np.repeat(BODY[None], len(frames), axis=0)
    return check_sequence(REST, TRIANGLES, np.stack(frames), bodies, FACES, limits)


def names(quality: SequenceQuality, frame: int = -1) -> set[str]:
    return {reason.split(":")[0] for reason in quality.frames[frame].reasons}


def test_good_cloth_passes():
    quality = judge(REST, REST + np.array([0, 0.01, 0]))
    assert quality.accepted
    assert quality.accepted_frames.tolist() == [True, True]
    assert quality.frames[1].jump == pytest.approx(0.01)
    assert quality.frames[0].strain == pytest.approx((1, 1, 1, 1))


def test_vertices_in_the_body_are_counted_and_measured():
    poked = REST.copy()
    poked[60] -= [0, 0.05, 0]
    frame = judge(poked).frames[0]
    assert frame.penetration == pytest.approx(1 / 121)
    assert frame.depth == pytest.approx(0.045, abs=1e-3)
    assert {"penetration", "depth"} <= names(judge(poked))


def test_a_millimetre_is_allowed():
    quality = judge(REST - np.array([0, 0.0055, 0]))
    assert quality.frames[0].depth == pytest.approx(0.0005, abs=2e-4)
    assert quality.accepted


def test_crossings_are_found():
    folded = REST + np.array([0, 0.1, 0])
    folded[:11, 1:] += [-0.01, 0.063]  # one border folded in below the sheet, its last vertex up through it
    folded[5, 1] += 0.02
    assert judge(folded).frames[0].crossings > 2
    assert "crossings" in names(judge(folded))


def test_strain_is_measured_both_ways():
    assert names(judge(REST * [1.6, 1, 1.6])) == {"stretch"}
    assert names(judge(REST * [0.1, 1, 0.1] + np.array([0, 0.05, 0]))) == {"compression"}


def test_a_jump_is_judged_against_the_body():
    away = REST + np.array([0, 0.3, 0])
    assert names(judge(REST, away)) == {"jump"}
    together = check_sequence(
        REST, TRIANGLES, np.stack([REST, away]), np.stack([BODY, BODY + np.array([0, 0.3, 0])]), FACES
    )
    assert together.accepted


def test_no_place_is_no_frame():
    quality = judge(REST, np.full_like(REST, np.nan))
    assert names(quality) == {"finite"}
    assert quality.accepted_frames.tolist() == [True, False]


def test_mostly_bad_sequences_are_rejected_whole():
    bad = REST + np.array([0, -0.05, 0])
    quality = judge(REST, bad, bad)
    assert not quality.accepted
    assert "33%" in quality.reasons[0]
    assert not quality.accepted_frames.any()
    assert quality.rejections["depth"] == 2
    assert judge(REST, bad, bad, limits=replace(QualityLimits(), accepted_share=0.3)).accepted
