"""Reading Wavefront OBJ: strict about what it means, tolerant about how it is written.

Source: the Advanced Visualizer manual, appendix B1 ("Object Files"), and what exporters make of it.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import Diagnostic, GarmentcError
from garmentc.outfit.materials import load_materials
from garmentc.outfit.obj_scan import Tables, scan
from garmentc.outfit.obj_state import read_state
from garmentc.outfit.obj_text import ObjText, read_text
from garmentc.outfit.outfit import Outfit
from garmentc.outfit.triangulate import triangulate


def read_obj(path: str | PathLike[str], *, allow_external_textures: bool = False) -> Outfit:
    """Read an OBJ file with the materials and textures it names.

    Vertex order, corners, materials, groups and smoothing are the file's; polygons are triangulated.
    Repairs are listed in `Outfit.warnings`. Unless `allow_external_textures`, no material library or texture outside
    the OBJ's folder is opened.

    Raises GarmentcError, with the line where there is one, for files that cannot be read or mean nothing certain:
    binary or empty ones, malformed or not finite numbers, indices out of range, no faces at all.
    """
    text = read_text(Path(path))
    tables = scan(text)
    if not len(tables.counts):
        raise _no_faces(text, tables)
    _check_corners(text, tables)

    state = read_state(text, tables)
    triangles, tri_face, degenerate = triangulate(tables.v, tables.corners[:, 0], tables.counts)
    face_line = _face_lines(text, tables.offsets)
    colors, color_warnings = _colors(text, tables)
    materials, material_warnings = load_materials(
        text.path, state.libraries, state.material_names, allow_external_textures=allow_external_textures
    )
    corners = np.ascontiguousarray(tables.corners.T)
    return Outfit(
        path=text.path,
        vertices=tables.v,
        tri_v=corners[0][triangles],
        tri_vt=corners[1][triangles],
        tri_vn=corners[2][triangles],
        tri_face=tri_face,
        tri_material=state.material[tri_face],
        tri_group=state.group[tri_face],
        tri_smooth=None if state.smooth is None else state.smooth[tri_face],
        face_line=face_line,
        texcoords=tables.vt,
        normals=tables.vn,
        colors=colors,
        materials=materials,
        groups=state.groups,
        warnings=(
            *state.warnings,
            *_vertex_warnings(text, tables),
            *_texcoord_warnings(text, tables),
            *color_warnings,
            *_degenerate_warnings(text, face_line, degenerate),
            *_repeated_warnings(text, face_line[tri_face], corners[0][triangles]),
            *material_warnings,
        ),
    )


def _face_lines(text: ObjText, offsets: NDArray[np.int64]) -> NDArray[np.int32]:
    """(P,) 1-based line of the file at each offset."""
    data = np.frombuffer(text.physical, np.uint8)
    newlines = np.flatnonzero(data == ord("\n"))
    return (np.searchsorted(newlines, offsets) + 1).astype(np.int32)


def _check_corners(text: ObjText, tables: Tables) -> None:
    """Raise GarmentcError for a face that refers to a row the file does not have."""
    for column, (name, rows) in enumerate((("v", tables.v), ("vt", tables.vt), ("vn", tables.vn))):
        beyond = tables.corners[:, column] >= len(rows)
        if beyond.any():
            corner = int(np.argmax(beyond))
            ends = np.cumsum(tables.counts)
            face = int(np.searchsorted(ends, corner, side="right"))
            offset = int(tables.offsets[face])
            tokens = text.data[offset : text.data.index(b"\n", offset)].split()
            # As the file has it: the table's number saturates. The first token is the keyword.
            written = tokens[1 + corner - int(ends[face] - tables.counts[face])].split(b"/")[column].decode()
            message = f"face refers to '{name}' number {written}, but the file has {len(rows)}"
            raise text.error(f"{message}; it may be cut short, export it again", offset)


def _no_faces(text: ObjText, tables: Tables) -> GarmentcError:
    """The error for a file without faces, saying what it has instead."""
    kinds = {statement.keyword for statement in tables.statements}
    if kinds & {"curv", "curv2", "surf", "cstype"}:
        return GarmentcError("has only free-form surfaces and no faces; convert them to polygons", text.path)
    if kinds & {"l", "p"}:
        return GarmentcError("has lines or points but no faces; export a mesh", text.path)
    if len(tables.v):
        return GarmentcError("has vertices but no faces; export a mesh, or the file is cut short", text.path)
    return GarmentcError("has no vertices and no faces; is it a Wavefront OBJ file?", text.path)


def _colors(text: ObjText, tables: Tables) -> tuple[NDArray[np.float64] | None, list[Diagnostic]]:
    """Vertex colours in [0, 1]; white where only some vertices have one."""
    if tables.colors is None:
        return None, []
    warnings = []
    colors = tables.colors
    missing = np.isnan(colors[:, 0])
    if missing.any():
        message = f"{missing.sum()} of {len(colors)} vertices have no colour; they become white"
        warnings.append(Diagnostic("obj.partial-colors", message, str(text.path)))
        colors = np.where(missing[:, None], 1.0, colors)
    if colors.max() > 1 and colors.max() <= 255 and colors.min() >= 0:
        warnings.append(Diagnostic("obj.byte-colors", "vertex colours range to 255; divided by 255", str(text.path)))
        colors = np.where(missing[:, None], 1.0, colors / 255)
    elif colors.min() < 0 or colors.max() > 1:
        warnings.append(Diagnostic("obj.color-range", "vertex colours outside 0..1 are clamped", str(text.path)))
        colors = np.clip(colors, 0, 1)
    return colors, warnings


def _vertex_warnings(text: ObjText, tables: Tables) -> list[Diagnostic]:
    if tables.weighted is None:
        return []
    message = "vertex weights (the w of 'v x y z w') only matter to free-form surfaces and are ignored"
    return [Diagnostic("obj.vertex-weight", message, str(text.path), text.line_of(tables.weighted))]


def _texcoord_warnings(text: ObjText, tables: Tables) -> list[Diagnostic]:
    absent = tables.corners[:, 1] < 0
    if not absent.any() or absent.all():
        return []
    face = int(np.searchsorted(np.cumsum(tables.counts), int(np.argmax(absent)), side="right"))
    message = f"{absent.sum()} of {len(absent)} face corners have no texture coordinate"
    return [Diagnostic("obj.partial-texcoords", message, str(text.path), text.line_of(int(tables.offsets[face])))]


def _degenerate_warnings(
    text: ObjText, face_line: NDArray[np.int32], degenerate: NDArray[np.int32]
) -> list[Diagnostic]:
    if not len(degenerate):
        return []
    message = (
        f"{len(degenerate)} polygon(s) have no area, cross themselves or are too large to cut well; they became fans"
    )
    return [Diagnostic("obj.degenerate-polygon", message, str(text.path), int(face_line[degenerate[0]]))]


def _repeated_warnings(text: ObjText, tri_line: NDArray[np.int32], tri_v: NDArray[np.int32]) -> list[Diagnostic]:
    a, b, c = tri_v.T
    repeated = (a == b) | (b == c) | (c == a)
    if not repeated.any():
        return []
    message = f"{repeated.sum()} triangle(s) use a vertex twice and have no area; they will not be seen"
    return [Diagnostic("obj.repeated-vertex", message, str(text.path), int(tri_line[np.argmax(repeated)]))]
