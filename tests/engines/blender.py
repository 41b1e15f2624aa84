"""Blender on every job: world positions of all vertices at `times`, or a picture (`view` and `time`).

`python blender.py jobs.json`, with the Python that has requirements.txt installed.
"""

from __future__ import annotations

import json
import math
import sys
import traceback
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

FPS = 30
UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # from Blender's axes, z up, to glTF's


def load(glb: str) -> list[Any]:
    """The skinned meshes of a file, alone in the scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = FPS
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=glb)
    imported = [each for each in bpy.data.objects if each not in before and each.type == "MESH"]
    return [each for each in imported if any(modifier.type == "ARMATURE" for modifier in each.modifiers)]


def widen(mesh: Any) -> None:
    """Let shape keys go where the animation takes them.

    Blender holds them within their sliders, 0 to 1. The importer (5.0) widens these for an animation's first keyframe,
    not for the others.
    """
    for key in mesh.data.shape_keys.key_blocks if mesh.data.shape_keys else ():
        key.slider_min, key.slider_max = -10, 10


def go_to(time: float) -> None:
    frame = round(time * FPS, 4)
    bpy.context.scene.frame_set(math.floor(frame), subframe=frame - math.floor(frame))


def positions(meshes: list[Any], time: float) -> np.ndarray:
    """(S, 3), metres, glTF's axes."""
    go_to(time)
    graph = bpy.context.evaluated_depsgraph_get()
    found = []
    for each in meshes:
        evaluated = each.evaluated_get(graph)
        mesh = evaluated.to_mesh()
        local = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", local)
        world = np.array(evaluated.matrix_world, dtype=float)
        found.append((local.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]) @ UP.T)
        evaluated.to_mesh_clear()
    return np.concatenate(found)


def looking(origin: Vector, target: Vector) -> Matrix:
    """A camera's or a lamp's matrix."""
    return Matrix.Translation(origin) @ (target - origin).to_track_quat("-Z", "Y").to_matrix().to_4x4()


def draw(view: dict[str, Any], time: float, out: str) -> None:
    """A PNG with a transparent background, by Cycles on the CPU."""
    go_to(time)
    scene = bpy.context.scene
    position, target, sun = (Vector(UP.T @ np.array(view[name])) for name in ("position", "target", "sun"))
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.angle = "VERTICAL", math.radians(view["fov"])
    data.clip_start, data.clip_end = 0.05, 50
    scene.camera = bpy.data.objects.new("camera", data)
    scene.camera.matrix_world = looking(position, target)
    light = bpy.data.lights.new("sun", "SUN")
    light.energy, light.angle = 3, 0.05
    lamp = bpy.data.objects.new("sun", light)
    lamp.matrix_world = looking(sun, Vector((0, 0, 0)))
    for each in (scene.camera, lamp):
        scene.collection.objects.link(each)
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.6, 0.6, 0.6, 1)
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.max_bounces = 24, False, 2
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.render.film_transparent = True
    scene.render.resolution_x, scene.render.resolution_y = view["width"], view["height"]
    scene.view_settings.view_transform = "Standard"
    scene.render.image_settings.file_format, scene.render.image_settings.color_mode = "PNG", "RGBA"
    scene.render.filepath = out
    bpy.ops.render.render(write_still=True)


def do(job: dict[str, Any]) -> None:
    meshes = load(job["glb"])
    if not job.get("as_imported"):
        for mesh in meshes:
            widen(mesh)
    if "view" in job:
        draw(job["view"], job["time"], job["out"] + ".png")
        Path(job["out"] + ".png").replace(job["out"])
    else:
        np.stack([positions(meshes, time) for time in job["times"]]).astype(np.float64).tofile(job["out"])


for job in json.loads(Path(sys.argv[1]).read_text()):
    try:
        do(job)
    except Exception:
        Path(job["out"] + ".error").write_text(traceback.format_exc())
