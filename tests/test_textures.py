"""Textures: embedded unchanged where glTF allows, converted and merged where not, and never from outside the folder."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from garmentc.errors import GarmentcError
from garmentc.outfit.materials import load_materials
from garmentc.outfit.obj import read_obj
from garmentc.outfit.obj_state import Library
from garmentc.outfit.outfit import Material, Texture


def save(path: Path, image: Image.Image, **options: object) -> bytes:
    path.parent.mkdir(parents=True, exist_ok=True)
    image.save(path, **options)  # type: ignore[arg-type]
    return path.read_bytes()


def noise(mode: str, size: tuple[int, int] = (8, 6), seed: int = 0) -> Image.Image:
    bands = len(Image.new(mode, (1, 1)).getbands())
    pixels = np.random.default_rng(seed).integers(0, 256, (size[1], size[0], bands), np.uint8)
    return Image.fromarray(pixels.squeeze(), mode)


def material(folder: Path, statements: str, *, external: bool = False) -> tuple[Material, list[str]]:
    (folder / "a.mtl").write_text(f"newmtl m\n{statements}\n")
    (made,), warnings = load_materials(folder / "a.obj", [Library("a.mtl", 1)], ["m"], allow_external_textures=external)
    return made, [warning.code for warning in warnings]


def pixels(texture: Texture | None) -> np.ndarray:
    assert texture is not None
    return np.asarray(Image.open(io.BytesIO(texture.data)))


EMBEDDED = {
    "a.png": ("RGB", "image/png"),
    "grey.png": ("L", "image/png"),
    "alpha.png": ("RGBA", "image/png"),
    "a.jpg": ("RGB", "image/jpeg"),
    "grey.jpeg": ("L", "image/jpeg"),
}


@pytest.mark.parametrize("name", EMBEDDED)
def test_png_and_jpeg_pass_through(tmp_path: Path, name: str) -> None:
    mode, mime_type = EMBEDDED[name]
    data = save(tmp_path / name, noise(mode))
    made, codes = material(tmp_path, f"map_Kd -s 2 3 -o 0.5 0.25 -clamp on {name}")
    expected = Texture(Path(name).stem, data, mime_type, (2, 3), (0.5, 0.25), clamp=True)
    assert made.base_color_texture == expected
    assert codes == (["texture.alpha-unused"] if mode == "RGBA" else [])


def test_the_format_is_read_from_the_content(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    noise("RGB").save(buffer, "JPEG")
    (tmp_path / "wrong.png").write_bytes(buffer.getvalue())
    made, _ = material(tmp_path, "map_Kd wrong.png")
    assert made.base_color_texture is not None
    assert made.base_color_texture.mime_type == "image/jpeg"


@pytest.mark.parametrize("suffix", ["tga", "bmp", "tiff", "webp", "ppm", "pcx"])
def test_other_formats_become_png(tmp_path: Path, suffix: str) -> None:
    image = noise("RGB")
    save(tmp_path / f"a.{suffix}", image, **({"lossless": True} if suffix == "webp" else {}))
    made, codes = material(tmp_path, f"map_Kd a.{suffix}")
    assert made.base_color_texture is not None
    assert made.base_color_texture.mime_type == "image/png"
    np.testing.assert_array_equal(pixels(made.base_color_texture), np.asarray(image))
    assert not codes


def test_unusual_pixels_become_plain_ones(tmp_path: Path) -> None:
    save(tmp_path / "cmyk.jpg", noise("CMYK"))
    made, _ = material(tmp_path, "map_Kd cmyk.jpg")
    assert made.base_color_texture is not None
    assert made.base_color_texture.mime_type == "image/png"
    assert pixels(made.base_color_texture).shape == (6, 8, 3)
    save(tmp_path / "deep.tiff", Image.fromarray(np.array([[0, 65535]], np.uint16)))
    made, _ = material(tmp_path, "map_Kd deep.tiff")
    np.testing.assert_array_equal(pixels(made.base_color_texture), [[0, 255]])


def test_conversion_repeats_to_the_byte(tmp_path: Path) -> None:
    save(tmp_path / "a.bmp", noise("RGB"))
    first, second = (material(tmp_path, "map_Kd a.bmp")[0].base_color_texture for _ in range(2))
    assert first == second


def cutout(size: int = 64) -> Image.Image:
    alpha = np.zeros((size, size), np.uint8)
    alpha[: size // 2] = 255
    alpha[size // 2, :] = 128
    return Image.fromarray(alpha)


MASKS = {
    "cut-out": (cutout(), "MASK"),
    "gradient": (Image.fromarray(np.tile(np.arange(256, dtype=np.uint8), (4, 1))), "BLEND"),
    "opaque": (Image.new("L", (4, 4), 255), "OPAQUE"),
}


@pytest.mark.parametrize("kind", MASKS)
def test_opacity_maps_go_into_the_alpha(tmp_path: Path, kind: str) -> None:
    mask, mode = MASKS[kind]
    color = noise("RGB", mask.size)
    data = save(tmp_path / "c.png", color)
    save(tmp_path / "m.png", mask)
    made, codes = material(tmp_path, "Kd 1 1 1\nmap_Kd c.png\nmap_d m.png")
    assert made.alpha_mode == mode
    assert not codes
    assert made.base_color_texture is not None
    if mode == "OPAQUE":
        assert made.base_color_texture.data == data
        return
    merged = pixels(made.base_color_texture)
    np.testing.assert_array_equal(merged[..., :3], np.asarray(color))
    np.testing.assert_array_equal(merged[..., 3], np.asarray(mask))


def test_opacity_map_alone_and_in_another_size(tmp_path: Path) -> None:
    save(tmp_path / "m.png", cutout())
    made, _ = material(tmp_path, "Kd 1 0 0\nmap_d m.png")
    alone = pixels(made.base_color_texture)
    assert (alone[..., :3] == 255).all()
    assert made.base_color == (1, 0, 0, 1)
    save(tmp_path / "c.png", noise("RGB", (16, 16)))
    made, _ = material(tmp_path, "map_Kd c.png\nmap_d m.png")
    merged = pixels(made.base_color_texture)
    assert merged.shape == (64, 64, 4)
    np.testing.assert_array_equal(merged[..., 3], np.asarray(cutout()))


def test_opacity_in_the_alpha_of_the_same_image(tmp_path: Path) -> None:
    """What Blender writes for one RGBA image: map_Kd and map_d name the same file."""
    image = noise("RGB", (64, 64))
    image.putalpha(cutout())
    save(tmp_path / "c.png", image)
    made, codes = material(tmp_path, "d 0\nmap_Kd c.png\nmap_d c.png")
    np.testing.assert_array_equal(pixels(made.base_color_texture), np.asarray(image))
    assert (made.alpha_mode, made.base_color[3]) == ("MASK", 1.0)
    assert not codes


@pytest.mark.parametrize(("channel", "band"), [("r", 0), ("g", 1), ("b", 2)])
def test_imfchan_chooses_a_channel(tmp_path: Path, channel: str, band: int) -> None:
    image = noise("RGB")
    save(tmp_path / "m.png", image)
    made, _ = material(tmp_path, f"map_d -imfchan {channel} m.png")
    np.testing.assert_array_equal(pixels(made.base_color_texture)[..., 3], np.asarray(image)[..., band])


def test_black_diffuse_does_not_hide_the_texture(tmp_path: Path) -> None:
    save(tmp_path / "c.png", noise("RGB"))
    made, codes = material(tmp_path, "Kd 0 0 0\nmap_Kd c.png")
    assert made.base_color == (1, 1, 1, 1)
    assert codes == ["mtl.black-texture"]
    made, _ = material(tmp_path, "Kd 0.5 0.5 0.5\nmap_Kd c.png")
    assert made.base_color == (0.5, 0.5, 0.5, 1)


def test_roughness_and_metal_share_an_image(tmp_path: Path) -> None:
    rough, metal = noise("L", seed=1), noise("L", (16, 12), seed=2)
    save(tmp_path / "r.png", rough)
    save(tmp_path / "m.png", metal)
    made, codes = material(tmp_path, "Pr 0.2\nPm 0.1\nmap_Pr r.png\nmap_Pm m.png")
    merged = pixels(made.metallic_roughness_texture)
    assert merged.shape == (12, 16, 3)
    np.testing.assert_array_equal(merged[..., 1], np.asarray(rough.resize((16, 12), Image.Resampling.BILINEAR)))
    np.testing.assert_array_equal(merged[..., 2], np.asarray(metal))
    assert (made.roughness, made.metallic) == (1.0, 1.0)
    assert not codes


def test_one_of_roughness_and_metal(tmp_path: Path) -> None:
    rough = noise("L")
    save(tmp_path / "r.png", rough)
    made, _ = material(tmp_path, "Pr 0.2\nPm 0.1\nmap_Pr -s 4 r.png")
    merged = pixels(made.metallic_roughness_texture)
    np.testing.assert_array_equal(merged[..., 1], np.asarray(rough))
    assert (merged[..., 2] == 255).all()
    assert (made.roughness, made.metallic) == (1.0, 0.1)
    assert made.metallic_roughness_texture is not None
    assert made.metallic_roughness_texture.scale == (4, 1)
    _, codes = material(tmp_path, "map_Pr -s 4 r.png\nmap_Pm r.png")
    assert codes == ["mtl.map-options"]


def dome(size: int = 64) -> np.ndarray:
    """Unit normals of a dome, as a normal map's colours."""
    y, x = np.mgrid[1 : -1 : size * 1j, -1 : 1 : size * 1j] * 0.6
    z = np.sqrt(1 - x**2 - y**2)
    return np.round((np.stack([x, y, z], axis=2) + 1) * 127.5).astype(np.uint8)


