"""Materials of a file from anywhere, with the images that their textures show."""

from __future__ import annotations

from typing import Any

from garmentc.gltf.cursor import Cursor
from garmentc.gltf.glb_asset import GlbMaterial

_DEEPEST = 16
_SAMPLER = ("magFilter", "minFilter", "wrapS", "wrapT")


def read_materials(root: Cursor, image_count: int) -> tuple[GlbMaterial, ...]:
    """All materials, flattened. In place of the index of a texture stand its image and its sampler."""
    textures = [_texture(texture, root, image_count) for texture in root.get("textures")]
    materials = []
    for entry in root.get("materials"):
        values: dict[str, Any] = {}
        _flatten(entry, "", textures, values, 0)
        name = entry.get("name").text("")
        images = {key: value for key, value in values.items() if key.endswith("/image")}
        values = {key: value for key, value in values.items() if key not in images and key != "name"}
        materials.append(GlbMaterial(name, values, images))
    return tuple(materials)


def _texture(entry: Cursor, root: Cursor, image_count: int) -> dict[str, Any]:
    values: dict[str, Any] = {"image": entry.get("source").index(image_count)}
    if entry.get("sampler").given:
        samplers = list(root.get("samplers"))
        sampler = samplers[entry.get("sampler").index(len(samplers))]
        given = (key for key in _SAMPLER if sampler.get(key).given)
        values |= {f"sampler/{key}": sampler.get(key).integer() for key in given}
    return values


def _flatten(where: Cursor, path: str, textures: list[dict[str, Any]], values: dict[str, Any], depth: int) -> None:
    """Numbers, strings and flags by their path."""
    if depth > _DEEPEST:
        raise where.error("is nested too deeply")
    if isinstance(where.value, dict):
        for key, entry in where.items():
            if key == "index" and path.endswith("Texture"):
                values |= {f"{path}/{name}": value for name, value in textures[entry.index(len(textures))].items()}
            else:
                _flatten(entry, f"{path}/{key}" if path else key, textures, values, depth + 1)
    elif isinstance(where.value, list):
        for number, entry in enumerate(where):
            _flatten(entry, f"{path}/{number}", textures, values, depth + 1)
    else:
        values[path] = where.value
