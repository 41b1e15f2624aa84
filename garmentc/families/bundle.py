"""A model bundle: a folder with manifest.json and exported networks.

A bundle may come from anywhere, so nothing in it is trusted: the manifest is checked against its schema, every file
against its hash, and every graph for references to other files and for operators outside the ONNX standard.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.resting_layer import resting_layer
from garmentc.rig import ENCODING_WIDTHS, DenseLayer, KeyNetwork
from garmentc.schema import check_schema
from garmentc.smpl.skeleton import JOINT_COUNT

DEFAULT_BUNDLE = Path(__file__).parent.parent / "bundles" / "deepsd"
MANIFEST = "manifest.json"
_MAX_BYTES = 1 << 30


@dataclass(frozen=True)
class Bundle:
    """Exported networks, read and checked.

    manifest  the parsed manifest.json (schemas/bundle.schema.json)
    outfit    the outfit graph: a parsed onnx.ModelProto
    keys      the keys graph: its serialized bytes
    network   the pose-key network of the keys graph, in numpy
    """

    path: Path
    manifest: dict[str, Any]
    outfit: Any
    keys: bytes
    network: KeyNetwork

    @property
    def name(self) -> str:
        """Name and version, as reports show them."""
        return f"{self.manifest['name']} {self.manifest['version']}"

    @property
    def metadata(self) -> tuple[str, ...]:
        """What the numbers say that the outfit graph takes beside the mesh: "fabric:denim" and the like."""
        return tuple(self.manifest.get("metadata", ()))

    def encode_fabric(self, fabric: str | None) -> NDArray[np.float32]:
        """Those numbers (1, M) of an outfit of `fabric`, or of an unknown one: zeros.

        Raises GarmentcError where the bundle does not know the fabric.
        """
        known = [name.removeprefix("fabric:") for name in self.metadata if name.startswith("fabric:")]
        if fabric is not None and fabric not in known:
            advice = f"choose one of {', '.join(known)}" if known else "its networks were told none"
            raise GarmentcError(f"the bundle {self.name} knows no fabric '{fabric}'; {advice}, or leave --fabric out")
        return np.array([[name == f"fabric:{fabric}" for name in self.metadata]], np.float32)


def load_bundle(path: Path | None = None) -> Bundle:
    """Read and check a bundle; the one that comes with garmentc where `path` is None.

    Raises GarmentcError naming the file where anything is missing, changed or unsafe.
    """
    folder = DEFAULT_BUNDLE if path is None else Path(path)
    manifest = _read_manifest(folder / MANIFEST)
    outfit_path, keys_path = (folder / manifest["files"][part]["name"] for part in ("outfit", "keys"))
    outfit_bytes = _read_checked(outfit_path, manifest["files"]["outfit"]["sha256"])
    keys_bytes = _read_checked(keys_path, manifest["files"]["keys"]["sha256"])
    outfit, keys = _parse(outfit_path, outfit_bytes), _parse(keys_path, keys_bytes)
    return Bundle(folder, manifest, outfit, keys_bytes, _key_network(keys, manifest, keys_path))


def _read_manifest(path: Path) -> dict[str, Any]:
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise GarmentcError("no such file; a model bundle is a folder with a manifest.json", path) from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        line = getattr(error, "lineno", None)
        raise GarmentcError(f"not a readable bundle manifest: {error}", path, line) from None
    check_schema(manifest, "bundle", path)
    assert isinstance(manifest, dict)
    return manifest


def _read_checked(path: Path, sha256: str) -> bytes:
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise GarmentcError("larger than 1 GiB; this is not a bundle's network", path)
        data = path.read_bytes()
    except OSError as error:
        reason = error.strerror or error
        raise GarmentcError(f"the bundle's manifest names this file, but it cannot be read: {reason}", path) from None
    found = hashlib.sha256(data).hexdigest()
    if found != sha256:
        raise GarmentcError(
            f"changed since the bundle was made (SHA-256 {found[:12]}…, the manifest says {sha256[:12]}…); "
            "get the bundle again",
            path,
        )
    return data


def _parse(path: Path, data: bytes) -> Any:
    """The ONNX model in `data`, refused where it refers to other files or to operators outside the standard."""
    import onnx
    from google.protobuf.message import DecodeError  # type: ignore[import-untyped]

    try:
        model = onnx.load_model_from_string(data)
    except (DecodeError, ValueError):
        raise GarmentcError("not an ONNX model; export the bundle again", path) from None
    for tensor in _tensors(model.graph):
        if tensor.data_location == onnx.TensorProto.EXTERNAL or tensor.external_data:
            raise GarmentcError(
                f"tensor '{tensor.name}' keeps its data in another file, which is not read; "
                "export the bundle with all data inside the graph",
                path,
            )
    foreign = {opset.domain for opset in model.opset_import} - {"", "ai.onnx"}
    if foreign or model.functions:
        raise GarmentcError(f"uses operators outside the ONNX standard ({', '.join(sorted(foreign))})", path)
    return model


def _tensors(graph: Any) -> list[Any]:
    tensors = [*graph.initializer]
    for sparse in graph.sparse_initializer:
        tensors += [sparse.values, sparse.indices]
    for node in graph.node:
        for attribute in node.attribute:
            tensors += [attribute.t, *attribute.tensors]
            for sparse in (attribute.sparse_tensor, *attribute.sparse_tensors):
                tensors += [sparse.values, sparse.indices]
            for sub in (attribute.g, *attribute.graphs):
                if sub.node or sub.initializer:
                    tensors += _tensors(sub)
    return tensors


def _key_network(model: Any, manifest: dict[str, Any], path: Path) -> KeyNetwork:
    from onnx import numpy_helper

    constants = {tensor.name: tensor for tensor in model.graph.initializer}

    def constant(name: str, dimensions: int) -> NDArray[np.float32]:
        if name not in constants:
            raise GarmentcError(f"has no constant '{name}', which the manifest names", path)
        value: NDArray[np.float32] = numpy_helper.to_array(constants[name])
        if value.ndim != dimensions or value.dtype != np.float32 or not np.isfinite(value).all():
            raise GarmentcError(f"constant '{name}' is not {dimensions}-D float32 of finite numbers", path)
        return value

    layers = tuple(
        DenseLayer(constant(entry["weight"], 2), constant(entry["bias"], 1), entry["activation"])
        for entry in manifest["key_layers"]
    )
    rest = constant(manifest["rest_keys"], 1)
    encoding = manifest["pose_encoding"]
    sizes = [ENCODING_WIDTHS[encoding], *(len(layer.bias) for layer in layers)]
    for inputs, outputs, layer in zip(sizes[:-1], sizes[1:], layers, strict=True):
        if layer.weight.shape != (outputs, inputs):
            raise GarmentcError(
                f"the pose-key network's layers do not fit each other: {layer.weight.shape[0]}x{layer.weight.shape[1]} "
                f"where {outputs}x{inputs} is needed",
                path,
            )
    if {sizes[-1], len(rest)} != {manifest["keys"]}:
        raise GarmentcError(
            f"makes {sizes[-1]} keys and has {len(rest)} at rest, but the manifest says {manifest['keys']}", path
        )
    at_rest = KeyNetwork(layers, encoding)(np.zeros((JOINT_COUNT, 3)))
    if not np.allclose(rest, at_rest, rtol=1e-3, atol=1e-5):
        raise GarmentcError(
            f"constant '{manifest['rest_keys']}' is not what the keys are at rest; export it again", path
        )
    return KeyNetwork((*layers, resting_layer(np.eye(len(rest)), at_rest)), encoding)
