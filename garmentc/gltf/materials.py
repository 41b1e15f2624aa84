"""Materials as glTF metallic-roughness (glTF 2.0 section 3.9), with their textures embedded."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from garmentc.gltf.accessors import AccessorWriter
from garmentc.outfit.outfit import Material, Texture

SPECULAR = "KHR_materials_specular"
EMISSIVE_STRENGTH = "KHR_materials_emissive_strength"
TEXTURE_TRANSFORM = "KHR_texture_transform"

_CLAMP_TO_EDGE = 33071
_REPEAT = 10497
_LINEAR = 9729
_LINEAR_MIPMAP_LINEAR = 9987


@dataclass
class MaterialWriter:
    """Appends materials to the document; equal images, samplers and textures are written once.

    extensions  names of the glTF extensions that were used
    """

    writer: AccessorWriter
    extensions: set[str] = field(default_factory=set)
    _images: dict[bytes, int] = field(default_factory=dict)
    _samplers: dict[bool, int] = field(default_factory=dict)
    _textures: dict[tuple[int, int], int] = field(default_factory=dict)

    def add(self, material: Material, textured: bool) -> int:
        """Add a material; returns its index.

        textured  False for a primitive without texture coordinates: engines refuse textures there
        """
        from pygltflib import Material as GltfMaterial
        from pygltflib import NormalMaterialTexture, PbrMetallicRoughness, TextureInfo

        def info(kind: Any, texture: Texture | None) -> Any:
            return self._texture_info(kind, texture) if texture is not None and textured else None

        surface = PbrMetallicRoughness(
            baseColorFactor=[_clip(value) for value in material.base_color],
            metallicFactor=_clip(material.metallic),
            roughnessFactor=_clip(material.roughness),
            baseColorTexture=info(TextureInfo, material.base_color_texture),
            metallicRoughnessTexture=info(TextureInfo, material.metallic_roughness_texture),
        )
        normal = info(NormalMaterialTexture, material.normal_texture)
        if normal is not None:
            normal.scale = float(material.normal_scale)
        strength = max(1.0, *material.emissive)
        written = GltfMaterial(
            name=material.name,
            pbrMetallicRoughness=surface,
            normalTexture=normal,
            emissiveTexture=info(TextureInfo, material.emissive_texture),
            emissiveFactor=[_clip(value / strength) for value in material.emissive],
            alphaMode=material.alpha_mode,
            doubleSided=True,  # cloth is seen from both sides
            extensions=self._extensions(material, strength),
        )
        materials = self.writer.document.materials
        materials.append(written)
        return len(materials) - 1

    def _extensions(self, material: Material, emissive_strength: float) -> dict[str, Any]:
        extensions: dict[str, Any] = {}
        if material.specular_color is not None:
            color = [max(0.0, float(value)) for value in material.specular_color]
            extensions[SPECULAR] = {"specularColorFactor": color}
        if emissive_strength > 1:
            extensions[EMISSIVE_STRENGTH] = {"emissiveStrength": float(emissive_strength)}
        self.extensions |= extensions.keys()
        return extensions

    def _texture_info(self, kind: Any, texture: Texture) -> Any:
        info = kind(index=self._texture(texture), texCoord=None)
        if texture.scale != (1.0, 1.0) or texture.offset != (0.0, 0.0):
            info.extensions = {TEXTURE_TRANSFORM: _texture_transform(texture)}
            self.extensions.add(TEXTURE_TRANSFORM)
        return info

    def _texture(self, texture: Texture) -> int:
        from pygltflib import Texture as GltfTexture

        key = self._image(texture), self._sampler(texture.clamp)
        if key not in self._textures:
            textures = self.writer.document.textures
            textures.append(GltfTexture(source=key[0], sampler=key[1]))
            self._textures[key] = len(textures) - 1
        return self._textures[key]

    def _image(self, texture: Texture) -> int:
        from pygltflib import Image

        if texture.data not in self._images:
            images = self.writer.document.images
            view = self.writer.view(texture.data)
            images.append(Image(name=texture.name, mimeType=texture.mime_type, bufferView=view))
            self._images[texture.data] = len(images) - 1
        return self._images[texture.data]

    def _sampler(self, clamp: bool) -> int:
        from pygltflib import Sampler

        if clamp not in self._samplers:
            wrap = _CLAMP_TO_EDGE if clamp else _REPEAT
            samplers = self.writer.document.samplers
            samplers.append(Sampler(magFilter=_LINEAR, minFilter=_LINEAR_MIPMAP_LINEAR, wrapS=wrap, wrapT=wrap))
            self._samplers[clamp] = len(samplers) - 1
        return self._samplers[clamp]


def _texture_transform(texture: Texture) -> dict[str, list[float]]:
    """MTL's -s and -o for texture coordinates with v downwards.

    With v = 1 - v' the MTL's v * s + o becomes 1 - (v' * s + 1 - s - o).
    """
    scale, offset = texture.scale, texture.offset
    return {
        "offset": [float(offset[0]), float(1 - scale[1] - offset[1])],
        "scale": [float(scale[0]), float(scale[1])],
    }


def _clip(value: float) -> float:
    return min(1.0, max(0.0, float(value)))
