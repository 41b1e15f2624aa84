"""DeePSD's network as ONNX: one graph from outfit to rig, one from pose to keys (`garmentc.key_graph`).

The graphs are written node by node rather than traced: names are stable (a bundle's reader cuts the outfit graph at
them to work in pieces) and the same weights give the same bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from garmentc.errors import GarmentcError
from garmentc.families.deepsd_names import (
    CANDIDATES,
    GLOBAL,
    HELD,
    LOCAL,
    METADATA,
    NEIGHBORS,
    NORMALS,
    SHAPES,
    SKIN,
    VERTICES,
    WEIGHTS,
)
from garmentc.key_graph import key_graph
from garmentc.rig import ENCODING_WIDTHS, DenseLayer, KeyNetwork
from garmentc.training.deepsd_network import NONE, Deepsd, DeepsdConfig
from garmentc.training.deepsd_network import VERTICES as VERTICES_DIRECTLY

OPSET = 18
IR_VERSION = 9


@dataclass(frozen=True)
class Layer:
    """weight (outputs, inputs), bias (outputs,) or None, float32."""

    weight: NDArray[Any]
    bias: NDArray[Any] | None


class _Graph:
    """Nodes and constants of a graph under construction."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def constant(self, name: str, value: NDArray[Any]) -> str:
        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(value), name))
        return name

    def add(self, op: str, inputs: list[str], output: str, **attributes: Any) -> str:
        self.nodes.append(helper.make_node(op, inputs, [output], name=output, **attributes))
        return output

    def linear(self, x: str, layer: Layer, name: str) -> str:
        inputs = [x, self.constant(f"{name}.weight", layer.weight)]
        if layer.bias is not None:
            inputs.append(self.constant(f"{name}.bias", layer.bias))
        return self.add("Gemm", inputs, f"{name}.out", transB=1)

    def mlp(self, x: str, layers: list[Layer], name: str) -> str:
        for index, layer in enumerate(layers):
            x = self.linear(x, layer, f"{name}.{index}")
            if index < len(layers) - 1:
                x = self.add("Relu", [x], f"{name}.{index}.relu")
        return x

    def model(self, inputs: list[Any], outputs: list[Any], known: list[Any], doc: str) -> bytes:
        graph = helper.make_graph(self.nodes, "garmentc", inputs, outputs, self.constants, doc, known)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
        model.producer_name = "garmentc"
        onnx.checker.check_model(model, full_check=True)
        serialized: bytes = model.SerializeToString(deterministic=True)
        return serialized


def _floats(name: str, *shape: str | int) -> Any:
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, list(shape))


def outfit_graph(network: Deepsd) -> bytes:
    """vertices, normals (N, 3), neighbors (N, K) int64 padded with N, held (N, 2), skin_weights (N, 24)
    and, of a network that was told any, metadata (1, M) → weights (N, 24), blend_shapes (N, P, 3).

    Raises GarmentcError where the network is a variant that no rig can express.
    """
    config = network.config
    _check_is_rig(config)
    g = _Graph()
    n = g.add("Shape", [VERTICES], "vertex_count", start=0, end=1)
    real = g.add("Cast", [g.add("Less", [NEIGHBORS, n], "is_neighbor")], "is_neighbor_f", to=TensorProto.FLOAT)
    axis = g.constant("axis_1", np.array([1], np.int64))
    degree = g.add("ReduceSum", [real, axis], "degree", keepdims=1)
    degree = g.add("Max", [degree, g.constant("one", np.ones(1, np.float32))], "degree_floor")
    x = g.add("Concat", [VERTICES, NORMALS, HELD], "features_0", axis=1)
    width = 8
    for index, convolution in enumerate(network.convolutions):
        name = f"convolution.{index}"
        padded = g.add("Concat", [x, g.constant(f"{name}.pad", np.zeros((1, width), np.float32))], f"{name}.in", axis=0)
        gathered = g.add("Gather", [padded, NEIGHBORS], f"{name}.gathered", axis=0)
        mean = g.add("Div", [g.add("ReduceSum", [gathered, axis], f"{name}.sum", keepdims=0), degree], f"{name}.mean")
        own = g.linear(x, _layer(convolution.own), f"{name}.own")
        around = g.linear(mean, _layer(convolution.neighbour), f"{name}.neighbour")
        total = g.add("Add", [own, around], f"{name}.total")
        last = index == len(network.convolutions) - 1
        x = g.add("Relu", [total], LOCAL if last else f"features_{index + 1}")
        width = config.convolutions[index]
    pool = _layer(network.global_layer) if config.global_descriptor else Layer(_zeros(1, width), _zeros(1))
    global_width = len(pool.weight)
    candidates = g.add("Relu", [g.linear(x, pool, "global_layer")], CANDIDATES)
    pooled = g.add("ReduceMax", [candidates, g.constant("axis_0", np.array([0], np.int64))], GLOBAL, keepdims=1)
    shared, shared_width = pooled, global_width + config.metadata_width
    if config.metadata_width:
        shared = g.add("Concat", [pooled, METADATA], "shared", axis=1)
    rows = g.add("Shape", [LOCAL], "local_count", start=0, end=1)
    shape = g.add("Concat", [rows, g.constant("shared_width", np.array([shared_width]))], "shared_shape", axis=0)
    spread = g.add("Expand", [shared, shape], "shared_spread")
    descriptors = g.add("Concat", [x, spread], "descriptors", axis=1)

    def head(layers: torch.nn.Sequential, name: str, scale: float = 1.0) -> str:
        return g.mlp(descriptors, _head_layers(layers, width, config.global_descriptor, scale), name)

    firmness = g.add("Gather", [HELD, g.constant("firmness_column", np.array([0], np.int64))], "firmness", axis=1)
    loose = g.add("Sub", [g.constant("whole", np.ones(1, np.float32)), firmness], "loose")
    learned = g.add("Softmax", [head(network.weight_head, "weight_head")], "learned_weights", axis=1)
    taken = g.add("Mul", [SKIN, firmness], "weights_of_skin")
    g.add("Add", [taken, g.add("Mul", [learned, loose], "weights_of_cloth")], WEIGHTS)
    if config.deformation == NONE:
        nothing = Layer(_zeros(3, width + shared_width), _zeros(3))
        shapes, keys = g.linear(descriptors, nothing, "no_shape"), 1
    else:
        shapes, keys = head(network.data_head, "data_head", config.key_scale), config.pose_code
        if _adds_anything(network.physics_head):
            added = head(network.physics_head, "physics_head", config.key_scale)
            shapes = g.add("Add", [shapes, added], "blend_shapes_flat")
    shapes = g.add("Mul", [shapes, loose], "loose_shapes")
    g.add("Reshape", [shapes, g.constant("shape_3", np.array([-1, keys, 3]))], SHAPES)
    neighbors = helper.make_tensor_value_info(NEIGHBORS, TensorProto.INT64, ["N", "K"])
    inputs = [_floats(VERTICES, "N", 3), _floats(NORMALS, "N", 3), neighbors]
    inputs += [_floats(HELD, "N", 2), _floats(SKIN, "N", config.joints)]
    if config.metadata_width:
        inputs.append(_floats(METADATA, 1, config.metadata_width))
    outputs = [_floats(WEIGHTS, "N", config.joints), _floats(SHAPES, "N", keys, 3)]
    known = [
        _floats(LOCAL, "N", config.convolutions[-1]),
        _floats(CANDIDATES, "N", global_width),
        _floats(GLOBAL, 1, global_width),
    ]
    return g.model(inputs, outputs, known, "DeePSD: template outfit to blend weights and blend shapes")


