"""A small outfit on disk, and the command line called in this process."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from garmentc.cli import main
from garmentc.outfit.topology import vertex_normals
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.skeleton import JOINT_NAMES

TRUNK = ("pelvis", "spine1", "spine2", "spine3", "left_collar", "right_collar")

MATERIALS = """newmtl cloth
Kd 0.2 0.3 0.6
map_Kd weave.png
newmtl hem
Kd 0.8 0.7 0.1
"""


def write_top(folder: Path) -> Path:
    """top.obj: the skin of the female body's trunk, 15 mm out, with two materials and a texture; returns its path."""
    from PIL import Image

    body = load_default_body("female")
    trunk = body.weights[:, [JOINT_NAMES.index(name) for name in TRUNK]].sum(axis=1) > 0.6
    faces = body.faces[trunk[body.faces].all(axis=1)]
    used, triangles = np.unique(faces, return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    points = (body.v_template + 0.015 * vertex_normals(body.v_template, body.faces))[used]
    turn = np.arctan2(points[:, 0], points[:, 2]) / (2 * np.pi) + 0.5
    lines = ["mtllib top.mtl", *(f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points)]
    lines += [f"vt {u:.6f} {v:.6f}" for u, v in zip(turn, points[:, 1] - points[:, 1].min(), strict=True)]
    low = points[triangles][:, :, 1].min(axis=1) < points[:, 1].min() + 0.05
    for material, group in (("cloth", triangles[~low]), ("hem", triangles[low])):
        lines += [f"usemtl {material}", *(f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in group + 1)]
    (folder / "top.obj").write_text("\n".join(lines) + "\n")
    (folder / "top.mtl").write_text(MATERIALS)
    checks = np.indices((8, 8)).sum(axis=0) % 2 * 200 + 30
    Image.fromarray(np.repeat(checks[..., None], 3, axis=2).astype(np.uint8)).save(folder / "weave.png")
    return folder / "top.obj"


@dataclass(frozen=True)
class Result:
    """What a command left: its exit code and what it printed."""

    code: int
    out: str
    err: str

    @property
    def error_lines(self) -> list[str]:
        return [line for line in self.err.splitlines() if line.startswith("garmentc: error: ")]


class CommandLine:
    """Calls the real command line in this process."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

    def __call__(self, *arguments: object) -> Result:
        self._capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        captured = self._capsys.readouterr()
        return Result(code, captured.out, captured.err)

    def fails(self, *arguments: object) -> str:
        """Expects exit code 2 and exactly one line on stderr; returns it."""
        result = self(*arguments)
        assert result.code == 2, result
        assert result.err.count("\n") == 1, result.err
        assert "Traceback" not in result.err
        assert len(result.error_lines) == 1
        return result.err.strip()
