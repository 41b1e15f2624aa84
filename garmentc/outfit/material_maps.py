"""The maps of an MTL material as textures of a metallic-roughness one."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from garmentc.errors import Diagnostic
from garmentc.outfit.asset_files import AssetFolder
from garmentc.outfit.image_file import LoadedImage, channel, is_translucent, load_image
from garmentc.outfit.mtl import MapReference, MtlMaterial
from garmentc.outfit.outfit import Material
from garmentc.outfit.textures import (
    alpha_mode,
    as_texture,
    bump_kind,
    metallic_roughness,
    normals_of_heights,
    png_texture,
    with_alpha,
)


@dataclass
class MapLoader:
    """Opens the images of maps, each once, and gathers what is to be said about them."""

    folder: AssetFolder
    warnings: list[Diagnostic] = field(default_factory=list)
    _images: dict[Path, LoadedImage] = field(default_factory=dict)

    def image(self, mtl: MtlMaterial, key: str) -> LoadedImage | None:
        """The image of a map; None where the material has no such map, or, with a warning, no such file exists.

        Raises GarmentcError for damaged images and files outside the OBJ's folder.
        """
        reference = mtl.maps.get(key)
        if reference is None:
            return None
        path, notes = self.folder.find(reference.name, mtl.path, reference.line)
        self.warnings += notes
        if path is None:
            self.warn("texture.missing", f"texture '{reference.name}' does not exist; none is used", mtl, key)
            return None
        if path not in self._images:
            self._images[path] = load_image(path)
        return self._images[path]

    def warn(self, code: str, message: str, mtl: MtlMaterial, key: str | None = None) -> None:
        """Add a warning about a material, at the line of the map `key` or else of the material."""
        line = mtl.line if key is None else mtl.maps[key].line
        self.warnings.append(Diagnostic(code, f"material '{mtl.name}': {message}", str(mtl.path), line))


def color_map(material: Material, mtl: MtlMaterial, maps: MapLoader) -> Material:
    """map_Kd, with map_d in its alpha. The factor is Kd, unless that is black and would hide the texture."""
    color, mask = maps.image(mtl, "map_Kd"), maps.image(mtl, "map_d")
    opaque = material.base_color[3] >= 1
    material = replace(material, alpha_mode="OPAQUE" if opaque else "BLEND")
    if color is not None and max(material.base_color[:3]) == 0:
        maps.warn("mtl.black-texture", "'Kd' 0 would blacken 'map_Kd'; the texture is used as it is", mtl, "map_Kd")
        material = replace(material, base_color=(1.0, 1.0, 1.0, material.base_color[3]))
    if mask is not None:
        opacity = channel(mask, mtl.maps["map_d"].channel, "m")
        mode = alpha_mode(opacity)
        if mode != "OPAQUE":
            reference = _shared_reference(mtl, maps, "map_Kd", "map_d") if color is not None else mtl.maps["map_d"]
            name = mask.path.stem if color is None else color.path.stem
            texture = png_texture(name, with_alpha(color, opacity), reference)
            return replace(material, base_color_texture=texture, alpha_mode=mode if opaque else "BLEND")
    elif color is not None and opaque and is_translucent(color):
        message = f"'{color.path.name}' has transparent pixels, but there is no 'map_d' to use them; it is opaque"
        maps.warn("texture.alpha-unused", message, mtl, "map_Kd")
    if color is None:
        return material
    return replace(material, base_color_texture=as_texture(color, mtl.maps["map_Kd"]))


def metallic_roughness_map(material: Material, mtl: MtlMaterial, maps: MapLoader) -> Material:
    """map_Pr and map_Pm in one image. A map stands in place of its scalar."""
    rough, metal = maps.image(mtl, "map_Pr"), maps.image(mtl, "map_Pm")
    if rough is None and metal is None:
        return material
    if rough is not None and metal is not None:
        reference = _shared_reference(mtl, maps, "map_Pr", "map_Pm")
    else:
        reference = mtl.maps["map_Pr" if rough is not None else "map_Pm"]
    image = metallic_roughness(
        None if rough is None else channel(rough, mtl.maps["map_Pr"].channel),
        None if metal is None else channel(metal, mtl.maps["map_Pm"].channel),
    )
    name = "_".join(part.path.stem for part in (rough, metal) if part is not None)
    return replace(
        material,
        roughness=1.0 if rough is not None else material.roughness,
        metallic=1.0 if metal is not None else material.metallic,
        metallic_roughness_texture=png_texture(name, image, reference),
    )


def normal_map(material: Material, mtl: MtlMaterial, maps: MapLoader) -> Material:
    """norm, else map_Bump; bump images with heights become normal maps. The scale is -bm."""
    normal = maps.image(mtl, "norm")
    if normal is not None:
        reference = mtl.maps["norm"]
        return replace(material, normal_texture=as_texture(normal, reference), normal_scale=reference.bump)
    bump = maps.image(mtl, "map_Bump")
    if bump is None:
        return material
    reference = mtl.maps["map_Bump"]
    kind = bump_kind(bump)
    if kind == "normal":
        return replace(material, normal_texture=as_texture(bump, reference), normal_scale=reference.bump)
    if kind == "other":
        message = f"'{bump.path.name}' is neither a normal map nor a grey height map; it is ignored"
        maps.warn("texture.bump", message, mtl, "map_Bump")
        return material
    message = f"the height map '{bump.path.name}' was turned into a normal map; its depth is a guess"
    maps.warn("texture.height", message, mtl, "map_Bump")
    image = normals_of_heights(channel(bump, reference.channel), reference.bump, wrap=not reference.clamp)
    return replace(material, normal_texture=png_texture(bump.path.stem, image, reference))


def emissive_map(material: Material, mtl: MtlMaterial, maps: MapLoader) -> Material:
    """map_Ke; its factor is Ke, or full where Ke is absent or black."""
    emissive = maps.image(mtl, "map_Ke")
    if emissive is None:
        return material
    factor = material.emissive if max(material.emissive) > 0 else (1.0, 1.0, 1.0)
    return replace(material, emissive=factor, emissive_texture=as_texture(emissive, mtl.maps["map_Ke"]))


def _shared_reference(mtl: MtlMaterial, maps: MapLoader, first: str, second: str) -> MapReference:
    """The options of two maps that become one image: those of the first."""
    a, b = mtl.maps[first], mtl.maps[second]
    if (a.scale, a.offset, a.clamp) != (b.scale, b.offset, b.clamp):
        message = f"'{second}' becomes one image with '{first}' and takes its -s, -o and -clamp"
        maps.warn("mtl.map-options", message, mtl, second)
    return a
