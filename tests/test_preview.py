"""garmentc preview: sheets and pages of a small outfit, from the command line."""

from __future__ import annotations

import base64
import json
import os
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import engine_runs
import numpy as np
import pytest
from cli_samples import CommandLine, write_top
from PIL import Image

import garmentc
from garmentc.gltf.glb_asset import GlbAsset
from garmentc.gltf.posing import smpl_joints, state_at_pose, state_at_time
from garmentc.gltf.read import read_glb
from garmentc.preview.moments import body_pose, choose_moments
from garmentc.preview.penetration import DEEPEST_MM, depth_colors, penetration
from garmentc.preview.poses import telling_poses
from garmentc.preview.worn import prepare
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.skeleton import JOINT_NAMES

MOTION = Path(__file__).parents[1] / "examples" / "motions" / "step_turn_raise.npz"


@pytest.fixture(scope="module")
def top(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A compiled outfit without an animation."""
    folder = tmp_path_factory.mktemp("preview")
    garmentc.compile_outfit(write_top(folder), folder / "top.glb", gender="female", morphs=4)
    return folder / "top.glb"


@pytest.fixture(scope="module")
def moving(top: Path) -> Path:
    """The same with an animation."""
    out = top.with_name("moving.glb")
    garmentc.compile_outfit(top.with_suffix(".obj"), out, gender="female", morphs=4, motion=MOTION)
    return out


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> CommandLine:
    return CommandLine(capsys)


def sheet(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path)).astype(int)


def test_a_sheet_shows_frames_side_by_side_and_views_below(run: CommandLine, moving: Path, tmp_path: Path) -> None:
    out = tmp_path / "sheet.png"
    result = run("preview", moving, "-o", out, "--frames", 2, "--views", "front,back", "--size", 96)
    assert result.code == 0, result.err
    shown = sheet(out)
    assert result.out.strip() == f"{out}: {shown.shape[1]} x {shown.shape[0]} pixels"
    assert shown.shape[0] >= 2 * 96
    wide = shown.shape[1] // 2
    inked = (np.abs(shown - shown[-1, 0]) > 40).any(axis=2)
    for column in (slice(0, wide), slice(wide, None)):
        for row in (slice(-192, -96), slice(-96, None)):
            assert inked[row, column].mean() > 0.05  # somebody stands in every picture
    assert not (shown[-192:, :wide] == shown[-192:, wide:]).all()


def test_equal_sheets_are_equal_bytes(run: CommandLine, top: Path, tmp_path: Path) -> None:
    for name in ("a.png", "b.png"):
        assert run("preview", top, "-o", tmp_path / name, "--frames", 1, "--views", "quarter", "--size", 64).code == 0
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_the_body_can_be_left_out(run: CommandLine, top: Path, tmp_path: Path) -> None:
    shares = []
    for number, options in enumerate(([], ["--no-body"])):
        out = tmp_path / f"{number}.png"
        assert run("preview", top, "-o", out, "--frames", 1, "--views", "front", "--size", 96, *options).code == 0
        shown = sheet(out)[-96:]
        shares.append(float((np.abs(shown - shown[-1, 0]) > 40).any(axis=2).mean()))
    assert shares[0] > 0
    assert shares[1] > shares[0]  # a trunk alone fills the picture more than somebody with arms and legs


def test_collisions_colour_what_lies_inside(top: Path) -> None:
    asset = read_glb(top)
    body = load_default_body("female")
    worn = prepare(asset, body, None)
    state = state_at_pose(asset, np.zeros((24, 3)))
    cloth, skin = worn.outfit(state), worn.skin(state)
    assert skin is not None
    assert penetration(cloth, skin).share == 0
    sunk = tuple(
        type(surface)(surface.positions - 0.02 * surface.normals, surface.normals, surface.triangles, surface.material)
        for surface in cloth
    )
    found = penetration(sunk, skin)
    assert found.share > 0.9  # it was 15 mm outside
    assert 3 < found.deepest_mm < 8
    plain, deep = depth_colors(np.array([0.0, DEEPEST_MM]))
    colors = np.concatenate([surface.colors for surface in found.cloth if surface.colors is not None])
    assert (np.abs(colors - plain).max(axis=1) > 0.05).mean() > 0.9
    assert deep.sum() < plain.sum() / 4


def test_a_sheet_of_collisions_has_a_legend(run: CommandLine, top: Path, tmp_path: Path) -> None:
    heights = []
    for number, options in enumerate(([], ["--collisions"])):
        out = tmp_path / f"{number}.png"
        assert run("preview", top, "-o", out, "--frames", 1, "--views", "front", "--size", 96, *options).code == 0
        heights.append(sheet(out).shape[0])
    assert heights[1] > heights[0]


def test_frames_are_spread_over_the_animation(moving: Path) -> None:
    asset = read_glb(moving)
    duration = asset.animations[0].duration
    moments = choose_moments(asset, 4, asset.animations[0].name)
    for number, moment in enumerate(moments):
        expected = state_at_time(asset, (number + 0.5) / 4 * duration)
        np.testing.assert_array_equal(moment.state.rotation, expected.rotation)
        assert moment.label == f"{(number + 0.5) / 4 * duration:.2f} s"


def test_without_an_animation_telling_poses_go_through_the_network(top: Path) -> None:
    asset = read_glb(top)
    moments = choose_moments(asset, 4)
    assert [moment.label for moment in moments] == ["arms up", "step", "sit", "twist"]
    for moment, pose in zip(moments, telling_poses().values(), strict=False):
        np.testing.assert_allclose(body_pose(asset, moment.state)[0], pose, atol=1e-6)
        assert np.abs(moment.state.weights[asset.outfit_nodes[0]]).max() > 1e-3


def test_telling_poses_do_what_their_names_say() -> None:
    body = load_default_body("neutral").astype(np.float64)
    joint = {name: number for number, name in enumerate(JOINT_NAMES)}
    poses = telling_poses()

    def places(name: str) -> np.ndarray:
        vertices = body.posed(poses[name])
        return np.stack([np.average(vertices, axis=0, weights=body.weights[:, k]) for k in range(24)])

    assert places("arms up")[joint["left_hand"], 1] > places("arms up")[joint["head"], 1]
    assert places("stand")[joint["left_hand"], 1] < places("stand")[joint["spine1"], 1]
    sit = places("sit")
    assert sit[joint["left_knee"], 2] > sit[joint["pelvis"], 2] + 0.2
    assert sit[joint["left_foot"], 1] < sit[joint["left_knee"], 1] - 0.2
    step = places("step")
    assert step[joint["left_foot"], 2] > step[joint["right_foot"], 2] + 0.4
    assert places("bend")[joint["head"], 2] > 0.3


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["-o", "x.gif"], "name a .png for a sheet or a .html for a page"),
        (["-o", "x.png", "--views", "front,top"], "there is no view 'top'; choose from front, side"),
        (["-o", "x.png", "--frames", "7"], "there are only 6 poses; ask for fewer"),
        (["-o", "x.png", "--animation", "walk"], "has no animation; leave out --animation"),
        (["-o", "x.png", "--collisions", "--no-body"], "collisions need the body"),
        (["-o", "x.html", "--collisions"], "--collisions is for sheets (.png); leave it out for a page"),
        (["-o", "x.html", "--views", "front,side,back"], "--views is for sheets"),
        (["-o", "no/such/x.png"], "its folder does not exist"),
    ],
)
def test_mistakes_end_in_one_line(
    run: CommandLine, top: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert said in run.fails("preview", top, *options)
    assert not list(tmp_path.iterdir())


def test_an_unknown_animation_is_named(run: CommandLine, moving: Path, tmp_path: Path) -> None:
    assert "it has step_turn_raise" in run.fails("preview", moving, "-o", tmp_path / "x.png", "--animation", "walk")


def test_an_outfit_that_names_no_body_is_drawn_alone(run: CommandLine, top: Path, tmp_path: Path) -> None:
    nameless, out = tmp_path / "nameless.glb", tmp_path / "sheet.png"
    nameless.write_bytes(top.read_bytes().replace(b'"gender":', b'"GENDER":'))
    result = run("preview", nameless, "-o", out, "--frames", 1, "--views", "front", "--size", 48)
    assert result.code == 0, result.err
    assert "does not say for which body it was made, so none is drawn; give --gender" in result.err
    assert "collisions need the body" in run("preview", nameless, "-o", out, "--collisions").error_lines[0]


@pytest.fixture(scope="module")
def page(moving: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    from garmentc.cli import main

    out = tmp_path_factory.mktemp("page") / "page.html"
    assert main(["preview", str(moving), "-o", str(out), "-q"]) == 0
    return out


def embedded(page: Path, name: str) -> str:
    found = re.search(rf'<script type="[^"]+" id="{name}">(.*?)</script>', page.read_text(encoding="utf-8"), re.DOTALL)
    assert found is not None
    return found[1]


def test_a_page_holds_everything(page: Path, moving: Path) -> None:
    assert base64.b64decode(embedded(page, "asset")) == moving.read_bytes()
    content = json.loads(embedded(page, "content"))
    asset = read_glb(moving)
    assert content["joints"] == smpl_joints(asset)
    assert {"rest", *telling_poses()} == set(content["poses"])
    assert content["weights"] == [0, 1]
    text = page.read_text(encoding="utf-8")
    assert not re.search(r"""(?:src|href)\s*=\s*["'](?!data:)""", text)
    assert "default-src 'none'" in text
    imports = json.loads(re.search(r'<script type="importmap">(.*?)</script>', text, re.DOTALL)[1])["imports"]  # type: ignore[index]
    for name, url in imports.items():
        source = base64.b64decode(url.removeprefix("data:text/javascript;base64,")).decode()
        wanted = re.findall(r"""(?:from|import)\s*['"]([^'"]+)['"]""", source) if name != "three" else []
        assert set(wanted) <= set(imports), name


def test_the_viewer_brings_the_three_js_that_the_engines_are_tested_with() -> None:
    pinned = json.loads((engine_runs.ENGINES / "package.json").read_text())["dependencies"]["three"]
    viewer = Path(garmentc.__file__).parent / "preview" / "viewer"
    assert f"three {pinned} " in (viewer / "three.LICENSE.md").read_text(encoding="utf-8")
    revision = pinned.split(".")[1]
    assert re.search(rf"""=["`']{revision}["`']""", (viewer / "three.bundle.js").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", ["<script>alert(1)<", "{asset}{content}"])
def test_names_cannot_break_out_of_a_page(moving: Path, tmp_path: Path, name: str) -> None:
    from garmentc.cli import main

    evil = tmp_path / f"{name}.glb"
    shutil.copy(moving, evil)
    out = tmp_path / "page.html"
    assert main(["preview", str(evil), "-o", str(out), "-q"]) == 0
    assert "<script>alert" not in out.read_text(encoding="utf-8")


LOOK = """(async () => {
  const {figure, stage} = window.garmentc, positions = mesh => {
    const {position} = mesh.geometry.attributes, found = [], point = stage.middle.clone();
    mesh.skeleton.update();
    for (let i = 0; i < position.count; i += STEP)
      found.push(...mesh.getVertexPosition(i, point).applyMatrix4(mesh.matrixWorld));
    return found;
  };
  const STEP = 37, shown = {};
  figure.playing = false;
  const at = (name, source) => {
    figure.driveBy(source);
    figure.update(0);
    stage.scene.updateMatrixWorld(true);
    shown[name] = {keys: [...figure.meshes[0].morphTargetInfluences], outfit: figure.meshes.flatMap(positions),
      body: positions(figure.body.mesh)};
  };
  figure.seek(1.5);
  at('animation', 'animation');
  at('network', 'network');
  figure.bones.forEach((bone, joint) => figure.turn(joint, 0.1, 0.05 * joint % 0.4, -0.08));
  at('turned', 'network');
  document.querySelectorAll('#poses button')[3].click();
  for (let i = 0; i < 9; i++) figure.update(0.1);
  at('sit', 'network');
  const pelvis = () => figure.bones[0].getWorldPosition(stage.middle.clone());
  const off = () => (stage.follow(pelvis()), stage.controls.target.clone().sub(pelvis()));
  const before = off();
  figure.bones[0].position.x += 3;
  stage.scene.updateMatrixWorld(true);
  return {step: STEP, shown, strayed: off().distanceTo(before),
    sliders: document.querySelectorAll('#joints input').length,
    morphs: document.querySelectorAll('#morphs input').length, playable: !document.getElementById('timeline').hidden,
    facts: document.getElementById('facts').innerText};
})()"""


@pytest.fixture(scope="module")
def looked(page: Path) -> dict[str, Any]:
    """What the page is and does in headless Chromium."""
    engine_runs.require_engines()
    browser = shutil.which(engine_runs.chromium())
    if browser is None:
        pytest.skip("chromium is not installed")
    script = page.with_name("look.js")
    script.write_text(LOOK)
    command = ["node", "open_page.mjs", str(page), str(script)]
    result = subprocess.run(
        command, cwd=engine_runs.ENGINES, env={**os.environ, "CHROMIUM": browser}, capture_output=True, text=True
    )
    assert result.returncode == 0, result.stderr
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def test_a_page_opens_from_disk_without_the_network(looked: dict[str, Any]) -> None:
    assert looked["errors"] == []
    assert looked["requests"] == ["page.html"]
    assert looked["found"]["sliders"] == 72
    assert looked["found"]["playable"]
    assert looked["found"]["strayed"] < 1e-6, "the camera goes with the figure"
    assert "default female" in looked["found"]["facts"]


def reference(asset: GlbAsset, pose: np.ndarray, translation: np.ndarray, step: int) -> tuple[np.ndarray, np.ndarray]:
    """The outfit and the body in a pose, as numpy evaluates them, every `step`-th vertex."""
    worn = prepare(asset, load_default_body("female"), None)
    state = state_at_pose(asset, pose, translation)
    skin = worn.skin(state)
    assert skin is not None
    return np.concatenate([surface.positions[::step] for surface in worn.outfit(state)]), skin.positions[::step]


def test_a_page_moves_outfit_and_body_as_numpy_does(looked: dict[str, Any], moving: Path) -> None:
    asset = read_glb(moving)
    found = looked["found"]
    pose, translation = body_pose(asset, state_at_time(asset, 1.5))
    baked = state_at_time(asset, 1.5).weights[asset.outfit_nodes[0]]
    live = state_at_pose(asset, pose, translation).weights[asset.outfit_nodes[0]]
    np.testing.assert_allclose(found["shown"]["animation"]["keys"], baked, atol=1e-4)
    np.testing.assert_allclose(found["shown"]["network"]["keys"], live, atol=1e-4)
    cloth, skin = reference(asset, pose, translation, found["step"])
    np.testing.assert_allclose(np.reshape(found["shown"]["network"]["outfit"], (-1, 3)), cloth, atol=2e-4)
    np.testing.assert_allclose(np.reshape(found["shown"]["network"]["body"], (-1, 3)), skin, atol=1e-3)


def test_poses_by_hand_stand_on_the_floor(looked: dict[str, Any], moving: Path) -> None:
    asset = read_glb(moving)
    shown = looked["found"]["shown"]
    assert np.abs(np.subtract(shown["turned"]["keys"], shown["network"]["keys"])).max() > 1e-3
    cloth, skin = reference(asset, telling_poses()["sit"], np.zeros(3), looked["found"]["step"])
    sitting = np.reshape(shown["sit"]["body"], (-1, 3))
    shift = (sitting - skin).mean(axis=0)
    np.testing.assert_allclose(sitting - shift, skin, atol=1e-3)
    np.testing.assert_allclose(np.reshape(shown["sit"]["outfit"], (-1, 3)) - shift, cloth, atol=1e-3)
