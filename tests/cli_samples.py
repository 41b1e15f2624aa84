"""A small outfit on disk, and the command line called in this process."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from garmentc.cli import main
from garmentc.smpl.default_body import load_default_body

MATERIALS = """newmtl cloth
Kd 0.2 0.3 0.6
map_Kd weave.png
newmtl hem
Kd 0.8 0.7 0.1
"""


def skirt_vertices(around: int, down: int) -> np.ndarray:
    """Rings (down, around, 3) from the waist of the neutral body to its knees, 2 cm wider than its hips."""
    body = load_default_body("neutral")
    joints = body.joints()
    rest = body.shaped()
    hips = rest[np.abs(rest[:, 1] - joints[1, 1]) < 0.03]
    hips = hips[np.abs(hips[:, 0]) < 0.3]
    centre, half = (hips.max(axis=0) + hips.min(axis=0)) / 2, (hips.max(axis=0) - hips.min(axis=0)) / 2 + 0.02
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)
    height = np.linspace(joints[0, 1] + 0.05, joints[4, 1], down)
    flare = np.linspace(1.0, 1.4, down)
    rings = np.empty((down, around, 3))
    rings[..., 0] = centre[0] + half[0] * flare[:, None] * np.sin(angle)
    rings[..., 1] = height[:, None]
    rings[..., 2] = centre[2] + half[2] * flare[:, None] * np.cos(angle)
    return rings


def write_skirt(folder: Path, around: int = 24, down: int = 8) -> Path:
    """skirt.obj with texture coordinates, two materials and a texture; returns its path."""
    from PIL import Image

    rings = skirt_vertices(around, down)
    lines = ["mtllib skirt.mtl", *(f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in rings.reshape(-1, 3))]
    lines += [f"vt {i / around:.6f} {1 - j / (down - 1):.6f}" for j in range(down) for i in range(around + 1)]
    for j in range(down - 1):
        lines += ["usemtl hem"] if j == down - 2 else ["usemtl cloth"] if j == 0 else []
        for i in range(around):
            corners = ((i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j))
            lines.append(
                "f " + " ".join(f"{b * around + a % around + 1}/{b * (around + 1) + a + 1}" for a, b in corners)
            )
    (folder / "skirt.obj").write_text("\n".join(lines) + "\n")
    (folder / "skirt.mtl").write_text(MATERIALS)
    checks = np.indices((8, 8)).sum(axis=0) % 2 * 200 + 30
    Image.fromarray(np.repeat(checks[..., None], 3, axis=2).astype(np.uint8)).save(folder / "weave.png")
    return folder / "skirt.obj"


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
