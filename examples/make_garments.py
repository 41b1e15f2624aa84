"""Make the example garments and their textures; run it from anywhere: `python examples/make_garments.py`.

Everything is grown from the default body by garmentc.simulation and painted by the functions below.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from garmentc.simulation.outfits import GarmentParameters, OutfitParameters, generate_outfit
from garmentc.simulation.write_outfit import Fabric, write_obj
from garmentc.smpl import load_body

FOLDER = Path(__file__).resolve().parent
LICENCE = "Made by garmentc's examples/make_garments.py. CC0 1.0: no rights reserved."
NO_SHAPE = (0.0,) * 10

TEE_AND_SKIRT = OutfitParameters(
    seed=1,
    category="top_skirt",
    gender="female",
    betas=NO_SHAPE,
    vertex_count=2600,
    garments=(
        GarmentParameters(
            "top",
            seed=3,
            clearance=0.004,
            sleeve=0.16,
            sleeve_slope=0.02,
            length=0.5,
            hang=-0.9,
            neckline="scoop",
            neck_width=0.09,
            neck_depth=0.07,
            roughness=0.002,
            tessellation="rows",
        ),
        GarmentParameters(
            "skirt",
            seed=8,
            clearance=0.006,
            ease=0.002,
            length=0.4,
            flare=0.35,
            fold_count=9,
            fold_depth=0.03,
            rise=0.9,
            roughness=0.0,
            tessellation="rows",
        ),
    ),
)

TEE_AND_TROUSERS = OutfitParameters(
    seed=2,
    category="top_trousers",
    gender="male",
    betas=NO_SHAPE,
    vertex_count=2800,
    garments=(
        GarmentParameters(
            "trousers",
            seed=5,
            clearance=0.004,
            ease=0.004,
            length=0.97,
            leg_slope=-0.08,
            rise=0.5,
            roughness=0.004,
            tessellation="rows",
        ),
        GarmentParameters(
            "top",
            seed=6,
            clearance=0.006,
            ease=0.004,
            sleeve=0.22,
            sleeve_slope=0.0,
            length=0.56,
            hang=-0.3,
            neck_width=0.075,
            neck_depth=0.045,
            roughness=0.004,
            tessellation="rows",
        ),
    ),
)

Pixels = NDArray[np.float64]


def striped_jersey(size: int = 256) -> Pixels:
    """(size, size, 3) sRGB, tile-able: broad stripes of knitted stitches."""
    v, u = np.mgrid[0:size, 0:size] / size
    stitch = 0.5 + 0.5 * np.cos(2 * np.pi * (32 * u + 0.25 * np.sin(2 * np.pi * 48 * v)))
    row = 0.5 + 0.5 * np.cos(2 * np.pi * 48 * v)
    shade = 0.86 + 0.1 * stitch + 0.04 * row
    dark = 1 / (1 + np.exp(60 * (np.cos(2 * np.pi * 2 * v) + 0.2)))
    cream, navy = np.array([0.93, 0.9, 0.82]), np.array([0.14, 0.2, 0.36])
    return (cream + (navy - cream) * dark[..., None]) * shade[..., None]


def twill_height(size: int = 256) -> Pixels:
    """(size, size) thread height of a 2/2 twill weave, 0 to 1, tile-able."""
    threads = 32
    v, u = np.mgrid[0:size, 0:size] * (threads / size)
    over = (np.floor(u) + np.floor(v)) % 4 < 2
    warp = np.sin(np.pi * (u % 1)) * (0.75 + 0.25 * np.sin(np.pi * (v % 1)))
    weft = np.sin(np.pi * (v % 1)) * (0.75 + 0.25 * np.sin(np.pi * (u % 1)))
    return np.where(over, 0.3 + 0.7 * warp, 0.15 + 0.55 * weft)


def twill_color(size: int = 256) -> Pixels:
    """(size, size, 3) sRGB: rust-red twill, threads a little uneven."""
    height = twill_height(size)
    rng = np.random.default_rng(1)
    uneven = np.repeat(rng.uniform(0.92, 1.04, 32), size // 32)
    shade = (0.55 + 0.45 * height) * uneven[None, :] * np.roll(uneven, size // 2)[:, None]
    return np.array([0.71, 0.3, 0.22]) * shade[..., None]


def normal_map(height: Pixels, strength: float) -> Pixels:
    """(H, W, 3) tangent-space normals of a tile-able height field, OpenGL convention (green is up)."""
    along_u = strength * (np.roll(height, -1, 1) - np.roll(height, 1, 1)) / 2
    along_v = strength * (np.roll(height, 1, 0) - np.roll(height, -1, 0)) / 2
    normal = np.stack([-along_u, -along_v, np.ones_like(height)], -1)
    return 0.5 + 0.5 * normal / np.linalg.norm(normal, axis=-1, keepdims=True)


def save(image: Pixels, name: str) -> None:
    Image.fromarray(np.uint8(np.clip(image, 0, 1) * 255 + 0.5)).save(FOLDER / name, optimize=True)


def main() -> None:
    save(striped_jersey(), "jersey.png")
    save(twill_color(), "twill.png")
    save(normal_map(twill_height(), 2.0), "twill_normal.png")
    jersey = Fabric("jersey", (1.0, 1.0, 1.0), roughness=0.9, color_map="jersey.png", tile=0.12)
    twill = Fabric(
        "twill", (1.0, 1.0, 1.0), roughness=0.7, color_map="twill.png", normal_map="twill_normal.png", tile=0.05
    )
    outfit = generate_outfit(TEE_AND_SKIRT, load_body(None, "female"))
    write_obj(outfit, FOLDER / "tee_and_skirt.obj", (jersey, twill), comments=[LICENCE])
    outfit = generate_outfit(TEE_AND_TROUSERS, load_body(None, "male"))
    denim, cotton = Fabric("denim", (0.05, 0.09, 0.2), 0.85), Fabric("cotton", (0.62, 0.62, 0.58), 0.95)
    write_obj(outfit, FOLDER / "tee_and_trousers.obj", (denim, cotton), texcoords=False, comments=[LICENCE])


if __name__ == "__main__":
    main()
