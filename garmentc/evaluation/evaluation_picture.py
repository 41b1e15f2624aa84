"""A picture of an evaluation: simulated, predicted and the error, for the best, the median and the worst sample."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from garmentc.evaluation.dataset_evaluation import DatasetEvaluation
from garmentc.evaluation.metrics import MILLIMETRES
from garmentc.evaluation.outfit_scores import body_of, simulated, trimmed
from garmentc.evaluation.representative import Representative, shown_method
from garmentc.outfit.topology import vertex_normals
from garmentc.preview.render import BACKGROUND, light_scene, render
from garmentc.preview.simulated import cloth_surface, front_camera, garment_colors
from garmentc.preview.surface import Scene, Surface
from garmentc.preview.worn import CLAY
from garmentc.simulation.dataset import Dataset
from garmentc.simulation.sequence import Sample

if TYPE_CHECKING:
    from PIL.Image import Image

CELL = (420, 480)
"""Width and height of one view, pixels."""

FULL_SCALE = 100.0
"""Millimetres that the last colour of the heat map stands for; larger errors have it too."""

_CAPTION = 22
_TEXT = 14
_PAPER = tuple(round(255 * value) for value in BACKGROUND)
_HEAT = np.array([[0.16, 0.24, 0.55], [0.10, 0.55, 0.65], [0.95, 0.90, 0.35], [0.93, 0.45, 0.15], [0.65, 0.05, 0.10]])


def picture_bytes(
    evaluation: DatasetEvaluation, samples: Sequence[Representative], dataset: Dataset, bodies: Sequence[Path] = ()
) -> bytes:
    """A PNG with a row of three views for each of `samples`: simulated, predicted by `shown_method`, its error.

    Raises GarmentcError as `evaluate_dataset` does.
    """
    from PIL import Image as image_module

    rows = [_row(evaluation, sample, dataset, bodies) for sample in samples]
    sheet = image_module.new("RGB", (rows[0].width, sum(row.height for row in rows) + 2 * _CAPTION), _PAPER)
    for index, row in enumerate(rows):
        sheet.paste(row, (0, index * row.height))
    sheet.paste(_legend(sheet.width), (0, sheet.height - 2 * _CAPTION))
    data = io.BytesIO()
    sheet.save(data, format="PNG")
    return data.getvalue()


def heat(error_mm: NDArray[Any]) -> NDArray[np.float64]:
    """Colours (N, 3), sRGB, of errors (N,), blue for none to dark red for FULL_SCALE and more."""
    place = np.clip(np.asarray(error_mm) / FULL_SCALE, 0, 1)
    stops = np.linspace(0, 1, len(_HEAT))
    return np.stack([np.interp(place, stops, channel) for channel in _HEAT.T], axis=-1)


def _row(evaluation: DatasetEvaluation, shown: Representative, dataset: Dataset, bodies: Sequence[Path]) -> Image:
    from PIL import Image as image_module
    from PIL import ImageDraw, ImageFont

    [entry] = [entry for entry in dataset.entries if entry.name == shown.sequence]
    sequence = trimmed(dataset.sequence(entry))
    sample = Sample(sequence, shown.frame)
    body, body_file = body_of(sequence.facts, bodies)
    pose = sample.pose.astype(np.float64)
    target = simulated(sample)
    predicted = shown_method(evaluation).posed_template(sequence, body, body_file)(sample)
    skin = body.posed(pose, sequence.betas)
    error = MILLIMETRES * np.linalg.norm(predicted - target, axis=1)
    cloth = garment_colors(sequence)
    camera = front_camera(np.concatenate([skin, target, predicted]), pose, CELL)
    inside = Surface(skin, vertex_normals(skin, body.faces), body.faces, CLAY)
    views = (
        ("simulated", target, cloth),
        (shown.method, predicted, cloth),
        ("its error", predicted, heat(error)),
    )
    row = image_module.new("RGB", (len(views) * CELL[0], CELL[1] + 2 * _CAPTION), _PAPER)
    draw = ImageDraw.Draw(row)
    draw.font = ImageFont.load_default(_TEXT)
    draw.text(
        (6, 4),
        f"{shown.place}: {shown.category}, {shown.sequence}, frame {shown.frame}: "
        f"mean error {shown.error_mm:.1f} mm, largest {error.max():.0f} mm, {shown.collision:.2%} collided",
        fill="black",
    )
    for column, (title, vertices, colors) in enumerate(views):
        draw.text((column * CELL[0] + 6, _CAPTION + 2), title, fill="gray")
        outside = cloth_surface(vertices, sequence.faces, colors)
        picture = render(light_scene(Scene((inside, outside))), camera)
        row.paste(image_module.fromarray(picture), (column * CELL[0], 2 * _CAPTION))
    return row


def _legend(width: int) -> Image:
    from PIL import Image as image_module
    from PIL import ImageDraw, ImageFont

    length = CELL[0] - 120
    legend = image_module.new("RGB", (width, 2 * _CAPTION), _PAPER)
    bar = np.rint(255 * heat(np.linspace(0, FULL_SCALE, length))).astype(np.uint8)
    left = width - CELL[0] + 40
    legend.paste(image_module.fromarray(np.repeat(bar[None], 12, axis=0)), (left, 14))
    draw = ImageDraw.Draw(legend)
    draw.font = ImageFont.load_default(_TEXT)
    draw.text((left - 14, 11), "0", fill="black")
    draw.text((left + length + 6, 11), f"{FULL_SCALE:.0f} mm", fill="black")
    return legend
