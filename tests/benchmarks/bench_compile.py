"""How long a compile takes and how much memory, by outfit size: `make bench` prints Markdown.

Every compile is a process of its own, as users run it. Time inside onnxruntime is measured around its `run`; the share
of its own peak is the networks' arithmetic divided by that time, against a plain large MatMul on the same machine.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.skeleton import JOINT_NAMES

SIZES = {"2k": (40, 50), "10k": (80, 125), "100k": (250, 400), "1M": (800, 1250)}
"""Rings and vertices around each."""

ANIMATED = ("2k", "10k")
SECONDS = 60
"""Of motion that these are compiled with, too: the example's, forwards and backwards."""

_MOTION = Path(__file__).parents[2] / "examples" / "motions" / "step_turn_raise.npz"

_TIMED_COMPILE = """
import json, sys, time
import onnxruntime
from garmentc.cli import main

spent = 0.0
run = onnxruntime.InferenceSession.run

def timed(self, *arguments, **options):
    global spent
    start = time.perf_counter()
    result = run(self, *arguments, **options)
    spent += time.perf_counter() - start
    return result

onnxruntime.InferenceSession.run = timed
code = main(sys.argv[2:])
json.dump(spent, open(sys.argv[1], "w"))
sys.exit(code)
"""


@dataclass(frozen=True)
class Measurement:
    """One compile. Seconds of wall time; `total` includes start-up; `processor` is the sum over all cores."""

    vertices: int
    total: float
    processor: float
    stages: dict[str, float]
    onnxruntime: float
    peak_bytes: int
    output_bytes: int


def write_tunic(path: Path, rings: int, around: int) -> None:
    """An OBJ of rings x around vertices around the trunk of the neutral body, with texture coordinates and normals."""
    body = load_default_body("neutral")
    trunk = [JOINT_NAMES.index(name) for name in ("pelvis", "spine1", "spine2", "spine3")]
    skin = body.v_template[body.weights[:, trunk].sum(axis=1) > 0.7]
    low, high = np.percentile(skin[:, 1], [10, 65])
    heights, angles = np.linspace(low, high, 24), np.linspace(-np.pi, np.pi, 36, endpoint=False)
    radii = np.array([[_radius(skin, height, angle) for angle in angles] for height in heights])
    v, u = np.linspace(0, 1, rings), np.arange(around) / around
    columns = np.array([np.interp(u * 36, np.arange(37), np.append(row, row[0])) for row in radii])
    radius = np.array([np.interp(v * 23, np.arange(24), column) for column in columns.T]).T
    angle = 2 * np.pi * u - np.pi
    direction = np.stack([np.sin(angle), np.zeros(around), np.cos(angle)], axis=1)
    points = radius[..., None] * direction + np.array([0, 1, 0]) * (low + v * (high - low))[:, None, None]
    points[..., 2] += skin[:, 2].mean()
    index = np.arange(rings * around).reshape(rings, around) + 1
    right = np.roll(index, -1, axis=1)
    quads = np.stack([index[:-1], right[:-1], right[1:], index[1:]], axis=-1).reshape(-1, 4)
    texcoords = np.stack(np.broadcast_arrays(u, v[:, None]), axis=-1).reshape(-1, 2)
    with path.open("wb") as file:
        np.savetxt(file, points.reshape(-1, 3), fmt="v %.6f %.6f %.6f")
        np.savetxt(file, texcoords, fmt="vt %.5f %.5f")
        np.savetxt(file, np.tile(direction, (rings, 1)), fmt="vn %.4f %.4f %.4f")
        np.savetxt(file, np.repeat(quads, 3, axis=1), fmt="f " + " ".join(["%d/%d/%d"] * 4))


def _radius(skin: np.ndarray, height: float, angle: float) -> float:
    """Metres from the trunk's axis to 15 mm outside the skin near a height, in the direction of an angle."""
    near = skin[np.abs(skin[:, 1] - height) < 0.04]
    turned = np.arctan2(near[:, 0], near[:, 2] - skin[:, 2].mean())
    off = np.abs((turned - angle + np.pi) % (2 * np.pi) - np.pi)
    ray = near[off < max(0.2, float(off.min()) + 1e-9)]
    return float(np.hypot(ray[:, 0], ray[:, 2] - skin[:, 2].mean()).max()) + 0.015


def write_motion(path: Path, seconds: float) -> None:
    """The example's motion to and fro, so that nothing jumps, until so much time has passed."""
    with np.load(_MOTION) as example:
        motion = dict(example)
    count = len(motion["poses"])
    frame = np.arange(round(seconds * float(motion["mocap_framerate"]))) % (2 * count - 2)
    frame = np.minimum(frame, 2 * count - 2 - frame)
    np.savez(path, **{**motion, "poses": motion["poses"][frame], "trans": motion["trans"][frame]})


