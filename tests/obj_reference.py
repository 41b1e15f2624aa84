"""A plain, slow OBJ reader, line by line, to compare the vectorised one with. It knows only well-formed files."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

from garmentc.outfit.outfit import Outfit

Corner = tuple[int, int, int]


@dataclass
class Face:
    corners: list[Corner]
    material: str
    group: str
    smooth: int
    line: int


@dataclass
class ObjModel:
    v: list[tuple[float, ...]] = field(default_factory=list)
    vt: list[tuple[float, ...]] = field(default_factory=list)
    vn: list[tuple[float, ...]] = field(default_factory=list)
    faces: list[Face] = field(default_factory=list)


def parse(data: bytes) -> ObjModel:
    model = ObjModel()
    material, names, smooth = "default", {"o": "", "g": ""}, 0
    lines = data.decode("latin-1").removeprefix("\xef\xbb\xbf").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    number = 0
    while number < len(lines):
        first, line = number, lines[number]
        while "#" not in line and line.rstrip().endswith("\\") and number + 1 < len(lines):
            number += 1
            line = line.rstrip()[:-1] + " " + lines[number]
        number += 1
        keyword, _, rest = line.strip().replace("\t", " ").partition(" ")
        words = rest.split("#")[0].split()
        if keyword in ("v", "vt", "vn"):
            width = 2 if keyword == "vt" else 3
            values = tuple(float(word) for word in words[:width])
            getattr(model, keyword).append(values + (0.0,) * (width - len(values)))
        elif keyword == "f":
            tables = (model.v, model.vt, model.vn)
            corners = []
            for word in words:
                texts = (word + "//").split("/")
                corners.append(tuple(_index(text, table) for text, table in zip(texts, tables, strict=False)))
            model.faces.append(Face(corners, material, "/".join(filter(None, names.values())), smooth, first + 1))
        elif keyword == "usemtl":
            material = _name(rest)
        elif keyword in names:
            names[keyword] = _name(rest.split(" #")[0])
        elif keyword == "s":
            smooth = 0 if words[0] in ("off", "0") else int(words[0])
    return model


def _index(text: str, table: list[tuple[float, ...]]) -> int:
    if not text:
        return -1
    return int(text) - 1 if int(text) > 0 else len(table) + int(text)


def _name(raw: str) -> str:
    try:
        return raw.encode("latin-1").decode("utf-8").strip()
    except UnicodeDecodeError:
        return raw.strip()


def assert_same(outfit: Outfit, model: ObjModel) -> None:
    """The outfit has the model's rows bit for bit, and its faces cut into triangles without a hole."""
    assert [tuple(row) for row in outfit.vertices.tolist()] == model.v
    assert [tuple(row) for row in outfit.texcoords.tolist()] == model.vt
    assert [tuple(row) for row in outfit.normals.tolist()] == model.vn
    assert outfit.face_line.tolist() == [face.line for face in model.faces]
    assert sorted(set(outfit.tri_face.tolist())) == list(range(len(model.faces)))
    assert (outfit.tri_face[1:] >= outfit.tri_face[:-1]).all()
    first = 0
    for number, face in enumerate(model.faces):
        count = len(face.corners) - 2
        rows = slice(first, first + count)
        first += count
        assert (outfit.tri_face[rows] == number).all()
        assert {outfit.materials[i].name for i in outfit.tri_material[rows]} == {face.material}
        assert {outfit.groups[i] for i in outfit.tri_group[rows]} == {face.group}
        if outfit.tri_smooth is not None:
            assert set(outfit.tri_smooth[rows].tolist()) == {face.smooth}
        stacked = zip(*(table[rows].tolist() for table in (outfit.tri_v, outfit.tri_vt, outfit.tri_vn)), strict=True)
        triangles = [list(zip(*triangle, strict=True)) for triangle in stacked]
        assert_fills(triangles, face.corners)
    assert first == len(outfit.tri_v)


def assert_fills(triangles: list[list[Corner]], polygon: list[Corner]) -> None:
    """Inner edges cancel and what remains is the polygon's outline, in its direction."""
    assert len(triangles) == len(polygon) - 2
    edges: Counter[tuple[Corner, Corner]] = Counter()
    for a, b, c in triangles:
        for edge in ((a, b), (b, c), (c, a)):
            edges[edge] += 1
            edges[edge[::-1]] -= 1
    outline: Counter[tuple[Corner, Corner]] = Counter()
    for edge in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        outline[edge] += 1
        outline[edge[::-1]] -= 1
    assert {edge: n for edge, n in edges.items() if n} == {edge: n for edge, n in outline.items() if n}
