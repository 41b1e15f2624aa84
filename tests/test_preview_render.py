"""The renderer of previews: against brute force in float64, closed forms and scipy."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as PillowImage
from scipy.ndimage import map_coordinates

from garmentc.errors import GarmentcError
from garmentc.gltf.glb_asset import Image
from garmentc.preview.camera import Camera, around, looking, view_axes
from garmentc.preview.light import lamp, sky_light
from garmentc.preview.material import Material
from garmentc.preview.raster import Fragments, depth_range, visible
from garmentc.preview.render import light_scene, render
from garmentc.preview.shading import bumped
from garmentc.preview.surface import Scene, Surface
from garmentc.preview.texture import CLAMP_TO_EDGE, MIRRORED_REPEAT, REPEAT, Texture, decode, srgb_to_linear

FACING = view_axes(heading=0.0, turn=0.0, pitch=0.0)
SQUARE = np.array([[0, 1, 2], [0, 2, 3]])


def square(half: float, height: float = 0.0) -> np.ndarray:
    """A level square around the origin, its corners counter-clockwise from above."""
    return np.array([[-half, height, half], [half, height, half], [half, height, -half], [-half, height, -half]])


def upright(material: Material, texcoords: np.ndarray | None = None) -> Surface:
    """A square metre that faces +Z."""
    points = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]], dtype=float)
    normals = np.tile([0.0, 0.0, 1.0], (4, 1))
    return Surface(points, normals, SQUARE, material, texcoords)


def picture(surface: Surface, turn: float = 0.0) -> np.ndarray:
    camera = Camera(view_axes(0.0, np.radians(turn), 0.0), np.zeros(3), 40.0, (60, 60))
    return render(light_scene(Scene((surface,))), camera)


@pytest.fixture
def soup() -> tuple[np.ndarray, np.ndarray]:
    """Random triangles, small and large, some of them out of the picture."""
    rng = np.random.default_rng(4)
    middles = rng.uniform(-5, [45, 35, 10], (90, 1, 3))
    return (middles + rng.normal(0, rng.choice([1.0, 9.0], (90, 1, 1)), (90, 3, 3))).reshape(-1, 3), np.arange(
        270
    ).reshape(-1, 3)


def hits(points: np.ndarray, triangles: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """(pixels, triangles): the depth at which the pixel's centre meets each triangle, NaN where it does not."""
    y, x = np.divmod(np.arange(size[0] * size[1]), size[0])
    a, b, c = (points[triangles[:, k]][None] for k in range(3))
    at = np.stack([x, y], axis=1)[:, None] + 0.5

    def cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]

    area = cross((b - a)[..., :2], (c - a)[..., :2])
    second = cross(at - a[..., :2], (c - a)[..., :2]) / area
    third = cross((b - a)[..., :2], at - a[..., :2]) / area
    depth = a[..., 2] + second * (b - a)[..., 2] + third * (c - a)[..., 2]
    return np.where((second >= 0) & (third >= 0) & (second + third <= 1), depth, np.nan)


def test_every_pixel_shows_the_nearest_triangle(soup: tuple[np.ndarray, np.ndarray]) -> None:
    size = (40, 30)
    expected = hits(*soup, size)
    covered = ~np.isnan(expected).all(axis=1)
    fragments = visible(*soup, size)
    assert covered.sum() > 400
    assert len(fragments.pixel) == len(set(fragments.pixel.tolist()))
    np.testing.assert_array_equal(np.sort(fragments.pixel), np.flatnonzero(covered))
    nearest = np.nanargmin(expected[fragments.pixel], axis=1)
    np.testing.assert_array_equal(fragments.triangle, nearest)
    np.testing.assert_allclose(fragments.depth, np.nanmin(expected[fragments.pixel], axis=1), atol=1e-4)
    places = fragments.interpolate(soup[0], soup[1])
    row, column = np.divmod(fragments.pixel, size[0])
    np.testing.assert_allclose(places[:, :2], np.stack([column, row], axis=1) + 0.5, atol=1e-4)


def test_depth_maps_hold_the_nearest_and_the_farthest_surface(soup: tuple[np.ndarray, np.ndarray]) -> None:
    size = (40, 30)
    expected = hits(*soup, size)
    near, far = depth_range(*soup, size)
    np.testing.assert_allclose(near.ravel(), np.nanmin(expected, axis=1, initial=np.inf), atol=1e-4)
    np.testing.assert_allclose(far.ravel(), np.nanmax(expected, axis=1, initial=-np.inf), atol=1e-4)


def test_fragments_that_are_not_kept_show_what_lies_behind(soup: tuple[np.ndarray, np.ndarray]) -> None:
    def odd(fragments: Fragments) -> np.ndarray:
        return fragments.triangle % 2 == 1

    fragments = visible(*soup, (40, 30), odd)
    expected = hits(soup[0], soup[1][1::2], (40, 30))
    np.testing.assert_array_equal(fragments.triangle, 2 * np.nanargmin(expected[fragments.pixel], axis=1) + 1)