def test_normal_maps_pass_through(tmp_path: Path) -> None:
    data = save(tmp_path / "n.png", Image.fromarray(dome()))
    for statement in ("norm -bm 0.5 n.png", "map_Bump -bm 0.5 n.png", "bump n.png -bm 0.5"):
        made, codes = material(tmp_path, statement)
        assert made.normal_texture is not None
        assert made.normal_texture.data == data
        assert made.normal_scale == 0.5
        assert not codes


def test_norm_wins_over_bump(tmp_path: Path) -> None:
    save(tmp_path / "b.png", noise("L"))
    data = save(tmp_path / "n.png", Image.fromarray(dome()))
    made, codes = material(tmp_path, "map_Bump b.png\nnorm n.png")
    assert made.normal_texture is not None
    assert made.normal_texture.data == data
    assert not codes


@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_height_maps_become_normal_maps(tmp_path: Path, mode: str) -> None:
    """A ramp that rises to the right tilts normals to the left; one that rises upwards, down."""
    ramp = np.tile(np.arange(0, 256, 4, dtype=np.uint8), (64, 1))
    for heights, axis in ((ramp, 0), (ramp.T[::-1], 1)):
        save(tmp_path / "h.png", Image.fromarray(np.ascontiguousarray(heights)).convert(mode))
        made, codes = material(tmp_path, "map_Bump -clamp on -bm 2 h.png")
        assert codes == ["texture.height"]
        assert made.normal_scale == 1.0
        vectors = pixels(made.normal_texture) / 127.5 - 1
        inner = vectors[8:-8, 8:-8]
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=2), 1, atol=0.02)
        slope = 4 / 255 * 2 * 4
        np.testing.assert_allclose(inner[..., axis] / inner[..., 2], -slope, atol=0.02)
        np.testing.assert_allclose(inner[..., 1 - axis], 0, atol=0.01)


