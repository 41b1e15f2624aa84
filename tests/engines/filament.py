"""Filament on every job: a picture of a frame (`view` and `time`), with a transparent background.

`python filament.py jobs.json`, with the Python that has requirements.txt installed.
"""

from __future__ import annotations

import json
import sys
import traceback
from pathlib import Path
from typing import Any

import filly
import numpy as np
from PIL import Image


def do(renderer: filly.Renderer, job: dict[str, Any]) -> None:
    view = job["view"]
    scene = renderer.create_scene()
    model = scene.load(job["glb"])
    model.apply_animation(0, job["time"], loop=False)
    scene.camera = renderer.create_camera()
    scene.camera.set_perspective(fov_y_deg=view["fov"], aspect=view["width"] / view["height"], near=0.05, far=50)
    scene.camera.position = view["position"]
    scene.camera.look_at(view["target"])
    scene.add_directional_light(direction=[-value for value in view["sun"]], intensity=90_000)
    scene.environment = renderer.create_environment(np.full((8, 16, 3), 0.6, np.float32))
    scene.environment_visible, scene.transparent = False, True
    scene.background = (0, 0, 0, 0)
    target = renderer.create_render_target(width=view["width"], height=view["height"])
    renderer.render(scene, target)
    Image.fromarray(target.read()).save(job["out"], "PNG")
    target.close()
    scene.close()


with filly.Renderer() as renderer:
    for job in json.loads(Path(sys.argv[1]).read_text()):
        try:
            do(renderer, job)
        except Exception:
            Path(job["out"] + ".error").write_text(traceback.format_exc())
