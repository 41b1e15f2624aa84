"""The same frames drawn by three.js, Filament and Blender, with the same camera, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from engine_runs import Refused
from PIL import Image

from conformance.engines import BLENDER, FILAMENT, THREE_GPU, attempt
from conformance.silhouette import View, drawn, pixels_apart, silhouette, view_of
from conformance.subject import Subject

RENDERERS = (THREE_GPU, FILAMENT, BLENDER)
_PAPER = (238, 238, 238, 255)


def draw_sheet(
    subject: Subject, angles: Sequence[float], folder: Path, python: Path, output: Path
) -> dict[str, float | Refused]:
    """Draw every frame of the subject, from its own angle, by every renderer into one PNG: a row for each frame.

    Returns how many pixels the outlines are off at most, by renderer.
    """
    shown = subject.positions(influences=4)
    views = [view_of(points, angle, width=384, height=512) for points, angle in zip(shown, angles, strict=True)]
    jobs = [
        {"glb": str(subject.glb), "time": time, "view": view.as_job()}
        for time, view in zip(subject.times, views, strict=True)
    ]
    sheet = Image.new("RGBA", (views[0].width * len(RENDERERS), views[0].height * len(views)), _PAPER)
    apart: dict[str, float | Refused] = {}
    for column, renderer in enumerate(RENDERERS):
        pictures = attempt(renderer, jobs, folder, python)
        for row, picture in enumerate(pictures):
            if isinstance(picture, Path):
                place = (column * views[row].width, row * views[row].height)
                sheet.alpha_composite(Image.open(picture).convert("RGBA"), place)
        apart[renderer.name] = _apart(pictures, shown, subject, views)
    sheet.convert("RGB").quantize(128, dither=Image.Dither.NONE).save(output, optimize=True)
    return apart


def _apart(
    pictures: Sequence[Path | Refused], shown: np.ndarray, subject: Subject, views: Sequence[View]
) -> float | Refused:
    worst = 0.0
    for picture, points, view in zip(pictures, shown, views, strict=True):
        if isinstance(picture, Refused):
            return picture
        worst = max(worst, pixels_apart(drawn(picture), silhouette(points, subject.triangles, view)))
    return worst