def test_pictures_as_bump_maps_are_ignored(tmp_path: Path) -> None:
    save(tmp_path / "p.png", noise("RGB"))
    made, codes = material(tmp_path, "map_Bump p.png")
    assert made.normal_texture is None
    assert codes == ["texture.bump"]


def test_emission(tmp_path: Path) -> None:
    data = save(tmp_path / "e.png", noise("RGB"))
    made, _ = material(tmp_path, "map_Ke e.png")
    assert made.emissive_texture is not None
    assert (made.emissive_texture.data, made.emissive) == (data, (1, 1, 1))
    made, _ = material(tmp_path, "Ke 0.5 0 0\nmap_Ke e.png")
    assert made.emissive == (0.5, 0, 0)


def test_missing_texture_is_a_warning(tmp_path: Path) -> None:
    made, codes = material(tmp_path, "Kd 1 0 0\nmap_Kd none.png\nmap_d none.png\nnorm none.png\nmap_Pr none.png")
    assert made == Material("m", base_color=(1, 0, 0, 1))
    assert codes == ["texture.missing"] * 4


def test_names_as_people_write_them(tmp_path: Path) -> None:
    data = save(tmp_path / "tex" / "my color.png", noise("RGB"))
    for name in (
        "{}/my color.png",
        "{}\\my color.png",
        ".\\{}\\my color.png",
        '"{}/my color.png"',
        "{}/my\\ color.png",
    ):
        name = name.format("tex")
        made, codes = material(tmp_path, f"map_Kd {name}")
        assert made.base_color_texture is not None, name
        assert made.base_color_texture.data == data
        assert not codes
    made, codes = material(tmp_path, "map_Kd TEX/My Color.PNG")
    assert made.base_color_texture is not None
    assert codes == ["asset.letter-case"]


