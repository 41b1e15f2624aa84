"""Read a compiled .glb back: what is in it, is it sound, and where its vertices are in a pose of your own.

python examples/read_back.py outfit.glb
"""

from __future__ import annotations

import sys

import numpy as np

from garmentc.gltf.evaluate import world_mesh
from garmentc.gltf.inspect import inspect_glb
from garmentc.gltf.posing import state_at_pose, state_at_time
from garmentc.gltf.read import read_glb
from garmentc.gltf.state import rest_state
from garmentc.smpl.skeleton import JOINT_NAMES


def main(path: str) -> None:
    asset = read_glb(path)
    summary = inspect_glb(asset)
    print(f"{path}: {summary.bytes:,} bytes, {summary.joints} joints, {len(summary.morphs)} morph targets")
    for primitive in summary.primitives:
        print(f"  {primitive.material}: {primitive.vertices} vertices, {primitive.triangles} triangles")
    for finding in summary.findings:
        print(f"  {finding}")

    rest, _ = world_mesh(asset, rest_state(asset))
    pose = np.zeros((24, 3))
    pose[JOINT_NAMES.index("left_shoulder")] = [0, 0, -1.2]  # the left arm down, radians about each axis
    posed, triangles = world_mesh(asset, state_at_pose(asset, pose))
    moved = np.linalg.norm(posed - rest, axis=1)
    print(f"left arm down: {len(triangles)} triangles, a vertex moves by up to {moved.max() * 100:.1f} cm")

    for number, animation in enumerate(asset.animations):
        middle, _ = world_mesh(asset, state_at_time(asset, animation.duration / 2, number))
        size = np.ptp(middle, axis=0)
        print(f"{animation.name} at {animation.duration / 2:.2f} s: {size[0]:.2f} x {size[1]:.2f} x {size[2]:.2f} m")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