def test_what_cannot_be_seen_has_no_fragments() -> None:
    points = np.array([[0, 0, 0], [4, 4, 0], [2, 2, 0], [-9, -9, 0], [-8, -9, 0], [-9, -8, 0]], dtype=float)
    assert not len(visible(points, np.array([[0, 1, 2], [3, 4, 5]]), (8, 8)).pixel)


def test_views_go_around_the_body() -> None:
    ahead = np.array([np.sin(0.7), 0, np.cos(0.7)])
    for turn, seen_along in ((0, -ahead), (np.pi, ahead)):
        np.testing.assert_allclose(view_axes(0.7, turn, 0.0)[2], seen_along, atol=1e-12)
    # From the left of a body that faces +Z stands the camera at +X; its right is the body's back.
    np.testing.assert_allclose(view_axes(0.0, np.pi / 2, 0.0), [[0, 0, -1], [0, -1, 0], [-1, 0, 0]], atol=1e-12)
    for axes in (view_axes(1.0, 2.0, 0.3), looking(np.array([0.0, -1.0, 0.0]))):
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1)


def test_a_view_around_points_shows_them_all() -> None:
    points = np.random.default_rng(1).normal(size=(50, 3))
    seen = around(points, looking(np.array([1.0, -2.0, 0.5])), 100).project(points)[:, :2]
    assert ((seen > 0) & (seen < 100)).all()


def test_an_open_place_gets_all_light_and_a_covered_one_little() -> None:
    ground, roof = square(3.0), square(3.0, 0.2)
    positions = np.concatenate([ground, roof])
    triangles = np.concatenate([SQUARE, SQUARE + 4])
    middle, up = np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]])
    assert sky_light(ground, SQUARE, middle, up)[0, 0] == pytest.approx(1, abs=1e-6)
    assert sky_light(positions, triangles, middle, up)[0, 0] < 0.1
    assert sky_light(positions, triangles, square(1e-9, 0.2)[:1], up)[0, 0] == pytest.approx(1, abs=0.02)


def test_the_back_of_a_sheet_gets_the_light_from_below() -> None:
    light = sky_light(square(1.0), SQUARE, np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]))[0]
    # Brightness 3/4 + y/4: over the upper half the mean of (3 + y) y is 3/2 + 1/3, over the lower one 3/2 - 1/3.
    assert light[1] / light[0] == pytest.approx((3 / 2 - 1 / 3) / (3 / 2 + 1 / 3), rel=0.02)


def test_a_half_covered_sky_gives_half_the_light() -> None:
    wall = np.array([[0.0, 0, -9], [0.0, 0, 9], [0, 9, 9], [0, 9, -9]])
    light = sky_light(wall, SQUARE, np.array([[0.1, 0, 0]]), np.array([[0.0, 1.0, 0.0]]))
    assert light[0, 0] == pytest.approx(0.5, abs=0.06)


def test_the_lamp_throws_a_soft_shadow() -> None:
    positions = np.concatenate([square(2.0), square(0.3, 0.5)])
    shining = lamp(positions, np.concatenate([SQUARE, SQUARE + 4]), np.array([0.0, 1.0, 0.0]))
    places = np.array([[0.0, 0, 0], [0.28, 0, 0], [0.3, 0, 0], [0.32, 0, 0], [1, 0, 0]])
    share = shining.reaches(places, np.tile([0.0, 1.0, 0.0], (5, 1)))
    np.testing.assert_allclose(share, [0, 0, 0.5, 1, 1], atol=0.26)
    assert share[0] == 0
    assert share[4] == 1


@pytest.mark.parametrize(
    ("mode", "name"), [(REPEAT, "grid-wrap"), (CLAMP_TO_EDGE, "nearest"), (MIRRORED_REPEAT, "reflect")]
)
def test_textures_are_sampled_as_scipy_does(mode: int, name: str) -> None:
    rng = np.random.default_rng(2)
    image = rng.random((7, 5, 4)).astype(np.float32)
    uv = rng.uniform(-2, 3, (200, 2))
    found = Texture((image,), (mode, mode)).sample(uv, np.zeros(200))
    at = np.stack([uv[:, 1] * 7 - 0.5, uv[:, 0] * 5 - 0.5])
    for channel in range(4):
        expected = map_coordinates(image[..., channel].astype(float), at, order=1, mode=name)
        np.testing.assert_allclose(found[:, channel], expected, atol=1e-4)