def test_names_are_relative_to_the_library_then_to_the_obj(tmp_path: Path) -> None:
    beside_mtl = save(tmp_path / "sub" / "a.png", noise("RGB", seed=1))
    beside_obj = save(tmp_path / "b.png", noise("RGB", seed=2))
    (tmp_path / "sub" / "m.mtl").write_text(
        "newmtl m\nmap_Kd a.png\nnewmtl n\nmap_Kd b.png\nnewmtl o\nmap_Kd ../b.png\n"
    )
    made, warnings = load_materials(tmp_path / "a.obj", [Library("sub/m.mtl", 1)], ["m", "n", "o"])
    found = [m.base_color_texture.data for m in made if m.base_color_texture is not None]
    assert found == [beside_mtl, beside_obj, beside_obj]
    assert not warnings


OUTSIDE = (
    "../c.png",
    "..\\c.png",
    "x/../../c.png",
    "/etc/c.png",
    "C:\\c.png",
    "c:c.png",
    "//server/c.png",
    "\\\\server\\c.png",
    "http://server/c.png",
    "file:c.png",
    "~/c.png",
)


@pytest.mark.parametrize("name", OUTSIDE)
def test_textures_outside_the_folder_are_refused(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "inner"
    save(tmp_path / "c.png", noise("RGB"))
    folder.mkdir()
    with pytest.raises(GarmentcError) as caught:
        material(folder, f"Kd 1 1 1\nmap_Kd {name}")
    assert (caught.value.file, caught.value.line) == (folder / "a.mtl", 3)
    assert "outside the OBJ's folder" in caught.value.message
    assert "--allow-external-textures" in caught.value.message


def test_links_out_of_the_folder_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "inner"
    data = save(tmp_path / "c.png", noise("RGB"))
    folder.mkdir()
    (folder / "link.png").symlink_to("../c.png")
    (folder / "up").symlink_to("..")
    for name in ("link.png", "up/c.png", "LINK.png"):
        with pytest.raises(GarmentcError, match="outside the OBJ's folder"):
            material(folder, f"map_Kd {name}")
        made, _ = material(folder, f"map_Kd {name}", external=True)
        assert made.base_color_texture is not None
        assert made.base_color_texture.data == data


def test_links_within_the_folder_are_fine(tmp_path: Path) -> None:
    data = save(tmp_path / "real.png", noise("RGB"))
    (tmp_path / "link.png").symlink_to("real.png")
    made, codes = material(tmp_path, "map_Kd link.png")
    assert made.base_color_texture is not None
    assert made.base_color_texture.data == data
    assert not codes


def test_the_folder_of_a_linked_obj_counts(tmp_path: Path) -> None:
    """Build systems lay out their inputs as links into a store."""
    store, work = tmp_path / "store", tmp_path / "work"
    data = save(store / "c.png", noise("RGB"))
    work.mkdir()
    (store / "a.mtl").write_text("newmtl m\nmap_Kd c.png\n")
    (store / "a.obj").write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n")
    for name in ("a.obj", "a.mtl", "c.png"):
        (work / name).symlink_to(store / name)
    texture = read_obj(work / "a.obj").materials[0].base_color_texture
    assert texture is not None
    assert texture.data == data


def test_external_textures_may_be_allowed(tmp_path: Path) -> None:
    folder = tmp_path / "inner"
    data = save(tmp_path / "c.png", noise("RGB"))
    folder.mkdir()
    for name in ("../c.png", str(tmp_path / "c.png")):
        made, codes = material(folder, f"map_Kd {name}", external=True)
        assert made.base_color_texture is not None
        assert made.base_color_texture.data == data
        assert not codes


def test_moved_textures_are_found_beside_the_obj_when_allowed(tmp_path: Path) -> None:
    data = save(tmp_path / "c.png", noise("RGB"))
    with pytest.raises(GarmentcError, match=r"change it to 'c\.png', which lies there"):
        material(tmp_path, "map_Kd D:\\work\\textures\\c.png")
    made, codes = material(tmp_path, "map_Kd D:\\work\\textures\\c.png", external=True)
    assert made.base_color_texture is not None
    assert made.base_color_texture.data == data
    assert codes == ["asset.moved"]


def png_chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def bomb() -> bytes:
    """A PNG of 200,000 x 200,000 pixels in a few bytes."""
    header = struct.pack(">IIBBBBB", 200_000, 200_000, 8, 2, 0, 0, 0)
    pixels = zlib.compress(bytes(1000))
    return b"\x89PNG\r\n\x1a\n" + png_chunk(b"IHDR", header) + png_chunk(b"IDAT", pixels) + png_chunk(b"IEND", b"")


def damaged(kind: str) -> bytes:
    buffer = io.BytesIO()
    noise("RGB", (64, 64)).save(buffer, kind)
    return buffer.getvalue()


DAMAGED = {
    "empty": b"",
    "text": b"not an image at all",
    "html": b"<html>404</html>",
    "cut PNG": damaged("PNG")[:2000],
    "cut JPEG": damaged("JPEG")[:1500],
    "cut TGA": damaged("TGA")[:1000],
    "flipped bits": damaged("PNG")[:3000] + b"\xff" * 8 + damaged("PNG")[3008:],
    "PNG header only": damaged("PNG")[:30],
    "bomb": bomb(),
    "postscript": b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\n%%EndComments\nshowpage\n",
}


@pytest.mark.parametrize("kind", DAMAGED)
def test_damaged_images_are_refused_by_name(tmp_path: Path, kind: str) -> None:
    (tmp_path / "c.png").write_bytes(DAMAGED[kind])
    for statement in ("map_Kd c.png", "map_d c.png", "map_Bump c.png"):
        with pytest.raises(GarmentcError, match="texture") as caught:
            material(tmp_path, statement)
        assert caught.value.file == tmp_path / "c.png"
        assert "\n" not in str(caught.value)


def test_random_damage_raises_nothing_else(tmp_path: Path) -> None:
    """Whatever happens to the bytes: a material or a GarmentcError."""
    rng = np.random.default_rng(0)
    files = [damaged(kind) for kind in ("PNG", "JPEG", "TGA", "BMP", "TIFF", "GIF", "WEBP")]
    for _ in range(100):
        data = bytearray(files[rng.integers(len(files))])
        for _ in range(rng.integers(1, 20)):
            data[rng.integers(len(data))] = rng.integers(256)
        (tmp_path / "c.png").write_bytes(bytes(data[: rng.integers(10, len(data) + 1)]))
        try:
            material(tmp_path, "map_Kd c.png\nmap_d c.png\nmap_Bump c.png\nmap_Pr c.png")
        except GarmentcError:
            continue
