"""VRMC_vrm 1.0: what makes a glTF file an avatar (vrm-c/vrm-specification, VRMC_vrm-1.0)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from garmentc.gltf.skeletons import VRM

EXTENSION = "VRMC_vrm"

LICENSE = "https://vrm.dev/licenses/1.0/"
"""The only value that the specification accepts. What meta does not grant, it withholds: nothing is granted here."""

AUTHOR = "unknown"
"""A name is required, and the outfit's files say none."""


def vrm_extension(name: str, joints: Sequence[int]) -> dict[str, Any]:
    """The extension object for the root of the document.

    joints  24 node indices, in the order of SMPL's joints
    """
    bones = {bone: {"node": node} for bone, node in zip(VRM.joints, joints, strict=True)}
    return {
        "specVersion": "1.0",
        "meta": {"name": name, "authors": [AUTHOR], "licenseUrl": LICENSE},
        "humanoid": {"humanBones": bones},
    }
