"""Drawing random outfits: proportions that artists use, bodies of all shapes, every region of the body covered."""

from __future__ import annotations

import numpy as np

from garmentc.simulation.outfit_parameters import CATEGORIES, GENDERS, GarmentParameters, OutfitParameters


def sample_parameters(seed: int) -> OutfitParameters:
    """A random outfit; the same seed gives the same outfit on every machine."""
    rng = np.random.default_rng([0x6A7, seed])
    category = str(rng.choice(CATEGORIES, p=_CATEGORY_WEIGHTS))
    gender = str(rng.choice(GENDERS, p=(0.4, 0.4, 0.2)))
    betas = np.zeros(10) if rng.random() < 1 / 3 else np.clip(rng.normal(size=10), -2, 2)
    count = int(np.exp(rng.uniform(np.log(500), np.log(4000))))
    garments = _garments(category, gender, rng)
    if category == "accessories" or category in ("footwear", "headwear"):
        count = max(count // 2, 300)
    else:
        count = max(count, 450 * len(garments))
    return OutfitParameters(seed, category, gender, tuple(float(b) for b in betas), count, garments)


_CATEGORY_WEIGHTS = (0.17, 0.05, 0.13, 0.09, 0.12, 0.07, 0.13, 0.06, 0.05, 0.03, 0.04, 0.03, 0.03)


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(1 << 31))


def _cloth(rng: np.random.Generator, layer: int = 0) -> dict[str, object]:
    """Clearance, ease, roughness and tautness; median clearance 5 mm, more for outer layers."""
    loose = float(rng.beta(1.3, 2.5))
    return {
        "seed": _seed(rng),
        "clearance": 0.0025 + 0.009 * loose + 0.002 * layer,
        "ease": 0.01 * float(rng.beta(1.2, 2.5)),
        "roughness": float(rng.uniform(0.0, 0.005)),
        "tautness": int(rng.integers(6, 26)),
        "tessellation": str(rng.choice(["triangles", "rows"])),
        "stretch": tuple(float(s) for s in np.exp(rng.uniform(-0.3, 0.3, 3))),
    }


def _maybe(rng: np.random.Generator, chance: float, low: float, high: float) -> float | None:
    value = float(rng.uniform(low, high))
    return value if rng.random() < chance else None


def _neck(rng: np.random.Generator, straps: bool = True) -> dict[str, float | str]:
    names = ("crew", "v", "scoop", "boat", "turtle", "strapless")
    weights = np.array([0.34, 0.2, 0.18, 0.12, 0.1, 0.06 if straps else 0.0])
    name = str(rng.choice(names, p=weights / weights.sum()))
    width = {"boat": rng.uniform(0.095, 0.12), "scoop": rng.uniform(0.085, 0.105)}.get(name, rng.uniform(0.065, 0.085))
    depth = {"boat": 0.03, "scoop": rng.uniform(0.08, 0.15), "v": rng.uniform(0.09, 0.19), "strapless": 0.0}.get(
        name, rng.uniform(0.03, 0.07)
    )
    return {"neckline": name, "neck_width": float(width), "neck_depth": float(depth)}


def _sleeves(rng: np.random.Generator, neckline: str) -> dict[str, float | None]:
    if neckline == "strapless":
        return {"sleeve": 0.0, "strap": 1.0}
    style = rng.random()
    length = 0.0 if style < 0.22 else float(rng.uniform(0.08, 0.4)) if style < 0.65 else float(rng.uniform(0.5, 1.0))
    return {
        "sleeve": length,
        "sleeve_slope": _maybe(rng, 0.6, -0.3, 0.1),
        "strap": float(rng.uniform(0.72, 0.98)),
    }


def _top(rng: np.random.Generator, layer: int = 0, **fixed: object) -> GarmentParameters:
    neck = _neck(rng)
    values: dict[str, object] = {
        **_cloth(rng, layer),
        **neck,
        **_sleeves(rng, str(neck["neckline"])),
        "hang": _maybe(rng, 0.5, -1.2, 0.05),
        "length": float(rng.uniform(0.1, 0.75)) if rng.random() < 0.85 else float(rng.uniform(0.75, 1.0)),
        "hem_curve": float(rng.uniform(0, 0.035)) if rng.random() < 0.3 else 0.0,
        **fixed,
    }
    return GarmentParameters("top", **values)  # type: ignore[arg-type]


def _jacket(rng: np.random.Generator, layer: int) -> GarmentParameters:
    return _top(
        rng,
        layer,
        neckline=str(rng.choice(["v", "crew", "scoop"])),
        neck_width=float(rng.uniform(0.075, 0.095)),
        neck_depth=float(rng.uniform(0.05, 0.14)),
        sleeve=float(rng.uniform(0.3, 1.0)),
        hang=float(rng.uniform(-0.7, 0.0)),
        opening=float(rng.uniform(0.008, 0.05)),
        length=float(rng.uniform(0.25, 0.9)),
    )


def _trousers(rng: np.random.Generator, layer: int = 0, **fixed: object) -> GarmentParameters:
    values: dict[str, object] = {
        **_cloth(rng, layer),
        "length": float(rng.uniform(0.1, 0.5)) if rng.random() < 0.35 else float(rng.uniform(0.6, 1.0)),
        "rise": float(rng.uniform(0.1, 1.0)),
        "leg_slope": _maybe(rng, 0.65, -0.2, 0.03),
        **fixed,
    }
    return GarmentParameters("trousers", **values)  # type: ignore[arg-type]


