"""From MTL materials to metallic-roughness ones, textures loaded.

Kd is linear base colour, roughness (2 / (Ns + 2))^(1/4), Ks the specular colour; d counts before Tr, Pr and Pm before
all. Only materials that faces use are made, so only their textures are opened.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from garmentc.errors import Diagnostic
from garmentc.outfit.asset_files import AssetFolder
from garmentc.outfit.material_maps import MapLoader, color_map, emissive_map, metallic_roughness_map, normal_map
from garmentc.outfit.mtl import MtlMaterial, read_mtl
from garmentc.outfit.obj_state import DEFAULT_MATERIAL, Library
from garmentc.outfit.outfit import Material

_UNUSED_MAPS = ("map_Ks", "map_Ns", "map_Ps", "disp", "decal", "refl")


def load_materials(
    obj: Path, libraries: Sequence[Library], names: Sequence[str], *, allow_external_textures: bool = False
) -> tuple[tuple[Material, ...], tuple[Diagnostic, ...]]:
    """One material for each of `names`, from the material libraries that the OBJ file `obj` names.

    A name that no library defines becomes a plain material, and a missing library or texture a warning.
    Raises GarmentcError, with file and line, for malformed libraries, damaged images, and libraries or textures that
    lie outside the OBJ's folder unless `allow_external_textures`.
    """
    folder = AssetFolder(obj, allow_external_textures)
    definitions, warnings = _read_libraries(folder, libraries)
    maps = MapLoader(folder)
    materials: list[Material] = []
    undefined: list[str] = []
    for name in names:
        spelling = next((s for s in (name, name.split(" #")[0].strip()) if s in definitions), None)
        if spelling is not None:
            materials.append(_material(definitions[spelling], maps))
        else:
            materials.append(Material(name))
            undefined += [name] if name != DEFAULT_MATERIAL else []
    if undefined:
        listed = ", ".join(f"'{name}'" for name in undefined[:5]) + (", ..." if len(undefined) > 5 else "")
        where = "in no material library" if libraries else "nowhere, as the file names no material library (mtllib)"
        message = (
            f"material {listed} is defined {where}; a plain one is used"
            if len(undefined) == 1
            else f"materials {listed} are defined {where}; plain ones are used"
        )
        warnings.append(Diagnostic("mtl.undefined", message, str(obj)))
    return tuple(materials), (*warnings, *maps.warnings)


def _read_libraries(
    folder: AssetFolder, libraries: Sequence[Library]
) -> tuple[dict[str, MtlMaterial], list[Diagnostic]]:
    """All definitions; of two libraries that define a name the one named first counts (MTL specification)."""
    definitions: dict[str, MtlMaterial] = {}
    warnings: list[Diagnostic] = []
    for library in libraries:
        names = _library_names(folder, library)
        for name in names:
            path, notes = folder.find(name, folder.obj, library.line)
            warnings += notes
            if path is None:
                beside = folder.obj.with_suffix(".mtl")
                hint = f"; should it be '{beside.name}'?" if len(names) == 1 and beside.is_file() else ""
                message = f"material library '{name}' does not exist{hint}"
                warnings.append(Diagnostic("mtl.missing", message, str(folder.obj), library.line))
                continue
            found, notes = read_mtl(path)
            warnings += notes
            definitions = {**found, **definitions}
    return definitions, warnings


def _library_names(folder: AssetFolder, library: Library) -> list[str]:
    """An mtllib argument is one name, blanks and all, if such a file exists; else names end in ".mtl"."""
    whole = library.argument
    if folder.find(whole, folder.obj, library.line)[0] is not None:
        return [whole]
    names: list[str] = []
    words: list[str] = []
    for word in whole.split(" "):
        words.append(word)
        if word.lower().endswith((".mtl", '.mtl"')):
            names.append(" ".join(words).strip())
            words = []
    rest = " ".join(words).strip()
    return names + ([rest] if rest and not rest.startswith("#") else [])


def _material(mtl: MtlMaterial, maps: MapLoader) -> Material:
    roughness = mtl.scalars.get("Pr", (2 / (max(mtl.scalars.get("Ns", 0.0), 0.0) + 2)) ** 0.25)
    material = Material(
        name=mtl.name,
        base_color=(*_unit_color(mtl, "Kd", (0.8, 0.8, 0.8), maps), 1.0),
        metallic=_unit(mtl, "Pm", mtl.scalars.get("Pm", 0.0), maps),
        roughness=_unit(mtl, "Pr", roughness, maps),
        specular_color=_unit_color(mtl, "Ks", (0.0, 0.0, 0.0), maps) if "Ks" in mtl.colors else None,
        emissive=_unit_color(mtl, "Ke", (0.0, 0.0, 0.0), maps),
    )
    for key in _UNUSED_MAPS:
        if key in mtl.maps:
            maps.warn("mtl.unused-map", f"'{key}' has no place in a glTF material and is ignored", mtl, key)
    material = color_map(replace(material, base_color=(*material.base_color[:3], _opacity(mtl, maps))), mtl, maps)
    material = metallic_roughness_map(material, mtl, maps)
    return emissive_map(normal_map(material, mtl, maps), mtl, maps)


def _opacity(mtl: MtlMaterial, maps: MapLoader) -> float:
    """d, else 1 - Tr. What would make cloth invisible is a known exporter's slip and is not believed."""
    opacity = mtl.scalars.get("d")
    if opacity is None:
        opacity = 1 - mtl.scalars.get("Tr", 0.0)
        if opacity <= 0:
            maps.warn("mtl.invisible", "'Tr' makes the material invisible; it is taken as opaque", mtl)
            opacity = 1.0
    if opacity <= 0 and "map_d" in mtl.maps:
        opacity = 1.0  # some exporters leave all opacity to the map
    return _unit(mtl, "d", opacity, maps)


def _unit(mtl: MtlMaterial, key: str, value: float, maps: MapLoader) -> float:
    clamped = min(max(value, 0.0), 1.0)
    if clamped != value:
        maps.warn("mtl.range", f"'{key}' {value:g} lies outside 0..1 and is clamped", mtl)
    return clamped


def _unit_color(
    mtl: MtlMaterial, key: str, default: tuple[float, float, float], maps: MapLoader
) -> tuple[float, float, float]:
    red, green, blue = mtl.colors.get(key, default)
    return _unit(mtl, key, red, maps), _unit(mtl, key, green, maps), _unit(mtl, key, blue, maps)
