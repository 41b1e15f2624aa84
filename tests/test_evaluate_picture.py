"""The picture of an evaluation: what is in it, and where."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from simulation_stand_in import skinned_patch

from garmentc.evaluation.baselines import nearest_skinning
from garmentc.evaluation.dataset_evaluation import evaluate_dataset
from garmentc.evaluation.evaluation_picture import FULL_SCALE, heat, picture_bytes
from garmentc.evaluation.method import NEAREST_METHOD
from garmentc.evaluation.representative import representatives
from garmentc.outfit.topology import vertex_normals
from garmentc.simulation.dataset import append_sequence, make_entry, make_folders, write_manifest
from garmentc.simulation.plan import make_plan
from garmentc.simulation.presets import PRESETS
from garmentc.simulation.sequence import Sequence
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.skeleton import JOINT_NAMES

CELL = (160, 200)


def test_heat_is_blue_for_none_and_red_from_full_scale_on() -> None:
    colors = heat(np.array([0.0, FULL_SCALE / 2, FULL_SCALE, 10 * FULL_SCALE]))
    assert colors[0, 2] > colors[0, 0]
    assert colors[2, 0] > colors[2, 2]
    np.testing.assert_array_equal(colors[2], colors[3])


def apron() -> Sequence:
    """The skin of the trunk's front, 20 mm out, moved with the nearest body vertices."""
    patch = skinned_patch(next(make_plan(PRESETS["small"], seed=1, outfits=1).tasks))
    body = load_default_body(patch.facts.gender)
    skin = body.shaped(patch.betas)
    chest = body.joints(patch.betas)[JOINT_NAMES.index("spine2")]
    front = (np.abs(skin - chest)[:, :2] < 0.15).all(axis=1) & (skin[:, 2] > chest[2])
    used, faces = np.unique(body.faces[front[body.faces].all(axis=1)], return_inverse=True)
    template = (skin + 0.02 * vertex_normals(skin, body.faces))[used].astype(np.float32)
    faces = faces.reshape(-1, 3).astype(np.int32)
    posed = nearest_skinning(template, faces, body, patch.betas).posed(patch.poses, patch.trans)
    part = np.zeros(len(faces), np.int32)
    return replace(patch, template=template, faces=faces, triangle_part=part, vertices=posed.astype(np.float32))


def test_rows_are_samples_and_the_last_column_shows_the_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cloth simulated where skinning puts it is blue in the heat map; simulated elsewhere it is red."""
    monkeypatch.setattr("garmentc.evaluation.evaluation_picture.CELL", CELL)
    cloth = apron()
    make_folders(tmp_path)
    for name, away in (("near", 0.0), ("far", 0.3)):
        facts = replace(cloth.facts, name=name, outfit=name, motion="walk")
        append_sequence(tmp_path, replace(cloth, facts=facts, vertices=cloth.vertices + np.float32([0, away, 0])))
    dataset = write_manifest(tmp_path, "two", [make_entry(tmp_path, name, "test") for name in ("near", "far")])
    evaluation = evaluate_dataset(dataset, "test", [NEAREST_METHOD], frames=1)
    samples = representatives(evaluation)
    assert [sample.sequence for sample in samples] == ["near", "far", "far"]
    data = picture_bytes(evaluation, samples[::2], dataset)
    sheet = np.asarray(Image.open(io.BytesIO(data))).astype(int)
    assert sheet.shape == (2 * (CELL[1] + 44) + 44, 3 * CELL[0], 3)

    def share(row: int, column: int, more: int, less: int) -> float:
        """Of the pixels of a view in which one colour channel clearly beats another."""
        top = row * (CELL[1] + 44) + 44
        view = sheet[top : top + CELL[1], column * CELL[0] : (column + 1) * CELL[0]]
        return float((view[..., more] - view[..., less] > 60).mean())

    blue, red = (2, 0), (0, 2)
    assert share(0, 2, *blue) > 0.01
    assert share(0, 2, *red) == 0
    assert share(1, 2, *red) > 0.01
    assert share(1, 2, *blue) == 0
    for row in range(2):
        assert min(share(row, 0, *blue), share(row, 1, *blue)) > 0.01, "the cloth itself is blue"
