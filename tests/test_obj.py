"""The OBJ reader: content against a plain line-by-line reader, errors by file and line, robustness by fuzzing."""

from __future__ import annotations

import random
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from obj_reference import assert_same, parse

from garmentc.errors import GarmentcError
from garmentc.outfit import obj_lines
from garmentc.outfit.obj import read_obj
from garmentc.outfit.outfit import Outfit

Read = Callable[[str | bytes], Outfit]

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
UV = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"


@pytest.fixture
def read(tmp_path: Path) -> Read:
    def write_and_read(text: str | bytes) -> Outfit:
        path = tmp_path / "a.obj"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_obj(path)

    return write_and_read


def codes(outfit: Outfit) -> list[str]:
    return [warning.code for warning in outfit.warnings]


WRITTEN_ODDLY = {
    "plain": SQUARE + "f 1 2 3\nf 1 3 4\n",
    "no final newline": SQUARE + "f 1 2 3\nf 1 3 4",
    "crlf": (SQUARE + "f 1 2 3\nf 1 3 4\n").replace("\n", "\r\n"),
    "cr": (SQUARE + "f 1 2 3\nf 1 3 4\n").replace("\n", "\r"),
    "bom": "\ufeff" + SQUARE + "f 1 2 3\nf 1 3 4\n",
    "tabs": (SQUARE + "f 1 2 3\nf 1 3 4\n").replace(" ", "\t"),
    "form feeds and vertical tabs": (SQUARE + "f 1 2 3\nf 1 3 4\n").replace(" ", " \v\f"),
    "blanks": "\n \n" + (SQUARE + "f 1 2 3\nf 1 3 4\n").replace(" ", "   ").replace("\n", "  \n\t "),
    "continued faces": SQUARE + "f 1 \\\n2 \\\n 3\nf 1 3 \\\n 4\n",
    "continued crlf": (SQUARE + "f 1 \\\n2 3\nf 1 3 4\n").replace("\n", "\r\n"),
    "continued, blanks after the backslash": SQUARE + "f 1 2 \\  \n3\nf 1 3 4\n",
    "continued vertex": "v 0 0 \\\n0\nv 1 \\\n 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n",
    "continued at the end of the file": SQUARE + "f 1 2 3\nf 1 3 4\\",
    "comments are not continued": "# C:\\models\\\n" + SQUARE + "f 1 2 3 # end \\\nf 1 3 4\n",
    "comments": "# v 7 7 7\n" + SQUARE + "#f 1 2 4\nf 1 2 3 # 4\nf 1 3 4 # 5 6\n  # f 2 3 4\n",
    "faces first": "f 1 2 3\nf 1 3 4\n" + SQUARE,
    "faces between": "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nv 0 1 0\nf 1 3 4\n",
    "negative indices": SQUARE + "f -4 -3 -2\nf -4 -2 -1\n",
    "mixed signs": SQUARE + "f 1 -3 3\nf -4 3 4\n",
    "plus signs and zeros": SQUARE + "f +1 002 3\nf 1 3 4\n",
}


