"""What a procedural outfit is made from."""

from __future__ import annotations

from dataclasses import dataclass

CATEGORIES = (
    "top",
    "open_top",
    "trousers",
    "skirt",
    "dress",
    "jumpsuit",
    "top_trousers",
    "top_skirt",
    "jacket_top_trousers",
    "jacket_dress",
    "footwear",
    "headwear",
    "accessories",
)

GENDERS = ("female", "male", "neutral")


@dataclass(frozen=True)
class GarmentParameters:
    """One garment. Lengths in metres unless they are fractions; unused fields are ignored by the kind.

    kind          top, trousers, skirt, dress, jumpsuit, feet, hat, hood, mittens or band
    clearance     between body (or the layer below) and cloth that follows it
    ease          more clearance where cloth hangs free
    hang          radius change per metre of the trunk below the chest (0 straight, negative fitted); None follows
    sleeve        0 no sleeve, 1 to the wrist;  sleeve_slope as `hang`, along the arm
    length        0 shortest, 1 longest for the kind (a band: its width in metres)
    leg_slope     as `hang`, along the leg
    flare         radius change per metre of a skirt
    fold_count, fold_depth   folds of a skirt
    rise          waistband: 0 on the hips, 1 at the navel
    neckline      crew, v, scoop, boat, turtle or strapless;  neck_width (half), neck_depth
    strap         width of a sleeveless shoulder as a fraction of the shoulder's
    opening       half width of an open front, 0 closed
    hem_curve     how much the hem rises at the sides
    place         where a band sits: waist, chest, neck, wrist, arm, thigh, calf or head
    brim          width of a hat's brim
    roughness     amplitude of the smooth random clearance
    tautness      smoothing passes: how strongly cloth bridges creases
    tessellation  triangles (isotropic) or rows (of quads along the axes, as artists model; falls back if too coarse)
    stretch       relative size of the mesh's cells along x, y and z
    """

    kind: str
    seed: int = 0
    clearance: float = 0.005
    ease: float = 0.005
    hang: float | None = None
    sleeve: float = 0.0
    sleeve_slope: float | None = None
    length: float = 0.5
    leg_slope: float | None = None
    flare: float = 0.0
    fold_count: int = 0
    fold_depth: float = 0.0
    rise: float = 0.5
    neckline: str = "crew"
    neck_width: float = 0.075
    neck_depth: float = 0.05
    strap: float = 0.75
    opening: float = 0.0
    hem_curve: float = 0.0
    place: str = "waist"
    brim: float = 0.0
    roughness: float = 0.003
    tautness: int = 12
    tessellation: str = "triangles"
    stretch: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class OutfitParameters:
    """An outfit: garments from the innermost to the outermost, the body that they fit, and the mesh density."""

    seed: int
    category: str
    gender: str
    betas: tuple[float, ...]
    vertex_count: int
    garments: tuple[GarmentParameters, ...]
