"""The pose-key network as an ONNX graph, for programs that would rather run ONNX than read the glTF extension."""

from __future__ import annotations

from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.output import written_whole
from garmentc.rig import ENCODING_GRAVITY_JOINTS, NORMALIZED_RELU_EPSILON, KeyNetwork
from garmentc.smpl.skeleton import JOINT_COUNT, PARENTS

OPSET, IR_VERSION = 18, 9


def write_key_graph(network: KeyNetwork, path: str | PathLike[str]) -> None:
    """Write `key_graph`. Raises GarmentcError where the file cannot be written."""
    data = key_graph(network)
    with written_whole(path) as file:
        file.write(data)


REST_KEYS = "rest_keys"


def layer_constants(index: int) -> tuple[str, str]:
    """Names of the constants that hold the weight and the bias of a layer."""
    return f"layer_{index}.weight", f"layer_{index}.bias"


def key_graph(network: KeyNetwork, rest_keys: NDArray[Any] | None = None) -> bytes:
    """An ONNX model: pose (T, 24, 3) axis-angle in radians → keys (T, M), float32. Equal networks give equal bytes.

    rest_keys  (M,) subtracted last, where the network itself does not vanish at rest; the constant REST_KEYS
    """
    from onnx import TensorProto, checker, helper

    graph = _Graph()
    x = _encoded(graph, network.encoding)
    for index, layer in enumerate(network.layers):
        name = f"layer_{index}"
        values = (layer.weight, layer.bias)
        weight, bias = map(graph.constant, layer_constants(index), values)
        x = graph.add("Gemm", [x, weight, bias], name, transB=1)
        if layer.activation in ("relu", "normalized_relu"):
            x = graph.add("Relu", [x], f"{name}.relu")
        if layer.activation == "normalized_relu":
            total = graph.add("ReduceSum", [x, "last_axis"], f"{name}.sum", keepdims=1)
            floor = graph.add(
                "Add", [total, graph.constant(f"{name}.epsilon", [NORMALIZED_RELU_EPSILON])], f"{name}.floor"
            )
            x = graph.add("Div", [x, floor], f"{name}.normalized")
        if layer.activation == "nonnegative":
            least = graph.add("ReduceMin", [x, "last_axis"], f"{name}.least", keepdims=1)
            x = graph.add("Sub", [x, least], f"{name}.nonnegative")
    if rest_keys is None:
        graph.add("Identity", [x], "keys")
    else:
        graph.add("Sub", [x, graph.constant(REST_KEYS, rest_keys)], "keys")
    pose = helper.make_tensor_value_info("pose", TensorProto.FLOAT, ["T", JOINT_COUNT, 3])
    keys = helper.make_tensor_value_info("keys", TensorProto.FLOAT, ["T", network.output_size])
    body = helper.make_graph(graph.nodes, "pose_keys", [pose], [keys], graph.constants)
    model = helper.make_model(body, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    model.producer_name = "garmentc"
    checker.check_model(model, full_check=True)
    data: bytes = model.SerializeToString(deterministic=True)
    return data


class _Graph:
    """Nodes and constants of a graph under construction."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def constant(self, name: str, value: Any, dtype: type[np.generic] = np.float32) -> str:
        from onnx import numpy_helper

        self.constants.append(numpy_helper.from_array(np.ascontiguousarray(value, dtype), name))
        return name

    def add(self, operator: str, inputs: list[str], output: str, **attributes: Any) -> str:
        from onnx import helper

        self.nodes.append(helper.make_node(operator, inputs, [output], name=output, **attributes))
        return output


def _encoded(graph: _Graph, encoding: str) -> str:
    """garmentc.rig.encode_pose: (T, 24, 3) to (T, ENCODING_WIDTHS[encoding])."""
    axis = graph.constant("last_axis", [-1], np.int64)
    squares = graph.add("ReduceSumSquare", ["pose", axis], "squares", keepdims=1)
    angle = graph.add("Sqrt", [graph.add("Max", [squares, graph.constant("tiny", [1e-12])], "squares_floor")], "angle")
    # The shorter way round: the angle less whole turns, in [-pi, pi].
    half_turns = graph.add("Add", [angle, graph.constant("pi", [np.pi])], "angle_and_half_turn")
    turns = graph.add(
        "Floor", [graph.add("Div", [half_turns, graph.constant("two_pi", [2 * np.pi])], "turns")], "whole"
    )
    excess = graph.add("Div", [graph.add("Mul", [turns, "two_pi"], "excess_angle"), angle], "excess")
    short = graph.add("Mul", ["pose", graph.add("Sub", [graph.constant("one", [1.0]), excess], "share")], "short_pose")
    root, others = (_slice(graph, short, 1, *span) for span in ((0, 1), (1, JOINT_COUNT)))
    if encoding == ENCODING_GRAVITY_JOINTS:
        gravity = _gravity_in_joints(graph, short)
        both = [_slice(graph, gravity, 1, 1, JOINT_COUNT), others]
        parts = [_slice(graph, gravity, 1, 0, 1), graph.add("Concat", both, "joint_pairs", axis=2)]
        flat = [graph.add("Flatten", [part], f"{part}.flat") for part in parts]
        return graph.add("Concat", flat, "encoded", axis=1)
    joined = graph.add("Concat", [_gravity(graph, root), others], "encoded_joints", axis=1)
    return graph.add("Reshape", [joined, graph.constant("encoded_shape", [-1, 3 * JOINT_COUNT], np.int64)], "encoded")


def _rodrigues_terms(graph: _Graph, vectors: str) -> tuple[str, str, str]:
    """a^2, sin a / a and (1 - cos a) / a^2 of axis-angles (..., 3) of length a, each (..., 1)."""
    squares = graph.add("ReduceSumSquare", [vectors, "last_axis"], "rotation_squares", keepdims=1)
    floor = graph.add("Max", [squares, "tiny"], "rotation_squares_floor")
    angle = graph.add("Sqrt", [floor], "rotation_angle")
    sine = graph.add("Div", [graph.add("Sin", [angle], "sine"), angle], "sine_term")
    versine = graph.add("Sub", ["one", graph.add("Cos", [angle], "cosine")], "versine")
    return squares, sine, graph.add("Div", [versine, floor], "versine_term")


def _gravity(graph: _Graph, root: str) -> str:
    """Up seen from the pelvis, minus up, from the pelvis' axis-angle r (T, 1, 3) of length a.

    Rodrigues' formula for R(-r) y - y:  (1 - cos a) / a^2 (r x (r x y)) - sin a / a (r x y)
    """
    squares, sine, versine = _rodrigues_terms(graph, root)
    cross = graph.add("MatMul", [root, graph.constant("cross_up", [[0, 0, 1], [0, 0, 0], [-1, 0, 0]])], "cross")
    along = graph.add("Mul", [root, _slice(graph, root, 2, 1, 2)], "along")  # r (r . y)
    upward = graph.add("Mul", [squares, graph.constant("up", [0, 1, 0])], "upward")  # (r . r) y
    twice = graph.add("Sub", [along, upward], "cross_cross")
    first, second = graph.add("Mul", [cross, sine], "first"), graph.add("Mul", [twice, versine], "second")
    return graph.add("Sub", [second, first], "gravity")


def _gravity_in_joints(graph: _Graph, short: str) -> str:
    """Up seen from every joint, minus up, (T, 24, 3), from axis-angles r (T, 24, 3) of length a.

    Rodrigues' formula for all local rotations at once, R = 1 + sin a / a K + (1 - cos a) / a^2 K^2 with K the matrix of
    r x; then, level by level of the tree, up in the joint is up in its parent times R: a row vector turned back.
    """
    _, sine, versine = _rodrigues_terms(graph, short)
    as_matrices = graph.constant("matrices", [0, JOINT_COUNT, 3, 3], np.int64)
    as_factors = graph.constant("factors", [0, JOINT_COUNT, 1, 1], np.int64)
    numbers = graph.add("MatMul", [short, graph.constant("cross_matrix", _CROSS_MATRIX)], "cross_numbers")
    cross = graph.add("Reshape", [numbers, as_matrices], "joint_cross")
    sine, versine = (graph.add("Reshape", [term, as_factors], f"{term}.factor") for term in (sine, versine))
    first = graph.add("Mul", [cross, sine], "joint_first")
    second = graph.add("Mul", [graph.add("MatMul", [cross, cross], "joint_cross_cross"), versine], "joint_second")
    turn = graph.add("Add", [graph.constant("identity", np.eye(3)), first], "joint_first_order")
    turn = graph.add("Add", [turn, second], "joint_matrix")
    levels = [np.array([0])]
    while len(children := np.flatnonzero(np.isin(PARENTS, levels[-1]))):
        levels.append(children)
    assert np.array_equal(np.concatenate(levels), np.arange(JOINT_COUNT)), "joints come level by level"
    up, found = graph.constant("up_row", [[[[0, 1, 0]]]]), []
    for depth, level in enumerate(levels):
        if depth:
            above = np.searchsorted(levels[depth - 1], PARENTS[level])
            up = graph.add(
                "Gather", [up, graph.constant(f"parents_{depth}", above, np.int64)], f"above_{depth}", axis=1
            )
        chosen = graph.constant(f"level_{depth}", level, np.int64)
        local = graph.add("Gather", ["joint_matrix", chosen], f"local_{depth}", axis=1)
        up = graph.add("MatMul", [up, local], f"up_{depth}")
        found.append(up)
    rows = graph.add("Concat", found, "up_rows", axis=1)
    seen = graph.add("Reshape", [rows, graph.constant("vectors", [0, JOINT_COUNT, 3], np.int64)], "up_in_joints")
    return graph.add("Sub", [seen, graph.constant("up", [0, 1, 0])], "joint_gravity")


_CROSS_MATRIX = np.array(
    [[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]], np.float32
)
"""(3, 9): a vector r times this is the matrix of r x, row after row."""


def _slice(graph: _Graph, x: str, axis: int, start: int, end: int) -> str:
    name = f"{x}[{start}:{end}]"
    bounds = [graph.constant(f"{name}.{word}", [value], np.int64) for word, value in
              (("start", start), ("end", end), ("axis", axis))]  # fmt: skip
    return graph.add("Slice", [x, *bounds], name)