@pytest.mark.parametrize("text", WRITTEN_ODDLY.values(), ids=WRITTEN_ODDLY)
def test_ways_to_write_one_square(read: Read, text: str) -> None:
    outfit = read(text)
    np.testing.assert_array_equal(outfit.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    np.testing.assert_array_equal(outfit.tri_v, [[0, 1, 2], [0, 2, 3]])
    assert (outfit.tri_vt == -1).all()
    assert (outfit.tri_vn == -1).all()
    assert not outfit.warnings


def test_dtypes_are_those_of_the_outfit(read: Read) -> None:
    outfit = read(SQUARE + UV + "vn 0 0 1\ns 1\nf 1/1/1 2/2/1 3/3/1 4/4/1\n")
    for table in (outfit.tri_v, outfit.tri_vt, outfit.tri_vn, outfit.tri_face, outfit.tri_material, outfit.tri_group):
        assert table.dtype == np.int32
    assert outfit.tri_smooth is not None
    assert outfit.tri_smooth.dtype == outfit.face_line.dtype == np.int32
    assert outfit.vertices.dtype == outfit.texcoords.dtype == outfit.normals.dtype == np.float64


def test_relative_indices_count_from_their_own_line(read: Read) -> None:
    outfit = read(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nf -3/-3/-1 -2/-2/-1 -1/-1/-1\n"
        "v 5 0 0\nvt .1 .1\nvt .2 .2\nv 6 0 0\nv 6 1 0\nvn 0 1 0\nf -3/-3/-1 -2/-2/-2 -1/-1/-1\n"
    )
    np.testing.assert_array_equal(outfit.tri_v, [[0, 1, 2], [3, 4, 5]])
    np.testing.assert_array_equal(outfit.tri_vt, [[0, 1, 2], [2, 3, 4]])
    np.testing.assert_array_equal(outfit.tri_vn, [[0, 0, 0], [1, 0, 1]])


def test_corner_forms_may_mix(read: Read) -> None:
    outfit = read(SQUARE + UV + "vn 0 0 1\nf 1/1/1 2//1 3\nf 1/1 3/ 4//\n")
    np.testing.assert_array_equal(outfit.tri_vt, [[0, -1, -1], [0, -1, -1]])
    np.testing.assert_array_equal(outfit.tri_vn, [[0, 0, -1], [-1, -1, -1]])
    assert codes(outfit) == ["obj.partial-texcoords"]
    assert outfit.warnings[0].line == 10
    assert not outfit.has_texcoords


NUMBERS = (
    "1.e+1 .5 -.5 +1.5 1E-3 2e2 5. 1e-003 -0.0 0.1234567890123 1000000.123 1e15 00.10 2.2250738585072014e-308 "
    + ("0.1000000000000000055511151231257827 123456789012345678901234567890e-20 1e-400")
)


def test_numbers_are_correctly_rounded(read: Read) -> None:
    words = NUMBERS.split()
    lines = "".join(f"v {word} 0 0\n" for word in words)
    outfit = read(lines + "f 1 2 3\n")
    expected = np.array([float(word) for word in words])
    assert outfit.vertices[:, 0].tobytes() == expected.tobytes()


def test_vertex_weights_and_third_texture_coordinates_are_dropped(read: Read) -> None:
    outfit = read("v 0 0 0 1\nv 1 0 0\nv 1 1 0 1.0\nvt 0.5\nvt 1 2\nvt 1 2 3\nf 1/1 2/2 3/3\n")
    np.testing.assert_array_equal(outfit.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0]])
    np.testing.assert_array_equal(outfit.texcoords, [[0.5, 0], [1, 2], [1, 2]])
    assert not outfit.warnings
    weighted = read("v 0 0 0 1\nv 2 0 0 2\nv 1 1 0 1\nf 1 2 3\n")
    np.testing.assert_array_equal(weighted.vertices[1], [2, 0, 0])
    assert [(w.code, w.line) for w in weighted.warnings] == [("obj.vertex-weight", 2)]


def test_colors(read: Read) -> None:
    outfit = read("v 0 0 0 1 0 0\nv 1 0 0 0 .5 0 1\nv 1 1 0 0 0 1\nf 1 2 3\n")
    assert outfit.colors is not None
    np.testing.assert_array_equal(outfit.colors, [[1, 0, 0], [0, 0.5, 0], [0, 0, 1]])
    partial = read("v 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0 0 0 1\nf 1 2 3\n")
    assert partial.colors is not None
    np.testing.assert_array_equal(partial.colors, [[1, 0, 0], [1, 1, 1], [0, 0, 1]])
    assert codes(partial) == ["obj.partial-colors"]
    byte = read("v 0 0 0 255 0 0\nv 1 0 0\nv 1 1 0 0 0 51\nf 1 2 3\n")
    assert byte.colors is not None
    np.testing.assert_allclose(byte.colors, [[1, 0, 0], [1, 1, 1], [0, 0, 0.2]])
    assert codes(byte) == ["obj.partial-colors", "obj.byte-colors"]
    wild = read("v 0 0 0 -1 0 0\nv 1 0 0 300 0 0\nv 1 1 0 0 0 .5\nf 1 2 3\n")
    assert wild.colors is not None
    np.testing.assert_array_equal(wild.colors, [[0, 0, 0], [1, 0, 0], [0, 0, 0.5]])
    assert codes(wild) == ["obj.color-range"]
    assert read(SQUARE + "f 1 2 3\n").colors is None


def test_materials_and_groups_are_numbered_by_first_use(read: Read) -> None:
    outfit = read(
        SQUARE + "usemtl unused\nusemtl b b\nf 1 2 3\no coat\nusemtl a\ng left  sleeve\nf 1 3 4\n"
        "g\nusemtl b b  \nf 1 2 3\nf 1 2 4\n"
    )
    assert [m.name for m in outfit.materials] == ["b b", "a"]
    np.testing.assert_array_equal(outfit.tri_material, [0, 1, 0, 0])
    assert outfit.groups == ("", "coat/left  sleeve", "coat")
    np.testing.assert_array_equal(outfit.tri_group, [0, 1, 2, 2])
    assert codes(outfit) == ["mtl.undefined"]