def measure(outfit: Path, folder: Path, vertices: int, *options: str) -> Measurement:
    """Compile `outfit` in a new process."""
    output, spent = folder / "out.glb", folder / "onnxruntime.json"
    command = [sys.executable, "-c", _TIMED_COMPILE, str(spent), "compile", str(outfit), "-o", str(output), "--json"]
    command += options
    with (folder / "report.json").open("wb") as report:
        start = perf_counter()
        process = subprocess.Popen(command, stdout=report, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        total = perf_counter() - start
    if status:
        raise RuntimeError(f"the compile of {outfit.name} failed with status {status}")
    document = json.loads((folder / "report.json").read_text())
    stages: dict[str, float] = {}
    for stage in document["stages"]:
        stages[stage["name"]] = stages.get(stage["name"], 0.0) + stage["seconds"]
    return Measurement(
        vertices=vertices,
        total=total,
        processor=usage.ru_utime + usage.ru_stime,
        stages=stages,
        onnxruntime=json.loads(spent.read_text()),
        peak_bytes=usage.ru_maxrss * 1024,
        output_bytes=document["output"]["bytes"],
    )


def network_operations() -> int:
    """Multiplications and additions for one vertex in the shipped outfit graph: 2 for each weight of a layer."""
    from garmentc.families.bundle import load_bundle

    graph = load_bundle().outfit.graph
    sizes = {tensor.name: int(np.prod(tensor.dims)) for tensor in graph.initializer if len(tensor.dims) == 2}
    layers = [node for node in graph.node if node.op_type in ("Gemm", "MatMul")]
    return sum(2 * sizes.get(name, 0) for node in layers for name in node.input)


def matmul_peak(rows: int = 16_384, width: int = 512) -> float:
    """Operations a second of a plain MatMul in onnxruntime, the best of several."""
    import onnxruntime
    from onnx import TensorProto, helper

    def value(name: str) -> Any:
        return helper.make_tensor_value_info(name, TensorProto.FLOAT, None)

    node = helper.make_node("MatMul", ["a", "b"], ["c"])
    graph = helper.make_graph([node], "matmul", [value("a"), value("b")], [value("c")])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    feeds = {"a": np.ones((rows, width), np.float32), "b": np.ones((width, width), np.float32)}
    best = float("inf")
    for _ in range(7):
        start = perf_counter()
        session.run(None, feeds)
        best = min(best, perf_counter() - start)
    return 2 * rows * width * width / best


def help_seconds() -> float:
    """Wall time of `garmentc --help`, the best of five."""
    times = []
    for _ in range(5):
        start = perf_counter()
        subprocess.run([sys.executable, "-m", "garmentc", "--help"], stdout=subprocess.DEVNULL, check=True)
        times.append(perf_counter() - start)
    return min(times)


def main(names: list[str]) -> None:
    """Measure the sizes with the given names; all of them where there are none."""
    peak, operations = matmul_peak(), network_operations()
    print(f"`garmentc --help`: {help_seconds():.2f} s. Plain MatMul in onnxruntime: {peak / 1e9:.1f} GFLOP/s.\n")
    stages = ("read", "align", "infer", "optimise", "emit")
    header = [
        "vertices",
        "total s",
        *stages,
        "start-up",
        "CPU s",
        "onnxruntime",
        "of MatMul peak",
        "peak memory",
        "output",
    ]
    print("| " + " | ".join(header) + " |\n|" + " ---: |" * len(header))
    with tempfile.TemporaryDirectory() as name:
        for size in names or SIZES:
            rings, around = SIZES[size]
            outfit = Path(name) / f"tunic_{size}.obj"
            write_tunic(outfit, rings, around)
            found = measure(outfit, Path(name), rings * around)
            cells = [f"{found.vertices}", f"{found.total:.2f}", *(f"{found.stages[stage]:.2f}" for stage in stages)]
            cells += [f"{found.total - sum(found.stages.values()):.2f}", f"{found.processor:.2f}"]
            cells.append(f"{100 * found.onnxruntime / found.total:.0f} %")
            cells.append(f"{100 * operations * found.vertices / found.onnxruntime / peak:.0f} %")
            cells += [f"{found.peak_bytes / 2**30:.2f} GiB", f"{found.output_bytes / 2**20:.1f} MiB"]
            print("| " + " | ".join(cells) + " |", flush=True)
        write_motion(Path(name) / "motion.npz", SECONDS)
        print(f"\n| vertices | s without motion | s with {SECONDS} s of it | peak memory |\n|" + " ---: |" * 4)
        for size in (size for size in names or SIZES if size in ANIMATED):
            rings, around = SIZES[size]
            options = ((), ("--motion", str(Path(name) / "motion.npz")))
            both = [measure(Path(name) / f"tunic_{size}.obj", Path(name), rings * around, *some) for some in options]
            cells = [*(f"{found.total:.1f}" for found in both), f"{both[1].peak_bytes / 2**30:.2f} GiB"]
            print(f"| {rings * around} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
