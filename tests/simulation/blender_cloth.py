"""One piece of cloth and one moving body in Blender's cloth solver, for a Python that has `bpy`; see compare_blender.

    python blender_cloth.py scene.npz frames.npz

The scene is that of `garmentc.simulation.cloth_simulator.simulate`, each number turned into what Blender (4.5) means by
it. Its manual doesn't say; scenes with known answers do: fall, a hanging strip, a strip clamped level, a slope.

- Mass is per vertex. Stiffnesses count in thousands of newtons.
- An edge pulls with tension / (mean edge length) per metre; on equilateral triangles with edges L that is a membrane
  of stiffness 2 / sqrt(3) * tension / L, of which shear gets 3/8: triangles have no shear springs of their own.
- Bending: a strip of denim clamped at its end comes to hang as low (89 mm) as in our solver (88 mm) with BEND below,
  on edges of 1 and of 2 cm. Stiff cards swing on for seconds.
- The friction of a collider is Coulomb's in hundredths: slopes are slid down as fast as his law says.
- With stiffness in proportion to mass a thousand times too high, cloth floats: the linear solver stops too early.
"""

from __future__ import annotations

import os
import struct
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

BEND, BEND_LAG = 27.0, 0.01


def main(scene_path: str, out_path: str) -> None:
    with np.load(scene_path) as file:
        scene = {name: file[name] for name in file.files}
    np.savez_compressed(out_path, frames=run(scene))


def run(scene: dict[str, np.ndarray]) -> np.ndarray:
    """Positions (T, N, 3) of the cloth in each frame of body_frames (T, V, 3); the first is the start."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    stage = bpy.context.scene
    stage.gravity = (0.0, -9.81, 0.0)
    stage.frame_start, stage.frame_end = 1, len(scene["body_frames"])
    stage.render.threads_mode, stage.render.threads = "FIXED", 1
    stage.render.fps = round(float(scene["fps"]))
    with tempfile.TemporaryDirectory() as folder:
        body = _mesh("body", scene["body_frames"][0], scene["faces"])
        _animate(body, scene["body_frames"], Path(folder) / "body.pc2")
        body.modifiers.new("collision", "COLLISION")
        body.collision.thickness_outer = max(float(scene["distance"]) / 2, 1e-3)
        body.collision.thickness_inner = 0.02
        body.collision.cloth_friction = 100 * float(scene["friction"])
        body.collision.damping = 0.0
        body.collision.use_culling = True
        cloth = _mesh("cloth", scene["vertices"], scene["triangles"])
        pinned = scene["pinned"]
        if len(pinned):
            places = np.repeat(scene["vertices"][None], len(scene["pin_frames"]), axis=0)
            places[:, pinned] = scene["pin_frames"]
            _animate(cloth, places, Path(folder) / "cloth.pc2")
            cloth.vertex_groups.new(name="pins").add(pinned.tolist(), 1.0, "REPLACE")
        _cloth(cloth, scene)
        frames = []
        for frame in range(1, stage.frame_end + 1):
            stage.frame_set(frame)
            shown = cloth.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
            places = np.empty(3 * len(shown.vertices), np.float32)
            shown.vertices.foreach_get("co", places)
            frames.append(places.reshape(-1, 3))
    return np.array(frames)


def _cloth(cloth: bpy.types.Object, scene: dict[str, np.ndarray]) -> None:
    vertices, triangles = scene["vertices"].astype(float), scene["triangles"]
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    edges = np.unique(
        np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])), axis=0
    )
    length = float(np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1).mean())
    modifier = cloth.modifiers.new("cloth", "CLOTH")
    settings, contact = modifier.settings, modifier.collision_settings
    settings.quality = int(scene["quality"])
    settings.time_scale = 1.0
    settings.mass = float(scene["density"]) * area / len(vertices)
    settings.air_damping = 0.0
    settings.bending_model = "ANGULAR"
    tension = float(scene["stretch"]) * length * np.sqrt(3) / 2 / 1000
    settings.tension_stiffness = settings.compression_stiffness = tension
    settings.bending_stiffness = BEND * float(scene["bending"]) / length**2 / 1000
    damping = 0.1 * 2 * np.sqrt(1000 * tension / length * settings.mass) / 1000
    settings.tension_damping = settings.compression_damping = damping
    settings.bending_damping = BEND_LAG * settings.bending_stiffness
    if len(scene["pinned"]):
        settings.vertex_group_mass = "pins"
        settings.pin_stiffness = 1.0
    contact.collision_quality = int(scene["collision_quality"])
    contact.distance_min = max(float(scene["distance"]) / 2, 1e-3)
    contact.friction = 100 * float(scene["friction"])
    contact.damping = 0.0
    contact.use_self_collision = bool(scene["self_collision"])
    contact.self_distance_min = 2 * float(scene["self_radius"])
    cache = modifier.point_cache
    cache.frame_start, cache.frame_end = 1, len(scene["body_frames"])


def _mesh(name: str, vertices: np.ndarray, faces: np.ndarray) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def _animate(thing: bpy.types.Object, frames: np.ndarray, path: Path) -> None:
    """Vertices (T, V, 3) in frames 1, 2, ..., by way of a point cache file."""
    header = struct.pack("<12siiffi", b"POINTCACHE2\0", 1, frames.shape[1], 0.0, 1.0, len(frames))
    path.write_bytes(header + np.ascontiguousarray(frames, "<f4").tobytes())
    modifier = thing.modifiers.new("motion", "MESH_CACHE")
    modifier.cache_format = "PC2"
    modifier.filepath = os.fspath(path)
    modifier.frame_start = 1.0


if __name__ == "__main__":
    main(*sys.argv[1:3])
