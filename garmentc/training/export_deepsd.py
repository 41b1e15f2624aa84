"""DeePSD's network as ONNX: one graph from outfit to rig, one from pose to keys.

The graphs are written node by node rather than traced: names are stable (a bundle's reader cuts the outfit graph at
them to work in pieces) and the same weights give the same bytes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from garmentc.families.deepsd_names import CANDIDATES, GLOBAL, LOCAL, NEIGHBORS, NORMALS, SHAPES, VERTICES, WEIGHTS
from garmentc.rig import NORMALIZED_RELU_EPSILON
from garmentc.training.deepsd_network import Deepsd

OPSET = 18
IR_VERSION = 9


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

    def linear(self, x: str, layer: Any, name: str) -> str:
        inputs = [x, self.constant(f"{name}.weight", layer.weight.detach().numpy())]
        if layer.bias is not None:
            inputs.append(self.constant(f"{name}.bias", layer.bias.detach().numpy()))
        return self.add("Gemm", inputs, f"{name}.out", transB=1)

    def mlp(self, x: str, layers: torch.nn.Sequential, name: str) -> str:
        for index, layer in enumerate(layers):
            if isinstance(layer, torch.nn.Linear):
                x = self.linear(x, layer, f"{name}.{index // 2}")
            else:
                x = self.add("Relu", [x], f"{name}.{index // 2}.relu")
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
    """vertices, normals (N, 3), neighbors (N, K) int64 padded with N → weights (N, 24), blend_shapes (N, P, 3)."""
    config = network.config
    g = _Graph()
    n = g.add("Shape", [VERTICES], "vertex_count", start=0, end=1)
    real = g.add("Cast", [g.add("Less", [NEIGHBORS, n], "is_neighbor")], "is_neighbor_f", to=TensorProto.FLOAT)
    axis = g.constant("axis_1", np.array([1], np.int64))
    degree = g.add("ReduceSum", [real, axis], "degree", keepdims=1)
    degree = g.add("Max", [degree, g.constant("one", np.ones(1, np.float32))], "degree_floor")
    x = g.add("Concat", [VERTICES, NORMALS], "features_0", axis=1)
    width = 6
    for index, convolution in enumerate(network.convolutions):
        name = f"convolution.{index}"
        padded = g.add("Concat", [x, g.constant(f"{name}.pad", np.zeros((1, width), np.float32))], f"{name}.in", axis=0)
        gathered = g.add("Gather", [padded, NEIGHBORS], f"{name}.gathered", axis=0)
        mean = g.add("Div", [g.add("ReduceSum", [gathered, axis], f"{name}.sum", keepdims=0), degree], f"{name}.mean")
        own = g.linear(x, convolution.own, f"{name}.own")
        around = g.linear(mean, convolution.neighbour, f"{name}.neighbour")
        total = g.add("Add", [own, around], f"{name}.total")
        last = index == len(network.convolutions) - 1
        x = g.add("Relu", [total], LOCAL if last else f"features_{index + 1}")
        width = config.convolutions[index]
    candidates = g.add("Relu", [g.linear(x, network.global_layer, "global_layer")], CANDIDATES)
    pooled = g.add("ReduceMax", [candidates, g.constant("axis_0", np.array([0], np.int64))], GLOBAL, keepdims=1)
    rows = g.add("Shape", [LOCAL], "local_count", start=0, end=1)
    shape = g.add("Concat", [rows, g.constant("global_width", np.array([config.global_width]))], "global_shape", axis=0)
    spread = g.add("Expand", [pooled, shape], "global_spread")
    descriptors = g.add("Concat", [x, spread], "descriptors", axis=1)
    g.add("Softmax", [g.mlp(descriptors, network.weight_head, "weight_head")], WEIGHTS, axis=1)
    data = g.mlp(descriptors, network.data_head, "data_head")
    physics = g.mlp(descriptors, network.physics_head, "physics_head")
    both = g.add("Add", [data, physics], "blend_shapes_flat")
    g.add("Reshape", [both, g.constant("shape_3", np.array([-1, config.keys, 3]))], SHAPES)
    neighbors = helper.make_tensor_value_info(NEIGHBORS, TensorProto.INT64, ["N", "K"])
    inputs = [_floats(VERTICES, "N", 3), _floats(NORMALS, "N", 3), neighbors]
    outputs = [_floats(WEIGHTS, "N", config.joints), _floats(SHAPES, "N", config.keys, 3)]
    known = [
        _floats(LOCAL, "N", config.convolutions[-1]),
        _floats(CANDIDATES, "N", config.global_width),
        _floats(GLOBAL, 1, config.global_width),
    ]
    return g.model(inputs, outputs, known, "DeePSD: template outfit to blend weights and blend shapes")


def keys_graph(network: Deepsd) -> bytes:
    """pose (T, 24, 3) axis-angle in radians → keys (T, P), relative to the rest pose."""
    g = _Graph()

    def scalar(name: str, value: float) -> str:
        return g.constant(name, np.array([value], np.float32))

    axis = g.constant("last_axis", np.array([-1], np.int64))
    squared = g.add("ReduceSumSquare", ["pose", axis], "angle_squared", keepdims=1)
    angle = g.add("Sqrt", [g.add("Max", [squared, scalar("tiny", 1e-12)], "angle_squared_floor")], "angle")
    turns = g.add("Div", [g.add("Add", [angle, scalar("pi", np.pi)], "angle_pi"), scalar("two_pi", 2 * np.pi)], "turn")
    turned = g.add("Mul", [g.add("Floor", [turns], "turns"), "two_pi"], "turned")
    shorter = g.add("Sub", [scalar("one", 1.0), g.add("Div", [turned, angle], "turned_share")], "shorter")
    pose = g.add("Mul", ["pose", shorter], "short_pose")
    root = g.add("Slice", [pose, *(g.constant(f"root_{k}", np.array([v])) for k, v in _slice(0, 1))], "root")
    rest = g.add("Slice", [pose, *(g.constant(f"rest_{k}", np.array([v])) for k, v in _slice(1, 24))], "others")
    # Up seen from the pelvis, minus up: R(-r) y - y = -(sin a / a) (r x y) + ((1 - cos a) / a^2) (r x (r x y)).
    size2 = g.add("ReduceSumSquare", [root, axis], "root_squared", keepdims=1)
    size = g.add("Sqrt", [g.add("Max", [size2, "tiny"], "root_squared_floor")], "root_angle")
    cross_y = g.constant("cross_y", np.array([[0, 0, 1], [0, 0, 0], [-1, 0, 0]], np.float32))  # r @ it = r x y
    first = g.add("MatMul", [root, cross_y], "root_cross_up")
    along = g.add("Mul", [root, g.add("Slice", [root, *_pick_y(g)], "root_y")], "root_along")
    up = g.constant("up", np.array([0, 1, 0], np.float32))
    second = g.add("Sub", [along, g.add("Mul", [size2, up], "root_up")], "root_cross_cross_up")  # r (r.y) - y r.r
    sine = g.add("Div", [g.add("Sin", [size], "root_sin"), size], "sine_term")
    floor2 = "root_squared_floor"
    versine = g.add(
        "Div", [g.add("Sub", ["one", g.add("Cos", [size], "root_cos")], "root_versine"), floor2], "cos_term"
    )
    gravity = g.add(
        "Sub",
        [g.add("Mul", [second, versine], "gravity_2"), g.add("Mul", [first, sine], "gravity_1")],
        "gravity",
    )
    joined = g.add("Concat", [gravity, rest], "encoded_3", axis=1)
    x = g.add("Reshape", [joined, g.constant("features", np.array([-1, network.config.pose_features]))], "encoded")
    positive = g.add("Relu", [g.mlp(x, network.pose_head, "pose_head")], "positive_keys")
    total = g.add("ReduceSum", [positive, axis], "key_sum", keepdims=1)
    safe = g.add("Add", [total, scalar("epsilon", NORMALIZED_RELU_EPSILON)], "key_sum_safe")
    absolute = g.add("Div", [positive, safe], "absolute_keys")
    g.add("Sub", [absolute, g.constant("rest_keys", rest_keys(network))], "keys")
    inputs = [_floats("pose", "T", 24, 3)]
    return g.model(inputs, [_floats("keys", "T", network.config.keys)], [], "DeePSD: pose to pose keys")


def rest_keys(network: Deepsd) -> NDArray[np.float32]:
    """g(rest), (P,): what is subtracted so that keys vanish at rest."""
    with torch.no_grad():
        keys: NDArray[np.float32] = network.absolute_keys(torch.zeros(1, network.config.pose_features))[0].numpy()
    return keys


def _slice(start: int, end: int) -> list[tuple[str, int]]:
    return [("start", start), ("end", end), ("axis", 1)]


def _pick_y(g: _Graph) -> list[str]:
    return [g.constant(f"y_{k}", np.array([v])) for k, v in (("start", 1), ("end", 2), ("axis", 2))]
