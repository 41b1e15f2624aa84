"""A contact sheet of a dataset: for people to see whether it looks like clothes."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from garmentc.errors import GarmentcError
from garmentc.outfit.topology import vertex_normals
from garmentc.output import written_whole
from garmentc.preview.render import light_scene, render
from garmentc.preview.simulated import cloth_surface, front_camera, garment_colors
from garmentc.preview.surface import Scene, Surface
from garmentc.preview.worn import CLAY
from garmentc.simulation.dataset import Dataset
from garmentc.simulation.sequence import Sample, Sequence
from garmentc.smpl.default_body import load_default_body

if TYPE_CHECKING:
    from PIL.Image import Image

CELL = (240, 320)
"""Width and height of one picture, pixels."""

_CAPTION = 34
_HEIGHT = 2.1
"""Metres that the height of a picture shows."""

_BEHIND = 0.03
"""Metres that skin is drawn further away than it is: coarse cloth close to it would else be spotted with skin."""


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
    """The outfit on its body, with a caption."""
    from PIL import Image as image_module
    from PIL import ImageDraw

    sequence = sample.sequence
    cloth = sample.vertices.astype(np.float64)
    skin = _skin(sample)
    inside = () if skin is None else (skin,)
    scene = Scene((*inside, cloth_surface(cloth, sequence.faces, garment_colors(sequence))))
    middle = cloth if skin is None else skin.positions
    camera = front_camera(middle, sample.pose, CELL, CELL[1] / _HEIGHT)
    image = image_module.new("RGB", (CELL[0], CELL[1] + _CAPTION), "white")
    image.paste(image_module.fromarray(render(light_scene(scene), camera)))
    facts = sequence.facts
    draw = ImageDraw.Draw(image)
    draw.text((4, CELL[1] + 2), f"{facts.name} #{sample.frame}", fill="black")
    draw.text((4, CELL[1] + 16), f"{facts.category}, {facts.fabric}, {len(sequence.template)} v", fill="black")
    return image


def _skin(sample: Sample) -> Surface | None:
    """The posed body, where it is a default one."""
    facts = sample.sequence.facts
    body = load_default_body(facts.gender)
    if facts.body != body.name:
        return None
    posed = body.posed(sample.pose, sample.sequence.betas, sample.trans).astype(np.float64)
    return Surface(posed, vertex_normals(posed, body.faces), body.faces, CLAY, behind=_BEHIND)