def test_names_in_utf8_and_latin1(read: Read) -> None:
    assert read("o café\n" + SQUARE + "f 1 2 3\n").groups == ("café",)
    assert read("o café\n".encode("latin-1") + SQUARE.encode() + b"f 1 2 3\n").groups == ("café",)


def test_smoothing_groups(read: Read) -> None:
    outfit = read(
        SQUARE + "f 1 2 3\ns 2\nf 1 3 4\ns off\nf 1 2 4\ns 4294967295\nf 2 3 4\ns 0\nf 2 3 4\ns on\nf 2 3 4\n"
    )
    assert outfit.tri_smooth is not None
    np.testing.assert_array_equal(outfit.tri_smooth, [0, 2, 0, -1, 0, 1])
    assert read(SQUARE + "f 1 2 3\n").tri_smooth is None


def test_what_is_ignored_is_said_once_per_kind(read: Read) -> None:
    outfit = read(SQUARE + "l 1 2 3\nl 1 2\np 4\nvp 1 2\ncstype bezier\nvw 0 0 1.0\nlod 3\nf 1 2 3\n")
    assert [(w.code, w.line) for w in outfit.warnings] == [
        ("obj.primitive", 5),
        ("obj.primitive", 7),
        ("obj.free-form", 8),
        ("obj.unknown-statement", 10),
        ("obj.render-hint", 11),
    ]
    assert "2 lines" in outfit.warnings[0].message


def test_lines_are_those_of_the_file(read: Read) -> None:
    outfit = read("# head\r\n" + SQUARE.replace("\n", "\r\n") + "\r\nf 1 \\\r\n 2 3\r\nf 1 3 4\r\n")
    np.testing.assert_array_equal(outfit.face_line, [7, 9])


REFUSED = {
    "a word as vertex": ("v 0 0 0\nv a 0 0\n", 2, "'a' is not a number"),
    "two numbers": ("v 0 0\n", 1, "has 2 numbers"),
    "five numbers": ("v 0 0 0 1 1\n", 1, "has 5 numbers"),
    "vn with two": (SQUARE + "vn 0 1\n", 5, "'vn' has 2 numbers"),
    "vt without any": (SQUARE + "vt\n", 5, "'vt' has 0 numbers"),
    "decimal comma": ("v 0,5 0 0\n", 1, "decimal comma"),
    "nan": (SQUARE + "v nan 0 0\n", 5, "not a finite number"),
    "inf": ("v 0 0 0\nv 0 -inf 0\n", 2, "not a finite number"),
    "microsoft's nan": ("v 0 0 0\nv 0 -1.#IND 0\n", 2, "not a finite number"),
    "nan in vt": (SQUARE + "vt nan 0\n", 5, "not a finite number"),
    "1e30": ("v 0 0 0\nv 0 0 0\nv 1e30 0 0\n", 3, "too large"),
    "1e999": ("v 1e999 0 0\n", 1, "too large"),
    "two numbers in one": ("v 0 0 0\nv 1-2 0\n", 2, "numbers"),
    "glued numbers": ("v 0 0 0\nv 1-2 0 0\n", 2, "'1-2' is not a number"),
    "two points": ("v 1.2.3 0 0\n", 1, "'1.2.3' is not a number"),
    "control character": ("v 0\x010 0 0\n", 1, "is not a number"),
    "hexadecimal": ("v 0x10 0 0\n", 1, "'0x10' is not a number"),
    "underscore": ("v 1_0 0 0\n", 1, "'1_0' is not a number"),
    "exponent missing": ("v 1e 0 0\n", 1, "'1e' is not a number"),
    "fortran exponent": ("v 1d3 0 0\n", 1, "'1d3' is not a number"),
    "index 0": (SQUARE + "f 1 2 3\nf 0 1 2\n", 6, "counts from 1"),
    "texture index 0": (SQUARE + UV + "f 1/0 2/1 3/1\n", 9, "counts from 1"),
    "index too large": (SQUARE + "f 1 2 99\n", 5, "'v' number 99, but the file has 4"),
    "texture index too large": (SQUARE + UV + "f 1/1 2/2 3/99\n", 9, "'vt' number 99"),
    "normal that is not there": (SQUARE + "f 1//1 2//1 3//1\n", 5, "'vn' number 1, but the file has 0"),
    "index far too large": (SQUARE + "f 1 2 99999999999999999999999\n", 5, "number 99999999999999999999999, but"),
    "second face too large": (SQUARE + "f 1 2 3\n f 1/ 2147483648// 3\n", 6, "'v' number 2147483648, but"),
    "before the first": (SQUARE + "f -5 -1 -2\n", 5, "before the first 'v'"),
    "far before the first": (SQUARE + "f -99999999999999999999999 -1 -2\n", 5, "number -99999999999999999999999, but"),
    "before its own line": ("f -3 -2 -1\n" + SQUARE, 1, "before the first 'v'"),
    "float index": (SQUARE + "f 1.5 2 3\n", 5, "whole number"),
    "word index": (SQUARE + "f 1 2 3\nf a b c\n", 6, "'a'"),
    "four fields": (SQUARE + UV + "f 1/1/1/1 2 3\n", 9, "'1/1/1/1'"),
    "no vertex field": (SQUARE + UV + "f /1 2/2 3/3\n", 9, "'/1'"),
    "glued indices": (SQUARE + "f 1-2 3\n", 5, "2 corners"),
    "glued indices among enough": (SQUARE + "f 1-2 3 4\n", 5, "'1-2'"),
    "compensating damage": (SQUARE + UV + "f 1/ 1/1-2 3/3\n", 9, "'1/1-2'"),
    "two corners": (SQUARE + "f 1 2\n", 5, "2 corners"),
    "no corners": (SQUARE + "f\n", 5, "0 corners"),
    "smoothing group": (SQUARE + "s soft\nf 1 2 3\n", 5, "smoothing group 'soft'"),
    "after a continuation": ("v 0 0 \\\n0\nv 1 0 0\nv 1 \\\n 1 x\n", 5, "'x' is not a number"),
    "after cr": ("v 0 0 0\rv 1 0 0\rv 1 x 0\r", 3, "'x'"),
}


