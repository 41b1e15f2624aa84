"""Outfits as OBJ and MTL files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from garmentc.output import written_whole
from garmentc.simulation.outfits import GeneratedOutfit
from garmentc.simulation.panels import lay_flat
from garmentc.simulation.quads import pair_triangles, polygon_corners


@dataclass(frozen=True)
class Fabric:
    """A material: colour (linear, 0 to 1), roughness, metalness, and texture files named as the MTL shall name them.

    tile  side of one texture repeat, metres
    """

    name: str
    color: tuple[float, float, float] = (0.6, 0.6, 0.6)
    roughness: float = 0.8
    metallic: float = 0.0
    color_map: str | None = None
    normal_map: str | None = None
    tile: float = 0.1


PLAIN_FABRICS = (
    Fabric("blue", (0.13, 0.22, 0.42)),
    Fabric("red", (0.5, 0.12, 0.1)),
    Fabric("green", (0.16, 0.34, 0.17)),
    Fabric("sand", (0.6, 0.5, 0.33)),
)


def write_obj(
    outfit: GeneratedOutfit,
    path: Path,
    fabrics: Sequence[Fabric] = PLAIN_FABRICS,
    texcoords: bool = True,
    comments: Sequence[str] = (),
) -> None:
    """Write `path` and its MTL beside it: metres, Y up, one object and one material per garment, quads where possible.

    Each file appears whole or not at all, the OBJ after the MTL that it names.

    texcoords  lay the garments flat (front and back panels) and write texture coordinates in tiles of the fabric
    Raises GarmentcError where a file cannot be written.
    """
    partner = pair_triangles(outfit.vertices, outfit.triangles, outfit.triangle_part)
    panels = lay_flat(outfit.vertices, outfit.triangles, outfit.triangle_part, partner) if texcoords else None
    lines = [*(f"# {line}" for line in comments), f"mtllib {path.with_suffix('.mtl').name}"]
    lines += [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in outfit.vertices + 0.0]
    if panels is not None:
        tile = np.ones(len(panels.texcoords))
        for part in range(len(outfit.part_names)):
            tile[panels.corners[outfit.triangle_part == part]] = fabrics[part % len(fabrics)].tile
        lines += [f"vt {u:.4f} {v:.4f}" for u, v in panels.texcoords / tile[:, None] + 0.0]
    polygons = polygon_corners(outfit.triangles, partner)
    for part, name in enumerate(outfit.part_names):
        fabric = fabrics[part % len(fabrics)]
        lines += [f"o {name}_{part}", f"usemtl {fabric.name}"]
        for polygon in polygons:
            if outfit.triangle_part[polygon[0][0]] != part:
                continue
            corners = [
                f"{outfit.triangles[corner] + 1}" + ("" if panels is None else f"/{panels.corners[corner] + 1}")
                for corner in polygon
            ]
            lines.append("f " + " ".join(corners))
    used = dict.fromkeys(fabrics[part % len(fabrics)] for part in range(len(outfit.part_names)))
    materials = "\n".join(_mtl(fabric, texcoords) for fabric in used)
    for target, text in ((path.with_suffix(".mtl"), materials), (path, "\n".join(lines) + "\n")):
        with written_whole(target) as file:
            file.write(text.encode("ascii"))


def _mtl(fabric: Fabric, textured: bool) -> str:
    red, green, blue = fabric.color
    lines = [
        f"newmtl {fabric.name}",
        f"Kd {red:.3f} {green:.3f} {blue:.3f}",
        f"Pr {fabric.roughness:.2f}",
        f"Pm {fabric.metallic:.2f}",
    ]
    if textured and fabric.color_map:
        lines.append(f"map_Kd {fabric.color_map}")
    if textured and fabric.normal_map:
        lines.append(f"norm {fabric.normal_map}")
    return "\n".join(lines) + "\n"
