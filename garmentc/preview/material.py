"""Materials as the renderer shades them."""

from __future__ import annotations

from dataclasses import dataclass

from garmentc.gltf.glb_asset import GlbAsset, GlbMaterial
from garmentc.preview.texture import REPEAT, Texture, decode

_SURFACE = "pbrMetallicRoughness"
_TRANSFORM = "extensions/KHR_texture_transform"
_Color = tuple[float, float, float]


@dataclass(frozen=True)
class Material:
    """glTF's metallic-roughness material (glTF 2.0 section 3.9), colours in linear light.

    cutoff  alpha below which nothing is drawn, where the alpha mode is "MASK"
    """

    base_color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    metallic: float = 0.0
    roughness: float = 0.9
    emissive: _Color = (0.0, 0.0, 0.0)
    specular: _Color = (1.0, 1.0, 1.0)
    normal_scale: float = 1.0
    alpha_mode: str = "OPAQUE"
    cutoff: float = 0.5
    base_color_texture: Texture | None = None
    metallic_roughness_texture: Texture | None = None
    normal_texture: Texture | None = None
    emissive_texture: Texture | None = None

    @property
    def is_cut_out(self) -> bool:
        """Whether alpha decides what is drawn."""
        return self.alpha_mode != "OPAQUE"


def read_material(asset: GlbAsset, index: int | None) -> Material:
    """The material of a primitive. Raises GarmentcError where one of its images cannot be read."""
    if index is None:
        return Material(metallic=1.0, roughness=1.0)  # what glTF prescribes where there is none
    source = asset.materials[index]
    red, green, blue, alpha = (_number(source, f"{_SURFACE}/baseColorFactor/{k}", 1.0) for k in range(4))
    strength = _number(source, "extensions/KHR_materials_emissive_strength/emissiveStrength", 1.0)
    specular = "extensions/KHR_materials_specular"
    weight = _number(source, f"{specular}/specularFactor", 1.0)
    return Material(
        base_color=(red, green, blue, alpha),
        metallic=_number(source, f"{_SURFACE}/metallicFactor", 1.0),
        roughness=_number(source, f"{_SURFACE}/roughnessFactor", 1.0),
        emissive=_color(source, "emissiveFactor", 0.0, strength),
        specular=_color(source, f"{specular}/specularColorFactor", 1.0, weight),
        normal_scale=_number(source, "normalTexture/scale", 1.0),
        alpha_mode=str(source.values.get("alphaMode", "OPAQUE")),
        cutoff=_number(source, "alphaCutoff", 0.5),
        base_color_texture=_texture(asset, source, f"{_SURFACE}/baseColorTexture", is_color=True),
        metallic_roughness_texture=_texture(asset, source, f"{_SURFACE}/metallicRoughnessTexture", is_color=False),
        normal_texture=_texture(asset, source, "normalTexture", is_color=False),
        emissive_texture=_texture(asset, source, "emissiveTexture", is_color=True),
    )


def _texture(asset: GlbAsset, source: GlbMaterial, path: str, is_color: bool) -> Texture | None:
    image = source.images.get(f"{path}/image")
    # Only the first set of texture coordinates is read back.
    if image is None or _number(source, f"{path}/texCoord", 0.0) != 0:
        return None
    wrap = tuple(int(_number(source, f"{path}/sampler/wrap{axis}", REPEAT)) for axis in "ST")
    offset, scale = (
        tuple(_number(source, f"{path}/{_TRANSFORM}/{name}/{axis}", default) for axis in range(2))
        for name, default in (("offset", 0.0), ("scale", 1.0))
    )
    return Texture(
        levels=decode(asset.images[image], asset.path, is_color),
        wrap=(wrap[0], wrap[1]),
        offset=(offset[0], offset[1]),
        rotation=_number(source, f"{path}/{_TRANSFORM}/rotation", 0.0),
        scale=(scale[0], scale[1]),
    )


def _number(source: GlbMaterial, path: str, default: float) -> float:
    value = source.values.get(path, default)
    return float(value) if isinstance(value, (int, float)) else default


def _color(source: GlbMaterial, path: str, default: float, strength: float) -> _Color:
    red, green, blue = (strength * _number(source, f"{path}/{k}", default) for k in range(3))
    return red, green, blue
