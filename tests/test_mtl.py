"""MTL text to what it says, and on to glTF's material model."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from garmentc.errors import GarmentcError
from garmentc.outfit.materials import load_materials
from garmentc.outfit.mtl import MapReference, MtlMaterial, read_mtl
from garmentc.outfit.obj import read_obj
from garmentc.outfit.obj_state import Library
from garmentc.outfit.outfit import Material, Outfit

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def parse(folder: Path, text: str | bytes) -> dict[str, MtlMaterial]:
    path = folder / "a.mtl"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_mtl(path)[0]


def material(folder: Path, statements: str) -> tuple[Material, list[str]]:
    """The material of a one-material library, and the codes of its warnings."""
    (folder / "a.mtl").write_text(f"newmtl m\n{statements}\n")
    (made,), warnings = load_materials(folder / "a.obj", [Library("a.mtl", 1)], ["m"])
    return made, [warning.code for warning in warnings]


def outfit(folder: Path, head: str, libraries: dict[str, str]) -> Outfit:
    for name, text in libraries.items():
        (folder / name).write_text(text)
    (folder / "a.obj").write_text(f"{head}\n{TRIANGLE}usemtl m\nf 1 2 3\n")
    return read_obj(folder / "a.obj")


WRITTEN_ODDLY = {
    "plain": "newmtl a b\nKd 0.1 0.2 0.3\nd 0.5\n",
    "crlf": "newmtl a b\r\nKd 0.1 0.2 0.3\r\nd 0.5\r\n",
    "bom": "\ufeffnewmtl a b\nKd 0.1 0.2 0.3\nd 0.5",
    "indented": "\n\t newmtl  a b  \n\t\tKd\t0.1 0.2\t0.3 # c\n  d -halo 0.5\n",
    "continued": "newmtl a b\nKd 0.1 \\\n 0.2 0.3\nd 0.5\n",
    "noise": "# a\nKd 9 9 9\nnewmtl a b\nillum 2\nfancy 1 2\nKd 0.1 0.2 0.3\nKs spectral f.rfl 1\nmap_Kd\nd 0.5\n",
}


@pytest.mark.parametrize("text", WRITTEN_ODDLY.values(), ids=WRITTEN_ODDLY)
def test_ways_to_write_one_material(tmp_path: Path, text: str) -> None:
    (name, mtl), *rest = parse(tmp_path, text).items()
    assert not rest
    assert name == mtl.name == "a b"
    assert mtl.colors == {"Kd": (0.1, 0.2, 0.3)}
    assert mtl.scalars == {"d": 0.5}
    assert not mtl.maps


MAPS = {
    "map_Kd a.png": MapReference("a.png", 2),
    "map_Kd my color map.png": MapReference("my color map.png", 2),
    "map_Kd -s 2 3 1 -o 0.5 0.25 0 my map.png": MapReference("my map.png", 2, (2, 3), (0.5, 0.25)),
    "map_Kd -o 0.1 diffuse.jpg": MapReference("diffuse.jpg", 2, offset=(0.1, 0)),
    "map_Kd -s 2 diffuse.jpg": MapReference("diffuse.jpg", 2, scale=(2, 1)),
    "map_Kd -clamp on -texres 512 -blendu off -mm 0 1 -type sphere a.png": MapReference("a.png", 2, clamp=True),
    "map_Kd -colorspace sRGB -cc on a.png": MapReference("a.png", 2),
    "map_Bump -bm 0.3 b.png": MapReference("b.png", 2, bump=0.3),
    "bump -imfchan r b.jpg -bm 1.5": MapReference("b.jpg", 2, bump=1.5, channel="r"),
    "map_Kd shirt -s 2.png": MapReference("shirt -s 2.png", 2),
    "map_Kd a -b c.png": MapReference("a -b c.png", 2),
    "map_Kd -a.png": MapReference("-a.png", 2),
    "map_kd a.png": MapReference("a.png", 2),
}


@pytest.mark.parametrize("statement", MAPS)
def test_map_statements(tmp_path: Path, statement: str) -> None:
    (reference,) = parse(tmp_path, f"newmtl m\n{statement}\n")["m"].maps.values()
    assert reference == MAPS[statement]


REFUSED = {
    "word": ("Kd red 0 0", "'red' is not a number"),
    "decimal comma": ("Ns 0,5", "'0,5' is not a number"),
    "nan": ("Kd nan 0 0", "'nan' is not a number"),
    "too large": ("Ns 1e999", "not a number"),
    "two numbers": ("Kd 1 0", "has 2 numbers"),
    "option without number": ("map_Bump -bm b.png", "'b.png' is not a number"),
    "options without a name": ("map_Kd -s 1 1 1", "names no file"),
}


@pytest.mark.parametrize(("statement", "reason"), REFUSED.values(), ids=REFUSED)
def test_refused_with_line(tmp_path: Path, statement: str, reason: str) -> None:
    with pytest.raises(GarmentcError) as caught:
        parse(tmp_path, f"newmtl m\nd 1\n{statement}\n")
    assert reason in caught.value.message
    assert (caught.value.file, caught.value.line) == (tmp_path / "a.mtl", 3)


def test_a_library_that_is_no_text_is_refused(tmp_path: Path) -> None:
    with pytest.raises(GarmentcError, match="looks binary"):
        parse(tmp_path, b"newmtl\0")


def test_second_definition_counts(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl m\nKd 1 0 0\nnewmtl m\nKd 0 1 0\n")
    materials, warnings = read_mtl(tmp_path / "a.mtl")
    assert materials["m"].colors["Kd"] == (0, 1, 0)
    assert [(w.code, w.line) for w in warnings] == [("mtl.duplicate", 3)]


def test_defaults(tmp_path: Path) -> None:
    made, codes = material(tmp_path, "")
    assert made == Material("m", base_color=(0.8, 0.8, 0.8, 1.0), metallic=0.0, roughness=1.0, specular_color=None)
    assert not codes


def test_colors_are_taken_as_linear(tmp_path: Path) -> None:
    made, codes = material(tmp_path, "Kd 0.5 0.25 0.125\nKs 0.1 0.2 0.3\nKe 0.4 0 0\nKa 1 1 1")
    assert made.base_color == (0.5, 0.25, 0.125, 1.0)
    assert made.specular_color == (0.1, 0.2, 0.3)
    assert made.emissive == (0.4, 0, 0)
    assert not codes
    grey, _ = material(tmp_path, "Kd 0.5\nKs 0")
    assert (grey.base_color, grey.specular_color) == ((0.5, 0.5, 0.5, 1.0), (0, 0, 0))


@pytest.mark.parametrize(("statements", "expected"), [("Ns 0", 1.0), ("Ns 30", 0.5), ("Ns 510", 0.25), ("Ns -5", 1.0)])
def test_roughness_of_shininess(tmp_path: Path, statements: str, expected: float) -> None:
    made, _ = material(tmp_path, statements)
    assert made.roughness == pytest.approx(expected, abs=1e-12)
    assert made.metallic == 0


def test_pbr_keys_win(tmp_path: Path) -> None:
    made, codes = material(tmp_path, "Pr 0.7\nPm 0.3\nNs 500\n")
    assert (made.roughness, made.metallic) == (0.7, 0.3)
    assert not codes


OPACITY = {
    "d 0.25": (0.25, "BLEND", []),
    "Tr 0.25": (0.75, "BLEND", []),
    "Tr 0.25\nd 0.5": (0.5, "BLEND", []),
    "d 1\nTr 1": (1.0, "OPAQUE", []),
    "Tr 1": (1.0, "OPAQUE", ["mtl.invisible"]),
    "Tr 0": (1.0, "OPAQUE", []),
    "d 1.5": (1.0, "OPAQUE", ["mtl.range"]),
}


@pytest.mark.parametrize("statements", OPACITY)
def test_opacity(tmp_path: Path, statements: str) -> None:
    made, codes = material(tmp_path, statements)
    assert (made.base_color[3], made.alpha_mode, codes) == OPACITY[statements]


def test_what_lies_outside_the_unit_range_is_clamped_and_told(tmp_path: Path) -> None:
    made, codes = material(tmp_path, "Kd 2 0.5 -1\nKe 5 0 0\nPm 3")
    assert made.base_color == (1, 0.5, 0, 1)
    assert made.emissive == (1, 0, 0)
    assert made.metallic == 1
    assert set(codes) == {"mtl.range"}


def test_maps_without_a_place_are_told(tmp_path: Path) -> None:
    _, codes = material(tmp_path, "map_Ks a.png\ndisp b.png\nmap_Ka c.png")
    assert codes == ["mtl.unused-map", "mtl.unused-map"]


RED, BLUE = "newmtl m\nKd 1 0 0\n", "newmtl m\nKd 0 0 1\n"
LIBRARIES = {
    "one": ("mtllib a.mtl", {"a.mtl": RED}),
    "in a line": ("mtllib x.mtl a.mtl", {"x.mtl": "newmtl x\n", "a.mtl": RED}),
    "in two lines": ("mtllib x.mtl\nmtllib a.mtl", {"x.mtl": "newmtl x\n", "a.mtl": RED}),
    "the first counts": ("mtllib a.mtl b.mtl", {"a.mtl": RED, "b.mtl": BLUE}),
    "blanks in the name": ("mtllib my materials.mtl", {"my materials.mtl": RED}),
    "blanks in several names": ("mtllib x y.mtl my materials.mtl", {"x y.mtl": "newmtl x\n", "my materials.mtl": RED}),
    "escaped blanks": ("mtllib x.mtl my\\ materials.mtl", {"x.mtl": "newmtl x\n", "my materials.mtl": RED}),
    "quotes": ('mtllib "my materials.mtl"', {"my materials.mtl": RED}),
    "a dot": ("mtllib ./a.mtl", {"a.mtl": RED}),
    "windows": ("mtllib .\\a.mtl", {"a.mtl": RED}),
    "a comment": ("mtllib a.mtl # the materials", {"a.mtl": RED}),
    "another suffix": ("mtllib a.material", {"a.material": RED}),
}


@pytest.mark.parametrize(("head", "files"), LIBRARIES.values(), ids=LIBRARIES)
def test_finding_libraries(tmp_path: Path, head: str, files: dict[str, str]) -> None:
    read = outfit(tmp_path, head, files)
    assert read.materials[0].base_color == (1, 0, 0, 1)
    assert not read.warnings


def test_only_used_materials_are_made(tmp_path: Path) -> None:
    read = outfit(tmp_path, "mtllib a.mtl", {"a.mtl": "newmtl x\nmap_Kd ../secret.png\n" + RED})
    assert [m.name for m in read.materials] == ["m"]


def test_missing_library_is_a_warning(tmp_path: Path) -> None:
    read = outfit(tmp_path, "mtllib old name.mtl", {"a.mtl": RED})
    assert read.materials == (Material("m"),)
    assert [(w.code, w.line) for w in read.warnings] == [("mtl.missing", 1), ("mtl.undefined", None)]
    assert "should it be 'a.mtl'?" in read.warnings[0].message


def test_empty_library_is_a_warning_as_a_missing_one_is(tmp_path: Path) -> None:
    read = outfit(tmp_path, "mtllib a.mtl", {"a.mtl": ""})
    assert read.materials == (Material("m"),)
    assert [(w.code, w.file) for w in read.warnings] == [
        ("mtl.empty", str(tmp_path / "a.mtl")),
        ("mtl.undefined", str(tmp_path / "a.obj")),
    ]


def test_letter_case_of_a_library_is_a_warning(tmp_path: Path) -> None:
    read = outfit(tmp_path, "mtllib A.MTL", {"a.mtl": RED})
    assert read.materials[0].base_color == (1, 0, 0, 1)
    assert [(w.code, w.line) for w in read.warnings] == [("asset.letter-case", 1)]


def test_number_sign_in_a_name_and_as_a_comment(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl Material #25\nKd 1 0 0\nnewmtl red\nKd 0 1 0\n")
    (tmp_path / "a.obj").write_text(
        f"mtllib a.mtl\n{TRIANGLE}usemtl Material #25\nf 1 2 3\nusemtl red # warm\nf 1 2 3\n"
    )
    read = read_obj(tmp_path / "a.obj")
    assert [(m.name, m.base_color[:2]) for m in read.materials] == [("Material #25", (1, 0)), ("red", (0, 1))]
    assert not read.warnings


@pytest.mark.parametrize("name", ["../a.mtl", "/etc/a.mtl", "C:\\a.mtl", "\\\\server\\a.mtl", "x/../../a.mtl"])
def test_libraries_outside_the_folder_are_refused(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "inner"
    folder.mkdir()
    (tmp_path / "a.mtl").write_text(RED)
    with pytest.raises(GarmentcError, match="outside the OBJ's folder") as caught:
        outfit(folder, f"# head\nmtllib {name}", {})
    assert (caught.value.file, caught.value.line) == (folder / "a.obj", 2)
    assert "--allow-external-textures" in caught.value.message


def test_external_libraries_may_be_allowed(tmp_path: Path) -> None:
    folder = tmp_path / "inner"
    folder.mkdir()
    (tmp_path / "b.mtl").write_text(RED)
    (folder / "a.obj").write_text(f"mtllib ../b.mtl\n{TRIANGLE}usemtl m\nf 1 2 3\n")
    read = read_obj(folder / "a.obj", allow_external_textures=True)
    assert read.materials[0].base_color == (1, 0, 0, 1)


MTL_PIECES = (
    b"-s",
    b" ",
    b"\n",
    b"../",
    b"\\",
    b"#",
    b"nan",
    b"1e9",
    b"newmtl ",
    b"map_Kd ",
    b"Kd ",
    b"\xff",
    b'"',
    b"/",
)


def test_damaged_libraries_raise_nothing_but_garmentc_errors(tmp_path: Path) -> None:
    whole = b"newmtl m\nKd 1 0.5 0\nNs 5\nmap_Kd -s 2 2 1 -o .5 a b.png\nbump -bm 2 c.png\nd 0.5\nnewmtl n\nTr 1\n"
    for seed in range(400):
        chance = random.Random(seed)
        data = bytearray(whole)
        for _ in range(chance.randint(1, 6)):
            at = chance.randrange(len(data))
            data[at : at + chance.choice((0, 0, 1, 5))] = chance.choice(MTL_PIECES)
        (tmp_path / "a.mtl").write_bytes(bytes(data))
        try:
            made, _ = load_materials(tmp_path / "a.obj", [Library("a.mtl", 1)], ["m", "n"])
        except GarmentcError as error:
            assert error.file == tmp_path / "a.mtl"  # noqa: PT017
        else:
            assert all(0 <= value <= 1 for m in made for value in (*m.base_color, m.roughness, m.metallic))


def test_corpus_materials(shared: Path) -> None:
    """The hand-made library of the corpus, value by value."""
    plain, pbr = read_obj(shared / "data/obj_corpus/micro/two_materials.obj").materials
    assert (plain.name, plain.base_color, plain.alpha_mode) == ("plain", (0.5, 0.25, 0.125, 0.5), "BLEND")
    assert (pbr.name, pbr.base_color, pbr.emissive) == ("pbr one", (0.1, 0.2, 0.3, 1.0), (0.1, 0, 0))
    assert pbr.base_color_texture is not None
    assert (pbr.base_color_texture.scale, pbr.base_color_texture.offset) == ((2, 2), (0.5, 0))
    assert pbr.base_color_texture.data == (shared / "data/obj_corpus/micro/my color map.png").read_bytes()
    assert pbr.normal_texture is not None
    assert (pbr.normal_texture.name, pbr.normal_scale) == ("normal map", 0.5)
    assert pbr.metallic_roughness_texture is not None
    assert pbr.metallic_roughness_texture.scale == (2, 2)
    assert (pbr.roughness, pbr.metallic) == (1.0, 1.0)
    second = read_obj(shared / "data/obj_corpus/micro/mtllib_second.obj").materials
    assert [(m.name, m.base_color) for m in second] == [
        ("plain", (0.5, 0.25, 0.125, 0.5)),
        ("extra", (1.0, 0.0, 0.0, 1.0)),
    ]