@pytest.mark.parametrize(("text", "line", "reason"), REFUSED.values(), ids=REFUSED)
def test_refused_with_line(read: Read, text: str, line: int, reason: str) -> None:
    with pytest.raises(GarmentcError) as caught:
        read(text)
    assert caught.value.line == line
    assert reason in caught.value.message
    assert str(caught.value.file).endswith("a.obj")


NO_OBJ = {
    "empty": (b"", "is empty"),
    "utf-16": ("v 0 0 0\n".encode("utf-16"), "UTF-16"),
    "utf-16 without mark": ("v 0 0 0\n".encode("utf-16-le"), "looks binary"),
    "nul bytes": (b"\x00\x01\x02v 0 0 0\n", "looks binary"),
    "gzip": (b"\x1f\x8b\x08\x00rest", "gzip"),
    "zip": (b"PK\x03\x04rest", "zip"),
    "glb": (b"glTF\x02\x00\x00\x00", "glTF"),
    "comments only": (b"# nothing\n", "no vertices and no faces"),
    "prose": (b"Dear Sir,\nplease find attached\n", "no vertices and no faces"),
    "vertices only": (SQUARE.encode(), "no faces"),
    "lines only": (SQUARE.encode() + b"l 1 2\n", "lines or points"),
    "points only": (SQUARE.encode() + b"p 1 2\n", "lines or points"),
    "surfaces only": (SQUARE.encode() + b"cstype bezier\ndeg 1 1\nsurf 0 1 0 1 1 2 3 4\nend\n", "free-form"),
    "random bytes": (random.Random(1).randbytes(5000).replace(b"\0", b"\1"), "no vertices and no faces"),
}


@pytest.mark.parametrize(("data", "reason"), NO_OBJ.values(), ids=NO_OBJ)
def test_no_obj(read: Read, data: bytes, reason: str) -> None:
    with pytest.raises(GarmentcError, match=reason):
        read(data)


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(GarmentcError, match="no such file"):
        read_obj(tmp_path / "missing.obj")
    with pytest.raises(GarmentcError, match="folder"):
        read_obj(tmp_path)
    with pytest.raises(GarmentcError, match="not a regular file"):
        read_obj("/dev/null")


