"""A page with a viewer: one file that opens from disk, with the outfit, the body and three.js inside."""

from __future__ import annotations

import base64
import html
import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.glb_asset import GlbAsset
from garmentc.gltf.inspect import GlbSummary, inspect_glb
from garmentc.gltf.posing import pose_key_network, smpl_joints
from garmentc.output import written_whole
from garmentc.preview.poses import telling_poses
from garmentc.smpl.body import BodyModel
from garmentc.smpl.skeleton import JOINT_COUNT, JOINT_NAMES

_VIEWER = Path(__file__).with_name("viewer")
_RUNTIME = Path(__file__).parents[2] / "examples" / "runtime"
"""Where the pose-key runtime lies in a checkout; an installed package has it in _VIEWER."""

_MODULES = {
    "three": "three.bundle.js",
    "garmentc/pose_keys": "pose_keys.js",
    "garmentc/runtime": "three_adapter.js",
    "garmentc/body": "body.js",
    "garmentc/controls": "controls.js",
    "garmentc/stage": "stage.js",
    "garmentc/figure": "figure.js",
    "garmentc/viewer": "viewer.js",
}
"""Files by the names that the page imports them by."""

_INFLUENCES = 4
_LEAST = 1e-4
"""Metres per unit of a rotation matrix: pose correctives that move a vertex by less are left out of a page."""


def write_page(asset: GlbAsset, body: BodyModel | None, betas: NDArray[Any] | None, path: Path) -> int:
    """Write the page; returns its size in bytes.

    body, betas  what wears the outfit; None shows the outfit alone, or with the body that the file brings
    Raises GarmentcError where the asset has no SMPL joints, or the page cannot be written.
    """
    content = {
        "name": asset.path.stem,
        "joints": smpl_joints(asset),
        "jointNames": JOINT_NAMES,
        "poses": {
            "rest": np.zeros((JOINT_COUNT, 3)).tolist(),
            **{name: pose.round(5).tolist() for name, pose in telling_poses().items()},
        },
        "weights": _weight_range(asset),
        "facts": _facts(inspect_glb(asset), body),
        "body": None if body is None else _body(body, betas),
    }
    parts = {
        "title": html.escape(asset.path.stem),
        "style": (_VIEWER / "style.css").read_text(encoding="utf-8"),
        "imports": json.dumps({"imports": {name: _module(file) for name, file in _MODULES.items()}}),
        "content": json.dumps(content, ensure_ascii=False).replace("<", "\\u003c"),  # no tag may end the element
        "asset": _base64(asset.path.read_bytes()),
    }
    frame = (_VIEWER / "page.html").read_text(encoding="utf-8")
    data = re.sub(rf"\{{({'|'.join(parts)})\}}", lambda place: parts[place[1]], frame).encode("utf-8")
    with written_whole(path) as file:
        file.write(data)
    return len(data)


def _module(name: str) -> str:
    """A JavaScript file as a data URL. Such a module knows no relative paths, so it imports by name."""
    file = _VIEWER / name
    text = (file if file.exists() else _RUNTIME / name).read_text(encoding="utf-8")
    text = text.replace("from './pose_keys.js'", "from 'garmentc/pose_keys'")
    return "data:text/javascript;base64," + _base64(text.encode("utf-8"))


def _body(body: BodyModel, betas: NDArray[Any] | None) -> dict[str, Any]:
    """The body's arrays as viewer/body.js reads them: little-endian, in base64."""
    strongest = np.argsort(-body.weights, axis=1, kind="stable")[:, :_INFLUENCES]
    weights = np.take_along_axis(body.weights, strongest, axis=1)
    corrected, directions = [], []
    for moved, block in zip(body.correctives.vertices, body.correctives.directions, strict=True):
        kept = np.abs(block).max(axis=(0, 2), initial=0.0) > _LEAST
        corrected.append(moved[kept])
        directions.append(block[:, kept].transpose(1, 2, 0).reshape(-1, 27))  # vertex, axis, entry of R - I
    every = np.concatenate(directions)
    step = max(float(np.abs(every).max(initial=0.0)), 1e-9) / 32767
    return {
        "vertices": _array(body.shaped(betas), "<f4"),
        "faces": _array(body.faces, "<u4"),
        "joints": _array(strongest, "u1"),
        "weights": _array(weights / weights.sum(axis=1, keepdims=True), "<f4"),
        "places": body.joints(betas).round(6).tolist(),
        "corrected": _array(np.concatenate(corrected), "<u2"),
        "counts": [len(part) for part in corrected],
        "directions": _array((every / step).round(), "<i2"),
        "step": step,
    }


def _weight_range(asset: GlbAsset) -> tuple[float, float]:
    """Ends of the sliders of the morph weights: 0 and 1 as the compiler keeps them, else (profile reference) wider."""
    morphed = [node for node in asset.outfit_nodes if asset.meshes[asset.nodes[node].mesh or 0].morph_count]
    networks = [pose_key_network(asset, node) for node in morphed]
    within = all(network is not None and network.layers[-1].activation == "nonnegative" for network in networks)
    return (0.0, 1.0) if within else (-2.0, 2.0)


def _facts(summary: GlbSummary, body: BodyModel | None) -> list[tuple[str, str]]:
    """Names and values of the table of statistics."""
    materials = {primitive.material for primitive in summary.primitives}
    sizes = [f"{image.width} x {image.height}" for image in summary.images]
    facts = [
        ("file size", f"{summary.bytes / 2**20:.2f} MiB"),
        ("vertices", f"{sum(primitive.vertices for primitive in summary.primitives):,}"),
        ("triangles", f"{sum(primitive.triangles for primitive in summary.primitives):,}"),
        ("materials", str(len(materials))),
        ("textures", ", ".join(f"{count} of {size}" for size, count in Counter(sizes).items()) or "none"),
        ("joints", f"{summary.joints}, up to {max((p.influences for p in summary.primitives), default=0)} on a vertex"),
        ("morph targets", str(len(summary.morphs))),
    ]
    facts += [("pose-key network", " - ".join(map(str, network.layers))) for network in summary.pose_keys]
    facts += [("animation", f"{entry.seconds:.2f} s, {entry.name}") for entry in summary.animations]
    facts += [("body", body.name)] if body is not None else []
    facts += [("extensions", "\n".join(summary.extensions) or "none"), ("made by", summary.generator)]
    return facts


def _array(values: NDArray[Any], dtype: str) -> str:
    return _base64(np.ascontiguousarray(values, dtype=dtype).tobytes())


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
