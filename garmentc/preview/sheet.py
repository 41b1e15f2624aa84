"""Contact sheets: an outfit at several moments, from several sides."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.gltf.glb_asset import GlbAsset
from garmentc.output import written_whole
from garmentc.preview.camera import Camera, view_axes
from garmentc.preview.moments import body_pose, choose_moments
from garmentc.preview.penetration import DEEPEST_MM, Penetration, depth_colors, penetration
from garmentc.preview.render import BACKGROUND, light_scene, render
from garmentc.preview.surface import Scene
from garmentc.preview.texture import linear_to_srgb
from garmentc.preview.worn import prepare
from garmentc.smpl.body import BodyModel
from garmentc.smpl.rotations import axis_angle_to_matrix

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw

VIEWS = {"front": 0.0, "side": 90.0, "back": 180.0, "quarter": 35.0, "left": 90.0, "right": -90.0}
"""Degrees that the view is turned from the body's front, to its left."""

_PITCH = np.radians(8.0)
_MARGIN, _WIDEST = 1.1, 2.0
_INK, _FAINT = (45, 48, 54), (120, 124, 132)
_PAPER = tuple(round(255 * value) for value in BACKGROUND)


@dataclass(frozen=True)
class SheetOptions:
    """What a sheet shows.

    frames      moments, side by side
    views       names in VIEWS, one below the other
    height      pixels of one picture; it is as wide as it needs to be
    animation   name or number; the first by default
    collisions  colour the cloth by its depth inside the body
    """

    frames: int = 4
    views: tuple[str, ...] = ("front", "side", "back")
    height: int = 480
    animation: str | None = None
    collisions: bool = False

    def __post_init__(self) -> None:
        if self.frames < 1 or not self.views or self.height < 16:
            raise GarmentcError("a sheet needs at least one frame, one view and pictures 16 pixels high")
        unknown = [view for view in self.views if view not in VIEWS]
        if unknown:
            raise GarmentcError(f"there is no view '{unknown[0]}'; choose from {', '.join(VIEWS)}")


@dataclass(frozen=True)
class _Column:
    """One moment: a scene, the direction that the body faces, and what stands above and below it."""

    label: str
    scene: Scene
    heading: float
    found: Penetration | None


def write_sheet(
    asset: GlbAsset,
    body: BodyModel | None,
    betas: NDArray[Any] | None,
    path: Path,
    options: SheetOptions,
    progress: Callable[[float], None] = lambda done: None,
) -> tuple[int, int]:
    """Draw a contact sheet as a PNG; returns its width and height.

    body, betas  what wears the outfit; None draws the outfit alone
    progress     called with the share that is done
    Raises GarmentcError where the asset cannot be posed or drawn, or the file cannot be written.
    """
    if options.collisions and body is None:
        raise GarmentcError("collisions need the body; give --body or --gender, and no --no-body", asset.path)
    columns = _columns(asset, body, betas, options)
    cameras = _framed(columns, options.views, options.height)
    pictures = []
    for number, column in enumerate(columns):
        lit = light_scene(column.scene)
        for row, camera in enumerate(cameras[number]):
            pictures.append(render(lit, camera))
            progress((number + (row + 1) / len(options.views)) / len(columns))
    sheet = _laid_out(asset, columns, pictures, options)
    with written_whole(path) as file:
        file.write(sheet[0])
    return sheet[1]


def _columns(
    asset: GlbAsset, body: BodyModel | None, betas: NDArray[Any] | None, options: SheetOptions
) -> list[_Column]:
    worn = prepare(asset, body, betas)
    moments = choose_moments(asset, options.frames, options.animation)
    dressed = [(worn.outfit(moment.state), worn.skin(moment.state)) for moment in moments]
    soles = [None if skin is None else float(skin.positions[:, 1].min()) for _, skin in dressed]
    lowest = min((sole for sole in soles if sole is not None), default=None)
    columns = []
    for moment, (cloth, skin), sole in zip(moments, dressed, soles, strict=True):
        found = penetration(cloth, skin) if options.collisions and skin is not None else None
        if found is not None:
            cloth, skin = found.cloth, found.skin
        heading = 0.0
        if skin is not None:
            root = axis_angle_to_matrix(body_pose(asset, moment.state)[0][0])
            heading = float(np.arctan2(root[0, 2], root[2, 2]))
        surfaces = cloth if skin is None else (skin, *cloth)
        scene = Scene(surfaces, lowest if moment.grounded else sole)
        columns.append(_Column(moment.label, scene, heading, found))
    return columns


