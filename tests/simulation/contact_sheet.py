"""A contact sheet of random outfits at rest, to see whether they look like clothes.

    python -m tests.simulation.contact_sheet sheet.png --count 48

Categories take turns; within each, seeds rise from --seed. The captions name the seeds:
`garmentc simulate --export-outfit SEED out.obj` writes an outfit.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from garmentc.simulation.outfit_parameters import CATEGORIES, OutfitParameters
from garmentc.simulation.outfits import GeneratedOutfit, generate_outfit, sample_parameters
from garmentc.smpl.body import BodyModel
from garmentc.smpl.default_body import load_default_body
from tests.simulation.drawing import draw

VIEWS = (-0.45, np.pi - 0.45)
"""Turns about the vertical: from the front and from behind."""

CAPTION = 15


def parameters_in_turn(first_seed: int) -> Iterator[OutfitParameters]:
    """Parameters with rising seeds, one of each category and then the next of each."""
    seeds = dict.fromkeys(CATEGORIES, first_seed)
    while True:
        for category in CATEGORIES:
            while (drawn := sample_parameters(seeds[category])).category != category:
                seeds[category] += 1
            seeds[category] += 1
            yield drawn


def picture(outfit: GeneratedOutfit, body: BodyModel, size: tuple[int, int]) -> Image.Image:
    """The outfit on its body, side by side from the front and from behind."""
    rest = body.shaped(np.asarray(outfit.parameters.betas))
    low, high = rest.min(axis=0), rest.max(axis=0)
    small = outfit.category in ("footwear", "headwear", "accessories")
    if small:
        low, high = outfit.vertices.min(axis=0) - 0.06, outfit.vertices.max(axis=0) + 0.06
    reach = 1.0 if small else 0.55  # of what a picture's width has to show; hands may be cut off
    height = 1.06 * max(high[1] - low[1], reach * (high[0] - low[0]) * size[1] / size[0])
    seed = outfit.parameters.seed
    layers = [
        (outfit.vertices, outfit.triangles[outfit.triangle_part == part], seed + part)
        for part in range(len(outfit.part_names))
    ]
    sheet = Image.new("RGB", (len(VIEWS) * size[0], size[1] + CAPTION), "white")
    for column, view in enumerate(draw((rest, body.faces), layers, VIEWS, ((low + high) / 2, height), size)):
        sheet.paste(view, (column * size[0], CAPTION))
    return sheet


def main() -> None:
    """Draw the sheet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("path", type=Path)
    parser.add_argument("--count", type=int, default=48)
    parser.add_argument("--columns", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--size", type=int, nargs=2, default=(120, 170), help="of one view, pixels")
    options = parser.parse_args()
    size = (options.size[0], options.size[1])
    cell = (len(VIEWS) * size[0] + 6, size[1] + CAPTION + 4)
    rows = -(-options.count // options.columns)
    sheet = Image.new("RGB", (options.columns * cell[0], rows * cell[1]), "white")
    captions = ImageDraw.Draw(sheet)
    for index, parameters in zip(range(options.count), parameters_in_turn(options.seed), strict=False):
        row, column = divmod(index, options.columns)
        at = (column * cell[0], row * cell[1])
        body = load_default_body(parameters.gender)
        try:
            sheet.paste(picture(generate_outfit(parameters, body), body, size), at)
            caption = f"{parameters.seed} {parameters.category}"
        except ValueError as error:
            caption = f"{parameters.seed} {parameters.category}: {error}"
        captions.text((at[0] + 3, at[1] + 1), caption[:44], fill="black")
        print(caption, [garment.kind for garment in parameters.garments], parameters.vertex_count, flush=True)
        sheet.save(options.path, optimize=True)


if __name__ == "__main__":
    main()
