"""Write a trained network as a model bundle."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from garmentc.families.bundle import MANIFEST
from garmentc.rig import ENCODING_GRAVITY_AXIS_ANGLE
from garmentc.smpl.default_body import DEFAULT_BODY_PATH
from garmentc.training.deepsd_network import Deepsd
from garmentc.training.export_deepsd import keys_graph, outfit_graph


def write_bundle(network: Deepsd, folder: Path, *, version: str, description: str, training: dict[str, Any]) -> None:
    """Write outfit.onnx, keys.onnx and manifest.json. The same weights and record give the same bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    files = {}
    for part, data in (("outfit", outfit_graph(network)), ("keys", keys_graph(network))):
        path = folder / f"{part}.onnx"
        path.write_bytes(data)
        files[part] = {"name": path.name, "sha256": hashlib.sha256(data).hexdigest()}
    count = len(network.config.pose_head) + 1
    manifest = {
        "schema": 1,
        "name": "garmentc-deepsd",
        "version": version,
        "family": "deepsd",
        "description": description,
        "licence": "CC0-1.0",
        "files": files,
        "units": "metre",
        "pose_encoding": ENCODING_GRAVITY_AXIS_ANGLE,
        "joints": network.config.joints,
        "keys": network.config.keys,
        "key_layers": [
            {
                "weight": f"pose_head.{k}.weight",
                "bias": f"pose_head.{k}.bias",
                "activation": "relu" if k < count - 1 else "normalized_relu",
            }
            for k in range(count)
        ],
        "rest_keys": "rest_keys",
        "body": {"name": "default", "sha256": hashlib.sha256(DEFAULT_BODY_PATH.read_bytes()).hexdigest()},
        "training": training,
    }
    text = json.dumps(manifest, indent=2, ensure_ascii=False) + "\n"
    (folder / MANIFEST).write_text(text, encoding="utf-8")