def test_texture_transforms_follow_the_extension() -> None:
    """KHR_texture_transform: translation * rotation * scale, the rotation counter-clockwise in the image."""
    texture = Texture((np.zeros((1, 1, 4), np.float32),), offset=(0.1, 0.2), rotation=np.pi / 2, scale=(2.0, 3.0))
    np.testing.assert_allclose(
        texture.placed(np.array([[1.0, 0.0], [0.0, 1.0]])), [[0.1, -1.8], [3.1, 0.2]], atol=1e-12
    )


def test_distant_textures_are_averaged() -> None:
    checks = (np.indices((64, 64)).sum(axis=0) % 2).astype(np.uint8)[..., None] * np.full(3, 255, np.uint8)
    data = io.BytesIO()
    PillowImage.fromarray(checks).save(data, format="PNG")
    levels = decode(Image("checks", "image/png", data.getvalue()), Path("a.glb"), is_color=True)
    assert [level.shape[0] for level in levels] == [64, 32, 16, 8, 4, 2, 1]
    found = Texture(levels).sample(np.array([[0.3, 0.7]]), np.array([(4 / 64) ** 2]))  # a pixel spans 4 x 4 texels
    np.testing.assert_allclose(found[0, :3], 0.5, atol=1e-6)  # half of the light, not of the sRGB value


def test_damaged_images_are_named() -> None:
    with pytest.raises(GarmentcError, match="image 'weave' that cannot be read"):
        decode(Image("weave", "image/png", b"\x89PNG\r\n\x1a\nbroken"), Path("a.glb"), is_color=True)


@pytest.mark.parametrize(("u", "v"), [((1, 0), (0, -1)), ((-1, 0), (0, -1)), ((0, 1), (1, 0))])
@pytest.mark.parametrize("bend", [(0.6, 0.0, 0.8), (0.0, 0.6, 0.8)])
def test_normal_maps_bend_along_the_texture(u: tuple[int, int], v: tuple[int, int], bend: tuple[float, ...]) -> None:
    """x of a normal map goes where u grows, y where v falls, wherever the texture lies on the surface."""
    axes = np.array([u, v], dtype=float)  # where u and v grow, in the plane of the square
    surface = upright(Material())
    surface = upright(Material(), surface.positions[:, :2] @ np.linalg.inv(axes))
    fragments = Fragments(
        np.array([0]), np.array([0]), np.array([[0.2, 0.3, 0.5]], np.float32), np.zeros(1, np.float32)
    )
    color = (np.array([bend], dtype=np.float32) + 1) / 2
    found = bumped(surface, fragments, np.array([[0.0, 0.0, 1.0]]), color, 1.0)
    plane = bend[0] * axes[0] - bend[1] * axes[1]
    np.testing.assert_allclose(found[0], [*plane, bend[2]], atol=1e-6)


def test_brighter_materials_give_brighter_pictures_and_the_background_stays() -> None:
    grey, white = (picture(upright(Material((value, value, value, 1.0)))) for value in (0.2, 0.7))
    assert (white[20:40, 20:40] > grey[20:40, 20:40].astype(int) + 40).all()
    np.testing.assert_array_equal(white[0], grey[0])
    assert grey[0].min() > 225


def test_textures_keep_left_right_up_and_down() -> None:
    image = np.zeros((2, 2, 4), np.float32)
    image[0, 0], image[0, 1], image[1, 0], image[1, 1] = (1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1), (1, 1, 1, 1)
    texcoords = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=float)  # v points down
    material = Material(base_color_texture=Texture((image,), (CLAMP_TO_EDGE, CLAMP_TO_EDGE)))
    front = picture(upright(material, texcoords))
    assert [int(front[row, column].argmax()) for row, column in ((13, 13), (13, 46), (46, 13))] == [0, 1, 2]
    back = picture(upright(material, texcoords), turn=180)
    assert [int(back[row, column].argmax()) for row, column in ((13, 46), (13, 13), (46, 46))] == [0, 1, 2]


@pytest.mark.parametrize("mode", ["MASK", "BLEND"])
def test_transparent_texels_are_holes(mode: str) -> None:
    image = np.ones((1, 2, 4), np.float32)
    image[0, 0, 3] = 0.0
    texture = Texture((image,), (CLAMP_TO_EDGE, CLAMP_TO_EDGE))
    texcoords = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=float)
    shown = picture(upright(Material((0.1, 0.1, 0.1, 1.0), alpha_mode=mode, base_color_texture=texture), texcoords))
    np.testing.assert_array_equal(shown[30, 14], shown[0, 0])
    assert (shown[30, 46] < 130).all()


def test_half_transparent_cloth_mixes_with_what_is_behind() -> None:
    black = picture(upright(Material((0.0, 0.0, 0.0, 0.5), alpha_mode="BLEND")))[30, 30].astype(int)
    background = picture(upright(Material()))[0, 0]
    half = srgb_to_linear(black / 255) / srgb_to_linear(background / 255)
    np.testing.assert_allclose(half, 0.5, atol=0.12)
