"""The glTF extension GARMENTC_mesh_pose_keys: the network that turns joint rotations into morph weights.

It is written twice, because no single place survives every tool: as an extension of the mesh, with its numbers in
accessors, and as one string in the extras of the mesh's node, with its numbers in base64.
docs/GARMENTC_mesh_pose_keys.md describes both, and the mathematics.
"""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np

from garmentc.gltf.accessors import AccessorWriter
from garmentc.rig import KeyNetwork
from garmentc.smpl.skeleton import JOINT_NAMES

EXTENSION = "GARMENTC_mesh_pose_keys"
VERSION = 1


def add_extension(writer: AccessorWriter, keys: KeyNetwork, joints: list[int]) -> dict[str, Any]:
    """Write the network's numbers; returns the extension object for `mesh.extensions`.

    joints  24 node indices, in the order of the encoding
    """
    layers = [
        {
            "weight": writer.plain(layer.weight.astype(np.float32).reshape(-1), label="a weight of the key network"),
            "bias": writer.plain(layer.bias.astype(np.float32), label="a bias of the key network"),
            "activation": layer.activation,
        }
        for layer in keys.layers
    ]
    return {"version": VERSION, "encoding": keys.encoding, "joints": joints, "layers": layers}


def extras_string(keys: KeyNetwork, names: tuple[str, ...] = JOINT_NAMES) -> str:
    """The network as one JSON string, for the extras of the mesh's node.

    A string, because exporters crash on lists and objects in node extras; joints go by name, because tools that keep
    extras renumber nodes.

    names  of the 24 joints' nodes, in the order of the encoding
    """
    layers = [
        {
            "inputs": layer.weight.shape[1],
            "outputs": layer.weight.shape[0],
            "activation": layer.activation,
            "weight": _base64(layer.weight),
            "bias": _base64(layer.bias),
        }
        for layer in keys.layers
    ]
    content = {"version": VERSION, "encoding": keys.encoding, "joints": list(names), "layers": layers}
    return json.dumps(content, separators=(",", ":"))


def _base64(array: np.ndarray[Any, Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(array, dtype="<f4").tobytes()).decode("ascii")
