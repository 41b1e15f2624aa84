"""`garmentc compile` of several outfits, and with the body."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from cli_samples import CommandLine, write_top

import garmentc
from garmentc.errors import GarmentcError
from garmentc.gltf.evaluate import world_mesh
from garmentc.gltf.posing import state_at_pose
from garmentc.gltf.read import read_glb
from garmentc.outfit.align import Alignment
from garmentc.outfit.align.together import common_gender
from garmentc.outfit.obj import read_obj
from garmentc.schema import check_schema
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.pose_sampler import sample_poses


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> CommandLine:
    return CommandLine(capsys)


@pytest.fixture(scope="module")
def tops(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two files of the same name in different folders."""
    folders = tmp_path_factory.mktemp("one"), tmp_path_factory.mktemp("two")
    one, two = map(write_top, folders)
    return one, two


def test_outfits_share_a_file_and_move_as_they_do_alone(
    run: CommandLine, tmp_path: Path, tops: tuple[Path, Path]
) -> None:
    both, report = tmp_path / "both.glb", tmp_path / "report.json"
    options = ["--gender", "female", "--profile", "desktop", "--morphs", 4, "--influences", 4]
    result = run("compile", *tops, *options, "-o", both, "--report", report, "--with-body")
    assert result.code == 0, result.err
    document = json.loads(report.read_text())
    check_schema(document, "report")
    assert [Path(entry["input"]["path"]) for entry in (document, *document["also"])] == list(tops)
    assert document["body"]["vertices"] == 7002
    assert "4 + 4 morph targets" in result.out
    assert run("validate", both, "--strict").code == 0
    assert run("diff", both, both).code == 0

    garmentc.compile_outfit(tops[0], tmp_path / "one.glb", gender="female", profile="desktop", morphs=4, influences=4)
    alone, together = read_glb(tmp_path / "one.glb"), read_glb(both)
    assert [together.nodes[index].name for index in together.mesh_nodes] == ["top", "top_2", "body"]
    pose = sample_poses(1, seed=8)[0]
    expected, _ = world_mesh(alone, state_at_pose(alone, pose))
    found, _ = world_mesh(together, state_at_pose(together, pose))
    np.testing.assert_allclose(found[: len(expected)], expected, atol=1e-9)
    np.testing.assert_allclose(found[len(expected) : 2 * len(expected)], expected, atol=1e-9)
    body = load_default_body("female").posed(pose, correctives=False)
    np.testing.assert_allclose(found[2 * len(expected) :], body, atol=2e-6)


def test_quantization_of_several_meshes_is_measured_in_their_common_box(
    tmp_path: Path, tops: tuple[Path, Path]
) -> None:
    alone = garmentc.compile_outfit(tops[0], tmp_path / "a.glb", gender="female", profile="mobile")
    with_body = garmentc.compile_outfit(tops[0], tmp_path / "b.glb", gender="female", profile="mobile", with_body=True)
    steps = [float(report.passes[-1].detail.split()[-2]) for report in (alone, with_body)]
    node = read_glb(tmp_path / "b.glb").skins[0].inverse_bind_matrices[0, 0, 0]
    assert steps[1] == pytest.approx(1000 * node / 32767, abs=1e-3)
    assert steps[1] > 1.5 * steps[0]
    assert [step.name for step in alone.passes] == [step.name for step in with_body.passes]


def test_options_for_one_outfit_are_refused_for_several(
    run: CommandLine, tmp_path: Path, tops: tuple[Path, Path]
) -> None:
    output = ["-o", tmp_path / "a.glb"]
    assert "--name is for one outfit, and 2 are given" in run.fails("compile", *tops, *output, "--name", "x")
    assert "--keys-onnx is for one" in run.fails("compile", *tops, *output, "--keys-onnx", tmp_path / "k.onnx")
    assert "cannot be written too" in run.fails("compile", *tops, "-o", tops[1])
    with pytest.raises(GarmentcError, match="no outfit is given"):
        garmentc.compile_outfit([], tmp_path / "a.glb")


def aligned(path: Path, gender: str, **misfits: float) -> Alignment:
    """An alignment as far as the choice of a common body looks at it."""
    return Alignment(
        outfit=read_obj(path),
        body=load_default_body(gender),
        misfits=misfits,
        **dict.fromkeys(("frame", "betas", "rest_pose", "pose", "arms", "unpose_weights", "fit")),
    )


def test_an_outfit_that_fits_every_body_yields(tops: tuple[Path, Path]) -> None:
    suit = aligned(tops[0], "male", female=0.035, male=0.018, neutral=0.026)
    hat = aligned(tops[1], "neutral", female=0.032, male=0.0195, neutral=0.019)
    gender, [warning] = common_gender([hat, suit])
    assert gender == "male"
    assert warning.code == "gender-shared"
    assert common_gender([suit, suit]) == ("male", ())


def test_outfits_for_different_bodies_are_refused(tops: tuple[Path, Path]) -> None:
    suit = aligned(tops[0], "male", female=0.035, male=0.018, neutral=0.026)
    dress = aligned(tops[1], "female", female=0.007, male=0.04, neutral=0.02)
    with pytest.raises(GarmentcError, match=r"top.obj the male one, top.obj the female one\); choose .* --gender"):
        common_gender([suit, dress])


def test_artists_garments_together(tmp_path: Path, shared: Path) -> None:
    folder = shared / "data" / "garments" / "makehuman"
    suit, hat = folder / "male_casualsuit04.obj", folder / "fedora.obj"
    with pytest.raises(GarmentcError, match="--gender"):
        garmentc.compile_outfit([suit, folder / "female_casualsuit01.obj"], tmp_path / "a.glb")
    report = garmentc.compile_outfit([suit, hat], tmp_path / "a.glb", gender="male", with_body=True)
    assert [layer.input.path for layer in report.also] == [str(hat)]
