"""What the ablations are, and what was measured of them as a Markdown document beside the paper's figures."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass

from garmentc.evaluation.group_scores import GroupScores


@dataclass(frozen=True)
class Ablation:
    """`paper` is the error in mm that Bertiche et al. 2021 print for it (table 1, 2 or 4) on CLOTH3D."""

    name: str
    what: str
    paper: float | None = None

    @property
    def config(self) -> str:
        """The recipe's name."""
        return f"ablation_{self.name}"


ABLATIONS = (
    Ablation("skinning_only", "blend weights alone", 36.73),
    Ablation("baseline_local", "deformations of vertices in place of blend shapes, no global descriptor", 29.98),
    Ablation("baseline", "deformations of vertices, with the global descriptor", 28.04),
    Ablation("no_pose_embedding", "the encoded pose itself is the keys", 30.93),
    Ablation("full", "DeePSD: blend shapes, pose embedding, 128 keys", 25.13),
    Ablation("fabric", "and told the fabric (the paper: fabric and tightness)", 24.66),
    Ablation("physics", "and χ in simulated poses", 33.75),
    Ablation("physics_random_poses", "and χ in simulated and random poses", 34.45),
    Ablation("no_global", "without the global descriptor"),
    Ablation("keys_32", "32 keys"),
    Ablation("keys_64", "64 keys"),
    Ablation("encoding_axis_angle", "pose as 24 axis-angles with heading, as in the paper"),
    Ablation("encoding_gravity_joints", "pose as axis-angles, and gravity in the frame of every joint"),
    Ablation("encoding_gravity_6d", "pose as 6 numbers a joint and gravity"),
    Ablation("encoding_gravity_matrix", "pose as rotation matrices and gravity"),
    Ablation("squared_loss", "the squared distance as loss, as in the paper"),
    Ablation("no_mirror", "without mirrored outfits"),
    Ablation("ignored_joints", "keys do not see toes, head, wrists and hands"),
    Ablation("edge", "and edges keep their length in stage A"),
)


@dataclass(frozen=True)
class Measured:
    """rows: scores by method. logs: log.jsonl of each run."""

    sha256: str
    rows: dict[str, GroupScores]
    logs: dict[str, str]


def markdown(measured: Measured) -> str:
    """The document."""
    there = [ablation for ablation in ABLATIONS if ablation.name in measured.logs]
    full = measured.rows.get("full")
    lines = [
        "| ablation | what differs | error mm | × full | edge mm | bend | collided % | paper, error mm | × its full |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
        _line("nearest", "weights of the nearest body vertex, not learned", measured, full, None),
        *(_line(a.name, a.what, measured, full, a.paper) for a in there),
    ]
    curves = [
        "| steps of stage A | " + " | ".join(a.name for a in there if a.name in _CURVES) + " |",
        "| ---: |" + " ---: |" * sum(a.name in _CURVES for a in there),
        *_curve_lines([a.name for a in there if a.name in _CURVES], measured.logs),
    ]
    missing = [ablation.name for ablation in ABLATIONS if ablation.name not in measured.logs]
    left = ["", f"Not trained here: {', '.join(missing)}."] if missing else []
    return "\n".join([_HEAD.format(sha256=measured.sha256[:12]), *lines, *left, "", _CURVE_TEXT, *curves, ""])


_PAPER_FULL = 25.13

_CURVES = ("skinning_only", "baseline", "no_pose_embedding", "full", "no_global")

_HEAD = """# Ablations

Every network is trained with the same budget on the same dataset (benchmark-v1, {sha256}) and measured on its split
`test`, outfits and motions that no network has seen: the networks themselves with four influences a vertex, before the
passes of a compile. `make ablations` trains and measures them all, and writes this file. Means over an outfit's frames
and then over outfits, as [measuring](evaluation.md) has it.

The paper's column is not a target in millimetres: its data (CLOTH3D) are closed; ours have other outfits, motions and
cloth, about a tenth of the outfits and a fraction of the steps. Orders and ratios compare. The budget is also smaller
than that of the bundle that garmentc ships, whose figures are in [its model card](model_card.md).
"""

_CURVE_TEXT = """Learning curves: error on the held-out outfits and motions in mm, as the trainer measures it (every
eighth frame).
"""


def _line(name: str, what: str, measured: Measured, full: GroupScores | None, paper: float | None) -> str:
    row = measured.rows[name]
    error = row.error_mm.mean
    ratio = "–" if full is None or not full.error_mm.mean or error is None else f"{error / full.error_mm.mean:.2f}"
    cells = [name, what, _number(error, 2), ratio, *_physics(row)]
    its_ratio = None if paper is None else paper / _PAPER_FULL
    return "| " + " | ".join([*cells, _number(paper, 2), _number(its_ratio, 2)]) + " |"


def _physics(row: GroupScores) -> list[str]:
    collided = None if row.collision.mean is None else 100 * row.collision.mean
    return [_number(row.edge_mm.mean, 2), _number(row.bend.mean, 3), _number(collided, 2)]


def _number(value: float | None, decimals: int) -> str:
    return "–" if value is None else f"{value:.{decimals}f}"


def _curve_lines(names: list[str], logs: dict[str, str]) -> Iterable[str]:
    curves = {name: _curve(logs[name]) for name in names}
    for step in sorted({step for curve in curves.values() for step in curve}):
        yield f"| {step} | " + " | ".join(_number(curves[name].get(step), 1) for name in names) + " |"


def _curve(log: str) -> dict[int, float]:
    entries = [json.loads(line) for line in log.splitlines()]
    return {int(e["step"]): float(e["error_mm"]) for e in entries if e["stage"] == "data" and "error_mm" in e}
