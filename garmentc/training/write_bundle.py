"""Write a trained network as a model bundle."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from garmentc.families.bundle import MANIFEST
from garmentc.key_graph import REST_KEYS, layer_constants
from garmentc.output import cannot_write, written_whole
from garmentc.smpl.default_body import DEFAULT_BODY_PATH
from garmentc.training.deepsd_network import Deepsd
from garmentc.training.export_deepsd import key_network, keys_graph, outfit_graph


def write_bundle(
    network: Deepsd,
    folder: Path,
    *,
    version: str,
    description: str,
    training: dict[str, Any],
    metadata: Sequence[str] = (),
) -> None:
    """Write outfit.onnx, keys.onnx and manifest.json. The same weights and record give the same bytes.

    metadata  what the numbers say that the network is told of an outfit (`garmentc.training.metadata.metadata_names`)

    Raises GarmentcError where the network is a variant that no rig can express, or a file cannot be written.
    """
    graphs = {"outfit": outfit_graph(network), "keys": keys_graph(network)}
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot_write(folder, error) from error
    files = {}
    for part, data in graphs.items():
        path = folder / f"{part}.onnx"
        with written_whole(path) as file:
            file.write(data)
        files[part] = {"name": path.name, "sha256": hashlib.sha256(data).hexdigest()}
    keys = key_network(network)
    layers = keys.layers
    manifest = {
        "schema": 1,
        "name": "garmentc-deepsd",
        "version": version,
        "family": "deepsd",
        "description": description,
        "licence": "CC0-1.0",
        "files": files,
        "units": "metre",
        "pose_encoding": keys.encoding,
        "joints": network.config.joints,
        "keys": len(layers[-1].bias),
        "key_layers": [
            {"weight": weight, "bias": bias, "activation": layer.activation}
            for (weight, bias), layer in zip(map(layer_constants, range(len(layers))), layers, strict=True)
        ],
        "rest_keys": REST_KEYS,
        **({"metadata": list(metadata)} if metadata else {}),
        "body": {"name": "default", "sha256": hashlib.sha256(DEFAULT_BODY_PATH.read_bytes()).hexdigest()},
        "training": training,
    }
    text = json.dumps(manifest, indent=2, ensure_ascii=False) + "\n"
    with written_whole(folder / MANIFEST) as file:
        file.write(text.encode())