def test_stretches_join_anywhere(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file is read in stretches; where they end must not matter."""
    text = (
        "o a\nv 0 0 0 1 0 0\nv 1 0 0\nvt 0 0\nvt 1 0 # c\nv 1 1 0\nvn 0 0 1\nusemtl m\ns 1\nf 1/1/1 -2/-1/1 \\\n3//1\n"
        "v 0 1 0\ng q\nf -1 -2 -3\n\n# end\nf 4/2 3/1 2/1 1/1\n"
    )
    whole = read(text)
    assert_same(whole, parse(text.encode()))
    for size in (1, 7, 20):
        monkeypatch.setattr(obj_lines, "_STRETCH", size)
        cut = read(text)
        for name in ("vertices", "texcoords", "normals", "tri_v", "tri_vt", "tri_vn", "tri_group", "face_line"):
            np.testing.assert_array_equal(getattr(cut, name), getattr(whole, name), err_msg=name)
        np.testing.assert_array_equal(cut.colors, whole.colors)


@st.composite
def written_meshes(draw: st.DrawFn) -> bytes:
    """A random mesh, written in a random way."""
    number = st.floats(-1e6, 1e6, allow_subnormal=False)
    random_lines: list[str] = []
    lengths = {"v": 0, "vt": 0, "vn": 0}

    def rows(keyword: str, width: int, least: int, most: int) -> None:
        for _ in range(draw(st.integers(least, most))):
            values = [
                draw(st.sampled_from(("{!r}", "{:.6f}", "{:e}", "{:+.3f}"))).format(draw(number)) for _ in range(width)
            ]
            random_lines.append(" ".join((keyword, *values)))
            lengths[keyword] += 1

    def index(keyword: str) -> str:
        at = draw(st.integers(1, lengths[keyword]))
        return str(at if draw(st.booleans()) else at - lengths[keyword] - 1)

    for _ in range(draw(st.integers(1, 3))):
        rows("v", 3, 3, 8)
        rows("vt", 2, 0, 4)
        rows("vn", 3, 0, 3)
        random_lines += draw(
            st.lists(st.sampled_from(("g a", "g b c", "o x", "usemtl m", "s 1", "s off", "# f 1 2 3", "")))
        )
        for _ in range(draw(st.integers(1, 4))):
            with_vt = lengths["vt"] and draw(st.booleans())
            with_vn = lengths["vn"] and draw(st.booleans())
            corners = []
            for _ in range(draw(st.integers(3, 7))):
                parts = (index("v"), index("vt") if with_vt else "", index("vn") if with_vn else "")
                corners.append("/".join(parts).rstrip("/"))
            random_lines.append(draw(st.sampled_from((" ", "  ", "\t", " \\\n"))).join(["f", *corners]))
    text = "\n".join(random_lines) + draw(st.sampled_from(("", "\n")))
    return text.replace("\n", draw(st.sampled_from(("\n", "\r\n", "\r")))).encode()


@settings(max_examples=80, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=written_meshes())
def test_round_trip_of_random_meshes(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "round_trip.obj"
    path.write_bytes(data)
    assert_same(read_obj(path), parse(data))


SEEDS = (
    b"mtllib a.mtl\no x\n"
    + SQUARE.encode()
    + UV.encode()
    + b"vn 0 0 1\nusemtl m\ns 1\nf 1/1/1 2/2/1 3/3/1 4/4/1\ng y\nf 1 2 3\n",
    b"v 0 0 0 1 0 0\r\nv 1 0 \\\r\n0 0 1 0\r\nv 1e0 1 0 0 0 1 # c\r\nf -3//  -2 -1\r\n",
    b"v 0 0 0\nv 3 0 0\nv 3 1 0\nv 1 1 0\nv 1 2 0\nv 3 2 0\nv 3 3 0\nv 0 3 0\nf 1 2 3 4 5 6 7 8\nl 1 2\n",
)
PIECES = b"\\\n|/|//|-|#|\r|\0|nan|e|.| |\n|f |v |vt |s |9999999999999999999999|\xff|,|\x01".split(b"|")


def mutated(seed: int) -> bytes:
    chance = random.Random(seed)
    data = bytearray(chance.choice(SEEDS))
    for _ in range(chance.randint(1, 6)):
        at = chance.randrange(len(data) + 1)
        kind = chance.randrange(4)
        if kind == 0:
            data[at:at] = chance.choice(PIECES)
        elif kind == 1:
            del data[at : at + chance.randint(1, 4)]
        elif kind == 2 and at < len(data):
            data[at] = chance.randrange(256)
        else:
            data[at:at] = data[at : at + chance.randint(1, 30)]
    return bytes(data)


def test_damaged_files_raise_nothing_but_garmentc_errors(tmp_path: Path) -> None:
    path = tmp_path / "fuzz.obj"
    (tmp_path / "a.mtl").write_text("newmtl m\nKd 1 0 0\n")
    read = refused = 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for seed in range(800):
            path.write_bytes(mutated(seed))
            try:
                outfit = read_obj(path)
            except GarmentcError as error:
                assert "\n" not in str(error)  # noqa: PT017
                refused += 1
            else:
                assert outfit.tri_v.min() >= 0
                assert outfit.tri_v.max() < len(outfit.vertices)
                assert np.isfinite(outfit.vertices).all()
                read += 1
    assert min(read, refused) > 60
