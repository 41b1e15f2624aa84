"""The shared corpus of awkward OBJ files: each is read right or refused with its reason; and the real garments."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from obj_reference import assert_same, parse

from garmentc.errors import GarmentcError
from garmentc.outfit.obj import read_obj
from garmentc.outfit.outfit import Outfit
from garmentc.outfit.topology import components, weld

REFUSED: dict[str, tuple[int | None, str]] = {
    "assimp/models/OBJ/box_UTF16BE.obj": (None, "UTF-16"),
    "assimp/models/OBJ/number_formats.obj": (11, "'3.1+e2' is not a number"),
    "assimp/models/OBJ/point_cloud.obj": (None, "no faces"),
    "assimp/models/OBJ/testline.obj": (None, "lines or points but no faces"),
    "assimp/models/OBJ/testpoints.obj": (None, "lines or points but no faces"),
    "assimp/models/invalid/empty.obj": (None, "empty"),
    "assimp/models/invalid/malformed.obj": (28, "index 0"),
    "assimp/models/invalid/malformed2.obj": (23, "0 corners"),
    "micro/binary.obj": (None, "binary"),
    "micro/comma_decimal.obj": (1, "decimal comma"),
    "micro/comments_only.obj": (None, "no vertices and no faces"),
    "micro/empty.obj": (None, "empty"),
    "micro/f_out_of_range.obj": (5, "'v' number 99"),
    "micro/f_two.obj": (5, "2 corners"),
    "micro/f_word.obj": (5, "'a'"),
    "micro/f_zero.obj": (5, "index 0"),
    "micro/float_index.obj": (5, "whole number"),
    "micro/huge_1e30.obj": (1, "too large"),
    "micro/huge_1e39.obj": (1, "too large"),
    "micro/inf.obj": (1, "not a finite number"),
    "micro/nan.obj": (1, "not a finite number"),
    "micro/utf16.obj": (None, "UTF-16"),
    "micro/v_two_numbers.obj": (1, "2 numbers"),
    "micro/v_word.obj": (1, "'a' is not a number"),
    "micro/vt_out_of_range.obj": (9, "'vt' number 99"),
    "tinyobjloader/catmark_torus_creases0.obj": (62, "'vn' number 1, but the file has 0"),
    "tinyobjloader/invalid-face-definition.obj": (15, "1 corner;"),
    "tinyobjloader/invalid-relative-texture-index.obj": (2, "before the first 'vt'"),
    "tinyobjloader/invalid-relative-vertex-index.obj": (1, "before the first 'v'"),
    "tinyobjloader/issue-140-zero-face-idx.obj": (16, "index 0"),
    "tinyobjloader/issue-356-leading-spaces-newmtl.obj": (None, "no vertices and no faces"),
    "tinyobjloader/line-prim.obj": (None, "lines or points but no faces"),
    "tinyobjloader/points-prim.obj": (None, "lines or points but no faces"),
    "tinyobjloader/smoothing-group-two-squares.obj": (21, "'vn' number 1, but the file has 0"),
    "tinyobjloader/test-nan.obj": (12, "not a finite number"),
}

READ: dict[str, tuple[int, int, set[str]]] = {  # vertices, triangles, kinds of warnings
    "assimp/models/OBJ/box.obj": (8, 12, {"mtl.undefined"}),
    "assimp/models/OBJ/box_longline.obj": (
        8,
        944,
        {"mtl.undefined", "obj.degenerate-polygon", "obj.repeated-vertex"},
    ),
    "assimp/models/OBJ/box_mat_with_spaces.obj": (8, 12, set()),
    "assimp/models/OBJ/box_without_lineending.obj": (8, 12, {"mtl.undefined"}),
    "assimp/models/OBJ/concave_polygon.obj": (64, 64, set()),
    "assimp/models/OBJ/cube_mtllib_after_g.obj": (8, 12, {"mtl.missing", "mtl.undefined"}),
    "assimp/models/OBJ/cube_usemtl.obj": (8, 12, {"mtl.undefined"}),
    "assimp/models/OBJ/cube_with_vertexcolors.obj": (8, 12, set()),
    "assimp/models/OBJ/cube_with_vertexcolors_uni.obj": (8, 12, set()),
    "assimp/models/OBJ/empty_mat.obj": (130, 256, set()),
    "assimp/models/OBJ/mtl_different_folder.obj": (8, 12, {"texture.missing"}),
    "assimp/models/OBJ/multiple_spaces.obj": (4, 1, set()),
    "assimp/models/OBJ/only_a_part_of_vertexcolors.obj": (5, 3, {"obj.partial-colors"}),
    "assimp/models/OBJ/regr_3429812.obj": (4, 4, set()),
    "assimp/models/OBJ/space_in_material_name.obj": (64, 64, set()),
    "assimp/models/OBJ/testmixed.obj": (8, 12, {"mtl.undefined", "obj.primitive"}),
    "micro/bom.obj": (4, 2, set()),
    "micro/color.obj": (3, 1, set()),
    "micro/color_partial.obj": (3, 1, {"obj.partial-colors"}),
    "micro/commented_data.obj": (4, 2, set()),
    "micro/concave_ngon_C.obj": (8, 6, set()),
    "micro/concave_quad.obj": (4, 2, set()),
    "micro/continuation.obj": (4, 2, set()),
    "micro/continuation_crlf.obj": (4, 2, set()),
    "micro/continuation_v.obj": (3, 1, set()),
    "micro/cr_only.obj": (4, 2, set()),
    "micro/crlf.obj": (4, 2, set()),
    "micro/degenerate_face.obj": (4, 2, {"obj.repeated-vertex"}),
    "micro/duplicate_v.obj": (6, 2, set()),
    "micro/face_order.obj": (5, 3, {"mtl.map-options"}),
    "micro/groups.obj": (4, 2, set()),
    "micro/inline_comment.obj": (4, 2, set()),
    "micro/latin1_name.obj": (4, 2, set()),
    "micro/lines_points.obj": (4, 2, {"obj.primitive"}),
    "micro/long_line.obj": (4, 2, set()),
    "micro/missing_mtllib.obj": (4, 2, {"mtl.missing", "mtl.undefined"}),
    "micro/missing_mtllib_2mats.obj": (4, 2, {"mtl.missing", "mtl.undefined"}),
    "micro/mixed_formats.obj": (4, 2, {"obj.partial-texcoords"}),
    "micro/mtllib_in_comment.obj": (4, 2, {"mtl.map-options"}),
    "micro/mtllib_second.obj": (4, 2, set()),
    "micro/neg_end.obj": (4, 2, set()),
    "micro/neg_interleaved.obj": (6, 2, set()),
    "micro/neg_vt_interleaved.obj": (4, 2, set()),
    "micro/ngon_300.obj": (300, 298, set()),
    "micro/no_final_newline.obj": (4, 2, set()),
    "micro/numbers.obj": (3, 1, set()),
    "micro/pentagon_one.obj": (5, 3, set()),
    "micro/pentagons.obj": (10, 6, set()),
    "micro/plain.obj": (4, 2, set()),
    "micro/precision64.obj": (3, 1, set()),
    "micro/quads.obj": (6, 4, set()),
    "micro/tabs_spaces.obj": (4, 2, set()),
    "micro/token_trap.obj": (10, 5, {"obj.partial-texcoords"}),
    "micro/tri_quad_mix.obj": (6, 4, set()),
    "micro/two_materials.obj": (4, 2, {"mtl.map-options"}),
    "micro/unreferenced_v.obj": (6, 2, set()),
    "micro/uv_seam.obj": (4, 2, set()),
    "micro/v_after_f.obj": (4, 2, set()),
    "micro/v_w.obj": (3, 1, set()),
    "micro/vt_vn.obj": (4, 2, set()),
    "tinyobjloader/colorspace-issue-184.obj": (3, 1, {"mtl.unused-map", "texture.missing"}),
    "tinyobjloader/cornell_box.obj": (76, 36, set()),
    "tinyobjloader/cornell_box_multimaterial.obj": (76, 36, set()),
    "tinyobjloader/cube-vertex-w-component.obj": (8, 12, {"obj.vertex-weight"}),
    "tinyobjloader/cube-vertexcol.obj": (8, 12, set()),
    "tinyobjloader/cube.obj": (8, 12, set()),
    "tinyobjloader/issue-138.obj": (8, 12, set()),
    "tinyobjloader/issue-161-inconsistent-f.obj": (8, 12, {"mtl.undefined", "obj.partial-texcoords"}),
    "tinyobjloader/issue-162-smoothing-group.obj": (8, 12, set()),
    "tinyobjloader/issue-177.obj": (8, 12, set()),
    "tinyobjloader/issue-235-usemtl-then-o.obj": (8, 2, set()),
    "tinyobjloader/issue-244-mtl-searchpaths.obj": (8, 2, {"mtl.missing", "mtl.undefined"}),
    "tinyobjloader/issue-246-usemtl-whitespace.obj": (8, 1, set()),
    "tinyobjloader/issue-248-texres-texopt.obj": (8, 12, {"texture.missing"}),
    "tinyobjloader/issue-295-trianguation-failure.obj": (16, 28, set()),
    "tinyobjloader/issue-319-002.obj": (20, 14, set()),
    "tinyobjloader/issue-319-003.obj": (10, 8, set()),
    "tinyobjloader/issue-330.obj": (7, 3, set()),
    "tinyobjloader/issue-92.obj": (3, 1, {"texture.missing"}),
    "tinyobjloader/issue-95-2.obj": (3, 1, set()),
    "tinyobjloader/issue-95.obj": (3, 1, set()),
    "tinyobjloader/leading-decimal-dot-issue-201.obj": (3, 1, set()),
    "tinyobjloader/leading-zero-in-exponent-notation-issue-210.obj": (3, 1, set()),
    "tinyobjloader/map-bump.obj": (218, 400, {"texture.missing"}),
    "tinyobjloader/missing_material_file.obj": (76, 36, {"mtl.undefined"}),
    "tinyobjloader/mtl filename with whitespace issue46.obj": (8, 12, {"mtl.missing"}),
    "tinyobjloader/mtllib-multiple-files-issue-112.obj": (3, 1, {"mtl.missing", "texture.missing"}),
    "tinyobjloader/no_material.obj": (76, 36, set()),
    "tinyobjloader/norm-texopt.obj": (3, 1, {"texture.missing"}),
    "tinyobjloader/pbr-mat-ext.obj": (4, 2, {"mtl.unused-map", "texture.missing"}),
    "tinyobjloader/refl.obj": (8, 12, {"mtl.unused-map"}),
    "tinyobjloader/skin-weight.obj": (8, 12, {"obj.unknown-statement"}),
    "tinyobjloader/smoothing-normal.obj": (8, 6, set()),
    "tinyobjloader/texture-filename-with-whitespace.obj": (8, 12, {"texture.missing"}),
    "tinyobjloader/texture-options-issue-85.obj": (3, 1, {"mtl.unused-map", "texture.missing"}),
    "tinyobjloader/tr-and-d-issue-43.obj": (218, 400, set()),
    "tinyobjloader/usemtl-issue-104.obj": (12, 6, set()),
    "tinyobjloader/usemtl-issue-68.obj": (218, 400, set()),
}


@pytest.fixture(scope="module")
def corpus(shared: Path) -> Path:
    return shared / "data" / "obj_corpus"


def test_every_file_of_the_corpus_is_expected(corpus: Path) -> None:
    assert {str(path.relative_to(corpus)) for path in corpus.rglob("*.obj")} == REFUSED.keys() | READ.keys()


@pytest.mark.parametrize("name", REFUSED)
def test_refused(corpus: Path, name: str) -> None:
    line, reason = REFUSED[name]
    with pytest.raises(GarmentcError) as caught:
        read_obj(corpus / name)
    assert reason in caught.value.message
    assert caught.value.line == line
    assert caught.value.file == corpus / name


@pytest.mark.parametrize("name", READ)
def test_read_right(corpus: Path, name: str) -> None:
    vertices, triangles, codes = READ[name]
    outfit = read_obj(corpus / name)
    assert (len(outfit.vertices), len(outfit.tri_v)) == (vertices, triangles)
    assert {warning.code for warning in outfit.warnings} == codes
    assert_same(outfit, parse((corpus / name).read_bytes()))


FLAT = (
    "assimp/models/OBJ/concave_polygon.obj",
    "micro/concave_ngon_C.obj",
    "micro/concave_quad.obj",
    "micro/ngon_300.obj",
    "micro/pentagons.obj",
    "tinyobjloader/issue-319-003.obj",
)


@pytest.mark.parametrize("name", FLAT)
def test_flat_polygons_are_filled_once(corpus: Path, name: str) -> None:
    """No triangle is folded over another: their areas add up to the area of the polygon (Newell)."""
    outfit = read_obj(corpus / name)
    for polygon in parse((corpus / name).read_bytes()).faces:
        ring = outfit.vertices[[corner[0] for corner in polygon.corners]]
        area = np.linalg.norm(np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0)) / 2
        corners = outfit.vertices[outfit.tri_v[outfit.face_line[outfit.tri_face] == polygon.line]]
        parts = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        np.testing.assert_allclose(parts.sum(), area, rtol=1e-6)


def test_contents_by_hand(corpus: Path) -> None:
    """What the names of the micro files promise, written out."""

    def micro(name: str) -> Outfit:
        return read_obj(corpus / "micro" / f"{name}.obj")

    assert micro("numbers").vertices.tolist() == [[10, 0.5, -0.5], [1.5, 0.001, 200], [1, 1, 0]]
    assert micro("precision64").vertices[0].tolist() == [0.1234567890123, 1000000.123, 0]
    assert micro("neg_interleaved").tri_v.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert micro("neg_vt_interleaved").tri_vt.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert micro("unreferenced_v").tri_v.tolist() == [[1, 2, 3], [1, 3, 4]]
    assert micro("uv_seam").tri_vt.tolist() == [[0, 1, 2], [4, 5, 3]]
    assert micro("token_trap").tri_vt.tolist() == [[0, 1, 2]] + [[-1, -1, -1]] * 4
    assert micro("latin1_name").groups == ("café",)
    assert micro("groups").groups == ("obj/top", "obj/bottom")
    assert micro("v_w").vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
    assert micro("color").colors.tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert micro("color_partial").colors.tolist() == [[1, 0, 0], [1, 1, 1], [0, 0, 1]]
    assert micro("concave_quad").tri_v.tolist() == [[0, 1, 3], [1, 2, 3]]
    assert micro("tri_quad_mix").tri_face.tolist() == [0, 0, 1, 2]
    order = micro("face_order")
    assert [order.materials[i].name for i in order.tri_material] == ["plain", "pbr one", "plain"]
    assert order.tri_v.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 4]]
    assert len(weld(micro("duplicate_v")).vertices) == 4


GARMENTS = "data/garments/makehuman"


def test_garments_keep_their_vertices(shared: Path) -> None:
    """All development garments: rows, corners and materials as the plain reader sees them, no warning."""
    paths = sorted((shared / GARMENTS).glob("*.obj"))
    assert len(paths) > 10
    for path in paths:
        outfit = read_obj(path)
        assert_same(outfit, parse(path.read_bytes()))
        assert not outfit.warnings, path.name


def test_garment_counts_are_those_of_the_metadata(shared: Path) -> None:
    metadata = json.loads((shared / GARMENTS / "metadata.json").read_text())
    for name, facts in metadata["files"].items():
        outfit = read_obj(shared / GARMENTS / name)
        assert len(outfit.vertices) == facts["vertices"], name
        assert len(outfit.texcoords) == facts["texcoords"], name
        corners = np.bincount(outfit.tri_face) + 2
        kinds = [int((corners == 3).sum()), int((corners == 4).sum()), int((corners > 4).sum())]
        assert kinds == [facts["triangles"], facts["quads"], facts["ngons"]], name
        assert sorted(material.name for material in outfit.materials) == sorted(facts["materials"] or ["default"]), name
        welded = weld(outfit)
        pieces = int(components(welded.triangles, len(welded.vertices)).max()) + 1
        assert pieces == facts.get("components_welded", facts["components"]), name
