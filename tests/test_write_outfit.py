"""Generated outfits as OBJ files: quads, panels, and the committed examples."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from garmentc.errors import GarmentcError
from garmentc.evaluation.clean_frames import clean_frames
from garmentc.outfit.obj import read_obj
from garmentc.simulation.outfits import GeneratedOutfit, generate_outfit, sample_parameters
from garmentc.simulation.panels import lay_flat
from garmentc.simulation.quads import pair_triangles, polygon_corners
from garmentc.simulation.write_outfit import Fabric, write_obj
from garmentc.smpl import load_body
from garmentc.smpl.read_motion import read_motion

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
MOTION = EXAMPLES / "motions" / "step_turn_raise.npz"


@pytest.fixture(scope="module")
def outfit() -> GeneratedOutfit:
    parameters = sample_parameters(55)  # a top tucked into shorts, in rows
    return generate_outfit(replace(parameters, vertex_count=1500), load_body(None, parameters.gender))


def test_quads_hold_the_same_triangles(outfit: GeneratedOutfit):
    partner = pair_triangles(outfit.vertices, outfit.triangles, outfit.triangle_part)
    paired = np.nonzero(partner >= 0)[0]
    assert len(paired) > 0.6 * len(partner)
    assert (partner[partner[paired]] == paired).all()
    fans = []
    for polygon in polygon_corners(outfit.triangles, partner):
        corners = [int(outfit.triangles[corner]) for corner in polygon]
        assert len({int(outfit.triangle_part[t]) for t, _ in polygon}) == 1
        fans += [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]

    def canonical(triangles: object) -> set[tuple[int, ...]]:
        return {min((a, b, c), (b, c, a), (c, a, b)) for a, b, c in np.array(triangles).tolist()}

    assert canonical(fans) == canonical(outfit.triangles)


def test_panels_are_flat_cloth_of_the_right_size(outfit: GeneratedOutfit):
    partner = pair_triangles(outfit.vertices, outfit.triangles, outfit.triangle_part)
    panels = lay_flat(outfit.vertices, outfit.triangles, outfit.triangle_part, partner)
    assert panels.panel.max() + 1 == 2 * len(outfit.part_names)
    flat, solid = panels.texcoords[panels.corners], outfit.vertices[outfit.triangles]
    one, two = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    assert (one[:, 0] * two[:, 1] > one[:, 1] * two[:, 0]).all()  # nothing is turned over
    stretch = np.linalg.norm(flat - np.roll(flat, 1, 1), axis=2) / np.linalg.norm(solid - np.roll(solid, 1, 1), axis=2)
    assert np.quantile(stretch, 0.02) > 0.85
    assert np.quantile(stretch, 0.98) < 1.15
    for panel in range(panels.panel.max()):
        left, right = flat[panels.panel == panel], flat[panels.panel == panel + 1]
        assert left[..., 0].max() < right[..., 0].min()


def test_an_obj_that_cannot_be_written_whole_leaves_the_former_one(outfit: GeneratedOutfit, tmp_path: Path):
    (tmp_path / "a.obj").write_text("former")
    (tmp_path / "a.mtl").mkdir()
    with pytest.raises(GarmentcError, match="cannot be written: it is a folder"):
        write_obj(outfit, tmp_path / "a.obj")
    assert (tmp_path / "a.obj").read_text() == "former"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mtl", "a.obj"]


@pytest.mark.parametrize("texcoords", [True, False])
def test_obj_reads_back_as_it_was_made(outfit: GeneratedOutfit, tmp_path: Path, texcoords: bool):
    fabrics = (Fabric("cotton", (0.5, 0.25, 0.125), roughness=0.75, tile=0.2), Fabric("silk", metallic=0.25))
    write_obj(outfit, tmp_path / "a.obj", fabrics, texcoords=texcoords, comments=["a comment"])
    read = read_obj(tmp_path / "a.obj")
    assert read.warnings == ()
    assert np.abs(read.vertices - outfit.vertices).max() <= 0.5e-5 + 1e-12
    assert len(read.tri_v) == len(outfit.triangles)
    assert read.has_texcoords == texcoords
    assert [m.name for m in read.materials] == ["cotton", "silk"]
    assert read.materials[0].base_color[:3] == pytest.approx((0.5, 0.25, 0.125))
    assert read.materials[0].roughness == pytest.approx(0.75)
    assert read.materials[1].metallic == pytest.approx(0.25)
    # An independent reader sees the same surface.
    other = trimesh.load(tmp_path / "a.obj", process=False, force="mesh")
    assert other.area == pytest.approx(trimesh.Trimesh(outfit.vertices, outfit.triangles).area, rel=1e-2)


@pytest.mark.parametrize(("name", "gender"), [("tee_and_skirt", "female"), ("tee_and_trousers", "male")])
def test_example_garments_fit_the_default_body(name: str, gender: str):
    path = EXAMPLES / f"{name}.obj"
    assert path.stat().st_size < 400_000
    outfit = read_obj(path)
    assert outfit.warnings == ()
    assert len(outfit.materials) == 2
    assert (np.bincount(outfit.tri_face) == 2).mean() > 0.6  # quads
    body = load_body(None, gender)
    assert body_clearance(outfit.vertices, body.shaped(), body.faces).min() > 0.00145


def body_clearance(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    import igl

    return np.asarray(igl.signed_distance(points, vertices, faces.astype(np.int64))[0])


def test_example_textures_tile_and_are_wired_up():
    outfit = read_obj(EXAMPLES / "tee_and_skirt.obj")
    assert outfit.has_texcoords
    assert all(material.base_color_texture is not None for material in outfit.materials)
    assert [material.normal_texture is not None for material in outfit.materials] == [False, True]
    from PIL import Image

    for name in ("jersey.png", "twill.png", "twill_normal.png"):
        image = np.asarray(Image.open(EXAMPLES / name), dtype=float)
        inside = (
            np.abs(np.diff(image, axis=0)).mean(axis=(1, 2)).max(),
            np.abs(np.diff(image, axis=1)).mean((0, 2)).max(),
        )
        across = np.abs(image[0] - image[-1]).mean(), np.abs(image[:, 0] - image[:, -1]).mean()
        assert across[0] <= inside[0] * 1.05
        assert across[1] <= inside[1] * 1.05


def test_example_motion_is_smooth_clean_and_on_the_floor():
    motion = read_motion(MOTION)
    assert motion.poses.shape == (120, 24, 3)
    assert motion.fps == 30
    assert motion.warnings == ()
    assert np.degrees(np.abs(np.diff(motion.poses, axis=0)).max()) < 12
    body = load_body(None, "female")
    posed = body.posed(motion.poses[::8], translation=motion.trans[::8])
    assert np.abs(posed[..., 1].min(1)).max() < 0.005
    assert clean_frames(body, None, posed).all()