def _framed(columns: Sequence[_Column], views: Sequence[str], height: int) -> list[list[Camera]]:
    """Cameras by column and view: one scale for the whole sheet, the floor at the same height in every picture."""
    axes = [[view_axes(column.heading, np.radians(VIEWS[view]), _PITCH) for view in views] for column in columns]
    middles = [_middle(column.scene) for column in columns]
    seen = [
        (column.scene.positions - middle) @ axis[:2].T
        for column, middle, row in zip(columns, middles, axes, strict=True)
        for axis in row
    ]
    half = max(float(np.abs(places[:, 0]).max()) for places in seen)
    top = min(float(places[:, 1].min()) for places in seen)
    bottom = max(float(places[:, 1].max()) for places in seen)
    tall, wide = max(bottom - top, 1e-3) * _MARGIN, 2 * half + (_MARGIN - 1) * (bottom - top)
    size = (max(round(height * min(wide / tall, _WIDEST)), 16), height)
    scale = min(size[1] / tall, size[0] / wide)
    return [
        [Camera(axis, middle + axis[1] * (top + bottom) / 2, scale, size) for axis in row]
        for middle, row in zip(middles, axes, strict=True)
    ]


def _middle(scene: Scene) -> NDArray[np.float64]:
    """The middle of the scene, on the floor or else at the lowest point."""
    low, high = scene.positions.min(axis=0), scene.positions.max(axis=0)
    middle: NDArray[np.float64] = (low + high) / 2
    middle[1] = low[1] if scene.floor is None else scene.floor
    return middle


def _laid_out(
    asset: GlbAsset,
    columns: Sequence[_Column],
    pictures: Sequence[NDArray[np.uint8]],
    options: SheetOptions,
) -> tuple[bytes, tuple[int, int]]:
    """The PNG, and its size: a title, columns of moments, rows of views, captions below."""
    from PIL import Image, ImageDraw, ImageFont

    text = max(11, options.height // 30)
    line = round(1.9 * text)
    large, small = ImageFont.load_default(round(1.25 * text)), ImageFont.load_default(text)
    rows, cell = len(options.views), pictures[0].shape[1::-1]
    below = line if options.collisions else 0
    head = 2 * line
    size = (cell[0] * len(columns), head + cell[1] * rows + below + (line if options.collisions else 0))
    image = Image.new("RGB", size, _PAPER)
    for number, picture in enumerate(pictures):
        column, row = divmod(number, rows)
        image.paste(Image.fromarray(picture), (column * cell[0], head + row * cell[1]))
    draw = ImageDraw.Draw(image)
    draw.text((text, line * 0.75), asset.path.stem, fill=_INK, font=large, anchor="lm")
    facts_at = text + draw.textlength(asset.path.stem, font=large) + 1.5 * text
    facts = _facts(asset)
    if facts_at + draw.textlength(facts, font=small) < size[0]:
        draw.text((facts_at, line * 0.78), facts, fill=_FAINT, font=small, anchor="lm")
    for number, column_shown in enumerate(columns):
        middle = (number + 0.5) * cell[0]
        draw.text((middle, head - 0.3 * line), column_shown.label, fill=_INK, font=small, anchor="mm")
        if column_shown.found is not None:
            found = f"{column_shown.found.share:.2%} inside, deepest {column_shown.found.deepest_mm:.1f} mm"
            draw.text((middle, size[1] - 1.5 * line), found, fill=_INK, font=small, anchor="mm")
    for row, view in enumerate(options.views):
        draw.text((text, head + row * cell[1] + text), view, fill=_FAINT, font=small, anchor="lm")
    if options.collisions:
        _draw_legend(draw, small, text, size, line)
    data = io.BytesIO()
    image.save(data, format="PNG")
    return data.getvalue(), size


def _draw_legend(draw: ImageDraw, font: Any, text: int, size: tuple[int, int], line: int) -> None:
    """The colour scale, along the lower edge."""
    width, left, top = 14 * text, 9 * text, size[1] - line
    draw.text((text, top + line / 2), "inside by", fill=_INK, font=font, anchor="lm")
    depths = np.linspace(0, DEEPEST_MM, width)
    colors = np.round(linear_to_srgb(depth_colors(depths)) * 255).astype(int)
    for column, color in enumerate(colors.tolist()):
        draw.line((left + column, top + line * 0.25, left + column, top + line * 0.75), fill=tuple(color))
    draw.text((left - 0.4 * text, top + line / 2), "0", fill=_INK, font=font, anchor="rm")
    label = f"{DEEPEST_MM:g} mm and more"
    draw.text((left + width + 0.4 * text, top + line / 2), label, fill=_INK, font=font, anchor="lm")


def _facts(asset: GlbAsset) -> str:
    meshes = [asset.meshes[asset.nodes[node].mesh or 0] for node in asset.outfit_nodes]
    primitives = [primitive for mesh in meshes for primitive in mesh.primitives]
    facts = [
        f"{sum(len(primitive.positions) for primitive in primitives):,} vertices",
        f"{sum(len(primitive.triangles) for primitive in primitives):,} triangles",
        f"{sum(mesh.morph_count for mesh in meshes)} morph targets",
        f"{asset.file_bytes / 2**20:.1f} MiB",
    ]
    return "   ".join(facts)