def _check_is_rig(config: DeepsdConfig) -> None:
    if config.deformation == VERTICES_DIRECTLY:
        raise GarmentcError("a network that deforms vertices directly is no rig and has no bundle; train blend shapes")
    if config.pose_encoding not in ENCODING_WIDTHS:
        known = "' or '".join(ENCODING_WIDTHS)
        raise GarmentcError(f"bundles have the pose encoding '{known}' only; train with one of them")


def _layer(linear: Any) -> Layer:
    return Layer(linear.weight.detach().numpy(), None if linear.bias is None else linear.bias.detach().numpy())


def _zeros(*shape: int) -> NDArray[np.float32]:
    return np.zeros(shape, np.float32)


def _head_layers(head: torch.nn.Sequential, local: int, has_global: bool, scale: float) -> list[Layer]:
    """`scale` times the head as a function of [local, global] descriptors and metadata.

    A missing global descriptor is one number, and nought.
    """
    first, *others, last = (_layer(layer) for layer in head if isinstance(layer, torch.nn.Linear))
    assert last.bias is not None
    if not has_global:
        first = Layer(np.insert(first.weight, local, 0, axis=1), first.bias)
    factor = np.float32(scale)
    return [first, *others, Layer(factor * last.weight, factor * last.bias)]


def _adds_anything(head: torch.nn.Sequential) -> bool:
    last = head[-1]
    assert isinstance(last, torch.nn.Linear)
    return bool(last.weight.any() or last.bias.any())


def key_network(network: Deepsd) -> KeyNetwork:
    """g of the network: from pose to keys that do not vanish at rest (`rest_keys`)."""
    config = network.config
    encoding, width = config.pose_encoding, config.pose_features
    if config.deformation == NONE:  # skinning only: one key that never moves
        return KeyNetwork((_dense(np.zeros((1, width)), np.zeros(1)),), encoding)
    if not config.pose_embedding:
        return KeyNetwork((_dense(np.eye(width), np.zeros(width)),), encoding)
    layers = [layer for layer in network.pose_head if isinstance(layer, torch.nn.Linear)]
    kinds = ["relu"] * (len(layers) - 1) + ["normalized_relu"]
    weights = [layer.weight.detach().numpy() for layer in layers]
    weights[0] = weights[0] * network.seen.numpy()
    return KeyNetwork(
        tuple(
            _dense(weight, layer.bias.detach().numpy(), kind)
            for weight, layer, kind in zip(weights, layers, kinds, strict=True)
        ),
        encoding,
    )


def _dense(weight: NDArray[Any], bias: NDArray[Any], activation: str = "linear") -> DenseLayer:
    return DenseLayer(weight.astype(np.float32), bias.astype(np.float32), activation)


def rest_keys(network: Deepsd) -> NDArray[np.float32]:
    """g(rest), (P,): what is subtracted so that keys vanish at rest."""
    if network.config.deformation == NONE:
        return np.zeros(1, np.float32)
    with torch.no_grad():
        keys: NDArray[np.float32] = network.absolute_keys(torch.zeros(1, network.config.pose_features))[0].numpy()
    return keys


def keys_graph(network: Deepsd) -> bytes:
    """pose (T, 24, 3) axis-angle in radians → keys (T, P), relative to the rest pose."""
    return key_graph(key_network(network), rest_keys(network))
