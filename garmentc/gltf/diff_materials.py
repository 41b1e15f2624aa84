"""Differences of materials, number by number, with textures compared by their images."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any

from garmentc.gltf.difference import Difference, DiffTolerances, unequal
from garmentc.gltf.glb_asset import GlbAsset


def material_differences(left: GlbAsset, right: GlbAsset, tolerances: DiffTolerances) -> Iterator[Difference]:
    for mesh, (x, y) in enumerate(zip(left.meshes, right.meshes, strict=True)):
        for number, (p, q) in enumerate(zip(x.primitives, y.primitives, strict=True)):
            a, b = _material(left, p.material), _material(right, q.material)
            for key in sorted(a.keys() | b.keys()):
                where = f"meshes/{mesh}/primitives/{number}/material/{key}"
                yield from _compare(where, a.get(key), b.get(key), tolerances.material)


def _compare(where: str, a: Any, b: Any, tolerance: float) -> Iterator[Difference]:
    numbers = all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in (a, b))
    if not numbers or abs(a - b) > tolerance:
        yield from unequal(where, a, b)


def _material(asset: GlbAsset, index: int | None) -> dict[str, Any]:
    """All properties of a material by their path, images by their content."""
    if index is None:
        return {}
    material = asset.materials[index]
    images = {key: asset.images[image] for key, image in material.images.items()}
    shown = {
        key: f"{image.mime_type}, {len(image.data)} bytes, sha256 {hashlib.sha256(image.data).hexdigest()[:12]}"
        for key, image in images.items()
    }
    return {"name": material.name, **material.values, **shown}
