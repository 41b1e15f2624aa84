"""A contact sheet of a dataset: for people to see whether it looks like clothes."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.output import written_whole
from garmentc.simulation.dataset import Dataset
from garmentc.simulation.sequence import Sample, Sequence
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.rotations import axis_angle_to_matrix

if TYPE_CHECKING:
    from PIL.Image import Image

CELL = (240, 320)
"""Width and height of one picture, pixels."""

_CAPTION = 34
_HEIGHT = 2.1
"""Metres that the height of a picture shows."""

_VIEW = axis_angle_to_matrix(np.array([0.15, 0.0, 0.0])) @ axis_angle_to_matrix(np.array([0.0, -0.5, 0.0]))
_LIGHT = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])
_BEHIND = 0.03
"""Metres that skin is painted further away than it is: coarse cloth close to it would else be spotted with skin."""

_BEFORE = 0.01
"""Metres that each further layer is painted nearer than it is, likewise."""

_SKIN = (205, 185, 170)
_CLOTH = ((70, 110, 180), (190, 80, 70), (90, 150, 90), (190, 160, 80))


def write_preview(dataset: Dataset, path: Path, count: int = 24) -> None:
    """Write a picture with a frame of each of `count` sequences, spread evenly over the dataset.

    Raises GarmentcError where the dataset is empty or the picture cannot be written.
    """
    from PIL import Image as image_module

    if not dataset.entries:
        raise GarmentcError("holds no sequence yet; there is nothing to draw", dataset.folder)
    chosen = np.unique(np.linspace(0, len(dataset.entries) - 1, count).round().astype(int))
    columns = int(np.ceil(np.sqrt(len(chosen) * CELL[1] / CELL[0])))
    rows = -(-len(chosen) // columns)
    sheet = image_module.new("RGB", (columns * CELL[0], rows * (CELL[1] + _CAPTION)), "white")
    for cell, index in enumerate(chosen):
        sequence = dataset.sequence(dataset.entries[index])
        row, column = divmod(cell, columns)
        sheet.paste(_picture(_typical(sequence)), (column * CELL[0], row * (CELL[1] + _CAPTION)))
    data = io.BytesIO()
    sheet.save(data, format="PNG")
    with written_whole(path) as file:
        file.write(data.getvalue())


def _typical(sequence: Sequence) -> Sample:
    """Its accepted frame that is furthest from the rest pose."""
    accepted = np.flatnonzero(sequence.quality.accepted)
    bent = np.linalg.norm(sequence.poses[accepted, 1:], axis=2).sum(axis=1)
    return Sample(sequence, int(accepted[bent.argmax()]))


def _picture(sample: Sample) -> Image:
    """The outfit on its body, painted from far to near, with a caption."""
    from PIL import Image as image_module
    from PIL import ImageDraw

    sequence = sample.sequence
    colors = np.asarray(_CLOTH, float)[sequence.triangle_part % len(_CLOTH)]
    corners = sample.vertices[sequence.faces].astype(np.float64)
    middle = (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1))) / 2
    body = _body(sample)
    if body is not None:
        corners = np.concatenate([body, corners])
        colors = np.concatenate([np.broadcast_to(np.asarray(_SKIN, float), (len(body), 3)), colors])
        middle = (body.reshape(-1, 3).min(axis=0) + body.reshape(-1, 3).max(axis=0)) / 2
    seen = (corners - middle) @ _VIEW.T
    normal = np.cross(seen[:, 1] - seen[:, 0], seen[:, 2] - seen[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    shade = 0.35 + 0.65 * np.abs(normal @ _LIGHT)
    scale = CELL[1] / _HEIGHT
    pixels = seen[:, :, :2] * [scale, -scale] + np.array(CELL) / 2
    fill = np.clip(colors * shade[:, None], 0, 255).astype(int)
    image = image_module.new("RGB", (CELL[0], CELL[1] + _CAPTION), "white")
    draw = ImageDraw.Draw(image)
    depth = seen[:, :, 2].mean(axis=1)
    depth[: len(depth) - len(sequence.faces)] -= _BEHIND
    depth[len(depth) - len(sequence.faces) :] += _BEFORE * sequence.triangle_part
    for triangle in np.argsort(depth, kind="stable"):
        draw.polygon([tuple(point) for point in pixels[triangle].tolist()], fill=tuple(fill[triangle].tolist()))
    facts = sequence.facts
    draw.rectangle((0, CELL[1], *np.array(image.size).tolist()), fill="white")
    draw.text((4, CELL[1] + 2), f"{facts.name} #{sample.frame}", fill="black")
    draw.text((4, CELL[1] + 16), f"{facts.category}, {facts.fabric}, {len(sequence.template)} v", fill="black")
    return image


def _body(sample: Sample) -> NDArray[Any] | None:
    """Triangles (F, 3, 3) of the posed body, where it is a default one."""
    facts = sample.sequence.facts
    body = load_default_body(facts.gender)
    if facts.body != body.name:
        return None
    posed = body.posed(sample.pose, sample.sequence.betas, sample.trans)
    return np.asarray(posed[body.faces])