def _skirt_shape(rng: np.random.Generator) -> dict[str, object]:
    flare = float(rng.choice([rng.uniform(-0.08, 0.02), rng.uniform(0.05, 0.3), rng.uniform(0.3, 0.5)]))
    length = float(rng.uniform(0.05, 1.0))
    flare = min(flare, 0.05 + 0.22 / (0.2 + length))
    folds = flare > 0.05 and rng.random() < 0.6
    return {
        "flare": flare,
        "fold_count": int(rng.integers(5, 13)) if folds else 0,
        "fold_depth": float(rng.uniform(0.004, 0.02)) * min(1.0, 0.4 + flare) if folds else 0.0,
        "length": length,
    }


def _skirt(rng: np.random.Generator, layer: int = 0, **fixed: object) -> GarmentParameters:
    values = {**_cloth(rng, layer), **_skirt_shape(rng), "rise": float(rng.uniform(0.2, 1.0)), **fixed}
    return GarmentParameters("skirt", **values)  # type: ignore[arg-type]


def _dress(rng: np.random.Generator) -> GarmentParameters:
    neck = _neck(rng)
    values: dict[str, object] = {
        **_cloth(rng),
        **neck,
        **_sleeves(rng, str(neck["neckline"])),
        **_skirt_shape(rng),
        "hang": _maybe(rng, 0.35, -1.2, -0.2),
        "rise": float(rng.uniform(0.3, 1.2)),
    }
    return GarmentParameters("dress", **values)  # type: ignore[arg-type]


def _jumpsuit(rng: np.random.Generator) -> GarmentParameters:
    neck = _neck(rng)
    values: dict[str, object] = {
        **_cloth(rng),
        **neck,
        **_sleeves(rng, str(neck["neckline"])),
        "length": float(rng.uniform(0.08, 1.0)),
        "leg_slope": _maybe(rng, 0.6, -0.2, 0.03),
    }
    return GarmentParameters("jumpsuit", **values)  # type: ignore[arg-type]


def _feet(rng: np.random.Generator) -> GarmentParameters:
    length = float(rng.choice([0.0, rng.uniform(0.03, 0.25), rng.uniform(0.3, 1.0)]))
    values = {**_cloth(rng), "length": length, "tautness": int(rng.integers(15, 40)), "roughness": 0.0}
    return GarmentParameters("feet", **values)  # type: ignore[arg-type]


def _headwear(rng: np.random.Generator) -> GarmentParameters:
    if rng.random() < 0.3:
        values = {**_cloth(rng), "length": float(rng.uniform(0, 1)), "tautness": int(rng.integers(20, 50))}
        return GarmentParameters("hood", **values)  # type: ignore[arg-type]
    values = {
        **_cloth(rng),
        "rise": float(rng.uniform(0, 1)),
        "brim": float(rng.uniform(0.02, 0.08)) if rng.random() < 0.6 else 0.0,
        "tautness": int(rng.integers(15, 40)),
        "roughness": 0.0,
    }
    return GarmentParameters("hat", **values)  # type: ignore[arg-type]


_BANDS = {
    "waist": (0.03, 0.08),
    "chest": (0.06, 0.16),
    "neck": (0.05, 0.09),
    "wrist": (0.03, 0.1),
    "arm": (0.04, 0.12),
    "thigh": (0.05, 0.15),
    "calf": (0.06, 0.15),
    "head": (0.03, 0.06),
}


def _accessories(rng: np.random.Generator) -> tuple[GarmentParameters, ...]:
    places = rng.permutation(list(_BANDS))[: int(rng.integers(1, 4))]
    bands = [
        GarmentParameters(
            "band",
            **{**_cloth(rng), "place": str(place), "length": float(rng.uniform(*_BANDS[place]))},  # type: ignore[arg-type]
        )
        for place in places
    ]
    if rng.random() < 0.5 and "wrist" not in places:
        mittens = {**_cloth(rng), "length": float(rng.uniform(0, 1)), "tautness": 30, "roughness": 0.0}
        bands.append(GarmentParameters("mittens", **mittens))  # type: ignore[arg-type]
    return tuple(bands)


def _garments(category: str, gender: str, rng: np.random.Generator) -> tuple[GarmentParameters, ...]:
    if category == "top":
        return (_top(rng),)
    if category == "open_top":
        return (_jacket(rng, 0),)
    if category == "trousers":
        return (_trousers(rng),)
    if category == "skirt":
        return (_skirt(rng),)
    if category == "dress":
        return (_dress(rng),)
    if category == "jumpsuit":
        return (_jumpsuit(rng),)
    if category == "top_trousers":
        tucked = rng.random() < 0.3
        return (_top(rng, 0, length=0.55), _trousers(rng, 1)) if tucked else (_trousers(rng), _top(rng, 1))
    if category == "top_skirt":
        tucked = rng.random() < 0.4
        return (_top(rng, 0, length=0.55), _skirt(rng, 1)) if tucked else (_skirt(rng), _top(rng, 1, length=0.5))
    if category == "jacket_top_trousers":
        return (_trousers(rng), _top(rng, 1), _jacket(rng, 2))
    if category == "jacket_dress":
        return (_dress(rng), _jacket(rng, 1))
    if category == "footwear":
        return (_feet(rng),)
    if category == "headwear":
        return (_headwear(rng),)
    return _accessories(rng)
