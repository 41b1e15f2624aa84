"""Which simulated frames are good enough to learn from, and why the others are not."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.evaluation.metrics import signed_distance
from garmentc.outfit.topology import edge_lengths
from garmentc.outfit.topology import edges as edges_of
from garmentc.simulation.self_crossings import self_crossings

DEPTH = 0.001
"""Metres: cloth deeper in the body than this is a fault that shows."""


@dataclass(frozen=True)
class QualityLimits:
    """What a frame may have at most.

    penetration     share of vertices deeper than 1 mm in the body
    depth           metres: of the deepest vertex
    crossings       share of edges that pierce the cloth itself
    stretch         99th percentile of edge length over rest length
    longest_edge    largest edge length over rest length
    compression     1st percentile of edge length over rest length, at least
    jump            metres that a vertex moves between frames, beyond what the body's fastest vertex does
    accepted_share  of a sequence's frames that must be good for the sequence to be kept
    """

    penetration: float = 0.005
    depth: float = 0.01
    crossings: float = 0.002
    stretch: float = 1.4
    longest_edge: float = 3.0
    compression: float = 0.3
    jump: float = 0.1
    accepted_share: float = 0.5


@dataclass(frozen=True)
class FrameQuality:
    """One frame, measured. `reasons` is empty for a good one; each reason starts with the name of the limit.

    penetration    share of vertices deeper than 1 mm in the body
    depth          metres: the deepest vertex, 0 where all are outside
    crossings      edges that pierce the cloth itself
    strain         1st, 50th and 99th percentile and maximum of edge length over rest length
    jump           metres: longest way of a vertex since the frame before, 0 in the first
    """

    penetration: float
    depth: float
    crossings: int
    strain: tuple[float, float, float, float]
    jump: float
    reasons: tuple[str, ...]

    @property
    def accepted(self) -> bool:
        return not self.reasons


@dataclass(frozen=True)
class SequenceQuality:
    """All frames of a sequence; `reasons` is empty where the sequence is kept (less its bad frames)."""

    frames: tuple[FrameQuality, ...]
    reasons: tuple[str, ...]

    @property
    def accepted(self) -> bool:
        return not self.reasons

    @property
    def accepted_frames(self) -> NDArray[np.bool_]:
        """Which frames (T,) to keep: the good ones of a sequence that is kept."""
        return np.array([self.accepted and frame.accepted for frame in self.frames], dtype=bool)

    @property
    def rejections(self) -> dict[str, int]:
        """How many frames each limit rejected, most first. A frame may count under several."""
        names = Counter(reason.split(":")[0] for frame in self.frames for reason in frame.reasons)
        return dict(sorted(names.items(), key=lambda item: (-item[1], item[0])))


def check_sequence(
    rest: NDArray[Any],
    triangles: NDArray[Any],
    frames: NDArray[Any],
    body_frames: NDArray[Any],
    faces: NDArray[Any],
    limits: QualityLimits | None = None,
) -> SequenceQuality:
    """Measure every frame of a simulation and judge it.

    rest         (N, 3) unstretched cloth, triangles (F, 3)
    frames       (T, N, 3) simulated cloth
    body_frames  (T, V, 3) of the closed body with faces (G, 3)
    """
    limits = limits or QualityLimits()
    edges = edges_of(np.asarray(triangles, np.int32))
    lengths = edge_lengths(rest, edges)
    judged = []
    for index, (cloth, body) in enumerate(zip(frames, body_frames, strict=True)):
        before = (frames[index - 1], body_frames[index - 1]) if index else (cloth, body)
        judged.append(_check_frame(cloth, body, before, triangles, faces, edges, lengths, limits))
    share = float(np.mean([frame.accepted for frame in judged])) if judged else 0.0
    kept = share >= limits.accepted_share
    reasons = (
        () if kept else (f"accepted_share: {share:.0%} of the frames are good; {limits.accepted_share:.0%} must be",)
    )
    return SequenceQuality(tuple(judged), reasons)


def _check_frame(
    cloth: NDArray[Any],
    body: NDArray[Any],
    before: tuple[NDArray[Any], NDArray[Any]],
    triangles: NDArray[Any],
    faces: NDArray[Any],
    edges: NDArray[np.int32],
    lengths: NDArray[np.float64],
    limits: QualityLimits,
) -> FrameQuality:
    if not np.isfinite(cloth).all():
        return FrameQuality(1.0, np.inf, 0, (np.nan,) * 4, np.inf, ("finite: the cloth has vertices at no place",))
    distance = signed_distance(cloth, body, faces)
    depth = max(-float(distance.min()), 0.0)
    penetration = float((distance < -DEPTH).mean())
    crossings = len(self_crossings(cloth, triangles))
    low, middle, high, longest = map(float, np.percentile(edge_lengths(cloth, edges) / lengths, [1, 50, 99, 100]))
    jump, carried = (_longest_way(now, then) for now, then in zip((cloth, body), before, strict=True))
    checks = (
        (
            "penetration",
            penetration,
            limits.penetration,
            f"{penetration:.2%} of the vertices are over 1 mm in the body",
        ),
        ("depth", depth, limits.depth, f"a vertex is {1000 * depth:.1f} mm deep in the body"),
        ("crossings", crossings / len(edges), limits.crossings, f"{crossings} edges pierce the cloth"),
        ("stretch", high, limits.stretch, f"one edge in a hundred is stretched over {high:.2f} times"),
        ("longest_edge", longest, limits.longest_edge, f"an edge is stretched {longest:.2f} times"),
        ("compression", -low, -limits.compression, f"one edge in a hundred is pressed below {low:.2f} of its length"),
        ("jump", jump - carried, limits.jump, f"a vertex jumps {1000 * jump:.0f} mm"),
    )
    reasons = tuple(f"{name}: {text}" for name, value, most, text in checks if value > most)
    return FrameQuality(penetration, depth, crossings, (low, middle, high, longest), jump, reasons)


def _longest_way(now: NDArray[Any], before: NDArray[Any]) -> float:
    return float(np.linalg.norm(np.asarray(now, np.float64) - before, axis=1).max())
