"""Reading GARMENTC_mesh_pose_keys, from the mesh's extension and from the node's extras."""

from __future__ import annotations

import base64
import binascii
import json
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.cursor import Cursor
from garmentc.gltf.glb_asset import PoseKeyNetwork
from garmentc.gltf.pose_keys import EXTENSION, VERSION
from garmentc.gltf.read_accessors import AccessorReader
from garmentc.rig import ACTIVATIONS, DenseLayer
from garmentc.smpl.skeleton import JOINT_COUNT

_MOST_NUMBERS = 2**26


def network_in_extension(mesh: Cursor, reader: AccessorReader, node_count: int) -> PoseKeyNetwork | None:
    """The network in `mesh.extensions`; None where there is none."""
    entry = mesh.get("extensions").get(EXTENSION)
    if not entry.given:
        return None
    joints = tuple(joint.index(node_count) for joint in entry.get("joints"))

    def numbers(layer: Cursor, name: str) -> NDArray[np.float32]:
        values = reader.array(layer.get(name), ("SCALAR",))
        if values.dtype != np.float32:
            raise layer.get(name).error("must be an accessor of floats")
        return values

    return _network(entry, joints, numbers)


def network_in_extras(
    extras: Cursor, node_names: tuple[str, ...], skin_joints: tuple[int, ...] = ()
) -> PoseKeyNetwork | None:
    """The network in a node's extras; None where there is none.

    Its joints are found by name, or, where a tool has renamed them, as those of the node's skin in their order.
    """
    if not isinstance(extras.value, dict) or not extras.get(EXTENSION).given:
        return None
    where = extras.get(EXTENSION)
    try:
        entry = Cursor(json.loads(where.text()), where.pointer, where.file)
    except (ValueError, RecursionError) as error:
        raise where.error(f"is no JSON: {error}") from error
    by_name = {name: index for index, name in enumerate(node_names)}
    names = [joint.text() for joint in entry.get("joints")]
    missing = [name for name in names if name not in by_name]
    joints = tuple(by_name.get(name, -1) for name in names)
    if missing and len(skin_joints) == len(names):
        joints = skin_joints
    elif missing:
        raise where.error(f"names the joint {missing[0]}, which is no node of the file", "keep the nodes' names")

    def numbers(layer: Cursor, name: str) -> NDArray[np.float32]:
        try:
            raw = base64.b64decode(layer.get(name).text(), validate=True)
            return np.frombuffer(raw, dtype="<f4").astype(np.float32)
        except (ValueError, binascii.Error) as error:
            raise layer.get(name).error("is no base64 of 32-bit floats") from error

    return _network(entry, joints, numbers)


def _network(
    entry: Cursor, joints: tuple[int, ...], numbers: Callable[[Cursor, str], NDArray[np.float32]]
) -> PoseKeyNetwork:
    version = entry.get("version").integer(low=1)
    if version != VERSION:
        raise entry.get("version").error(f"is {version}, only {VERSION} is known", "update garmentc")
    if len(joints) != JOINT_COUNT:
        raise entry.get("joints").error(f"must be {JOINT_COUNT} joints")
    layers: list[DenseLayer] = []
    for layer in entry.get("layers"):
        weight, bias = numbers(layer, "weight"), numbers(layer, "bias")
        if len(bias) == 0 or len(weight) % len(bias) or len(weight) > _MOST_NUMBERS:
            raise layer.error(f"has {len(weight)} weights for {len(bias)} outputs")
        matrix = weight.reshape(len(bias), -1)
        if layers and matrix.shape[1] != len(layers[-1].bias):
            raise layer.error(f"takes {matrix.shape[1]} inputs where the layer before it has {len(layers[-1].bias)}")
        if not (np.isfinite(weight).all() and np.isfinite(bias).all()):
            raise layer.error("holds NaN or infinite values")
        activation = layer.get("activation").text("linear")
        if activation not in ACTIVATIONS:
            raise layer.error(f"has activation {activation}, known are {', '.join(ACTIVATIONS)}", "update garmentc")
        layers.append(DenseLayer(matrix, bias, activation))
    if not layers:
        raise entry.error("has no layers")
    return PoseKeyNetwork(encoding=entry.get("encoding").text(), joints=joints, layers=tuple(layers))
