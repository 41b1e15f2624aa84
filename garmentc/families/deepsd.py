"""DeePSD (Bertiche et al. 2021): a bundle's outfit graph, run once, makes the rig of any outfit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.families.bundle import Bundle
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
from garmentc.families.held_cloth import HeldCloth
from garmentc.rig import Rig
from garmentc.smpl.skeleton import JOINT_COUNT

MAX_GATHERED = 65_536 * 8
"""Vertices times neighbours that the encoder takes at once; this bounds its memory (about 0.3 GB)."""

MAX_DECODED = 16_384
"""Vertices that the heads take at once; more is no faster."""


@dataclass(frozen=True)
class _Sessions:
    encoder: Any
    pool: Any
    heads: Any


def infer(
    bundle: Bundle,
    vertices: NDArray[Any],
    normals: NDArray[Any],
    triangles: NDArray[np.int32],
    edges: NDArray[np.int32],
    joints: NDArray[Any],
    cloth: HeldCloth,
    fabric: str | None = None,
    threads: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Rig:
    """The rig of an outfit at rest on its body.

    vertices, normals  (N, 3) metres, in the body's axes; normals unit length
    triangles          (F, 3)
    edges              (E, 2) unique undirected edges
    joints             (24, 3) rest joints of the body
    cloth              what the body holds of the outfit
    fabric             of the outfit; None is unknown
    threads            for onnxruntime; 0 is its own choice
    progress           called with vertices done and vertices in all

    The encoder reaches four edges far, so a large outfit is encoded in patches with a rim of four edges, and the
    global maximum is taken over the patches: the result does not depend on the patches, memory does.
    Raises GarmentcError where the bundle's graph is not a DeePSD graph, or makes NaN or infinity, or where it does not
    know the fabric.
    """
    sessions = _sessions(bundle, threads)
    count = len(vertices)
    inputs = np.asarray(vertices, np.float32), np.asarray(normals, np.float32)
    held = cloth.features
    adjacency = _adjacency(edges, count)
    local: NDArray[np.float32] | None = None
    pooled: NDArray[np.float32] | None = None
    for rows, patch in _patches(adjacency, count):
        table = _neighbor_table(adjacency, patch)
        feeds = {VERTICES: inputs[0][patch], NORMALS: inputs[1][patch], NEIGHBORS: table, HELD: held[patch]}
        encoded, candidates = sessions.encoder.run([LOCAL, CANDIDATES], feeds)
        inner = slice(0, len(rows))  # the rim stands behind the rows that count
        if local is None:
            local = np.empty((count, encoded.shape[1]), np.float32)
        local[rows] = encoded[inner]
        best = sessions.pool.run([GLOBAL], {CANDIDATES: candidates[inner]})[0]
        pooled = best if pooled is None else np.maximum(pooled, best)
    if local is None or pooled is None:
        raise GarmentcError("the outfit has no vertices")
    shared = {GLOBAL: pooled} | ({METADATA: bundle.encode_fabric(fabric)} if bundle.metadata else {})
    weights = np.empty((count, JOINT_COUNT), np.float32)
    shapes = np.empty((bundle.manifest["keys"], count, 3), np.float32)
    for start in range(0, count, MAX_DECODED):
        piece = slice(start, start + MAX_DECODED)
        feeds = {LOCAL: local[piece], HELD: held[piece], SKIN: cloth.skin[piece], **shared}
        weights[piece], decoded = sessions.heads.run([WEIGHTS, SHAPES], feeds)
        shapes[:, piece] = decoded.transpose(1, 0, 2)
        _check_finite(bundle, weights[piece], decoded)
        progress(min(start + MAX_DECODED, count), count)
    return Rig(np.asarray(vertices), triangles, np.asarray(joints), weights, shapes, bundle.network)


def _sessions(bundle: Bundle, threads: int) -> _Sessions:
    import onnx
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 4
    # Threads that wait for work in a loop take the cores from those that have some: a third more time on two.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    path = bundle.path / bundle.manifest["files"]["outfit"]["name"]
    names = {value.name for value in (*bundle.outfit.graph.input, *bundle.outfit.graph.output)}
    told = [METADATA] if bundle.metadata else []
    missing = {VERTICES, NORMALS, NEIGHBORS, HELD, SKIN, WEIGHTS, SHAPES, *told} - names
    if missing:
        raise GarmentcError(
            f"the outfit graph has no input or output named {', '.join(sorted(missing))}; export the bundle again", path
        )
    cuts = (
        ([VERTICES, NORMALS, NEIGHBORS, HELD], [LOCAL, CANDIDATES]),
        ([CANDIDATES], [GLOBAL]),
        ([LOCAL, GLOBAL, HELD, SKIN, *told], [WEIGHTS, SHAPES]),
    )
    try:
        extractor = onnx.utils.Extractor(bundle.outfit)
        parts = [extractor.extract_model(*cut).SerializeToString() for cut in cuts]
        made = [onnxruntime.InferenceSession(part, options, providers=["CPUExecutionProvider"]) for part in parts]
    except Exception as error:  # onnx and onnxruntime raise a dozen unrelated types for a graph they cannot use
        raise GarmentcError(f"onnxruntime cannot use the outfit graph: {str(error).splitlines()[0]}", path) from error
    return _Sessions(*made)


def _check_finite(bundle: Bundle, weights: NDArray[np.float32], shapes: NDArray[np.float32]) -> None:
    """Training that diverged leaves a graph that loads and runs; what it makes must not reach a file."""
    for name, made in ((WEIGHTS, weights), (SHAPES, shapes)):
        if not np.isfinite(made).all():
            path = bundle.path / bundle.manifest["files"]["outfit"]["name"]
            raise GarmentcError(
                f"the outfit graph makes '{name}' that are NaN or infinite; train the bundle again", path
            )


def _adjacency(edges: NDArray[np.int32], count: int) -> Any:
    from scipy import sparse

    both = np.concatenate([edges, edges[:, ::-1]])
    matrix = sparse.csr_matrix((np.ones(len(both), np.int8), (both[:, 0], both[:, 1])), shape=(count, count))
    matrix.sort_indices()
    return matrix


def _patches(adjacency: Any, count: int) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Rows to encode and, after them in one array, the rim of four edges that their descriptors depend on."""
    degree = int(np.diff(adjacency.indptr).max(initial=1))
    if count * degree <= MAX_GATHERED:
        everything = np.arange(count)
        yield everything, everything
        return
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    order = reverse_cuthill_mckee(adjacency, symmetric_mode=True)
    mark = np.zeros(count, bool)
    degrees = np.diff(adjacency.indptr)
    stack = [(start, min(start + 32_768, count)) for start in range(0, count, 32_768)][::-1]
    while stack:
        first, last = stack.pop()
        rows = np.sort(order[first:last])
        patch = _with_rim(adjacency, rows, mark)
        if len(patch) * int(degrees[patch].max(initial=1)) > MAX_GATHERED and last - first > 1024:
            middle = (first + last) // 2
            stack += [(middle, last), (first, middle)]
            continue
        yield rows, patch


def _with_rim(adjacency: Any, rows: NDArray[np.intp], mark: NDArray[np.bool_]) -> NDArray[np.intp]:
    mark[rows] = True
    rim, parts = rows, [rows]
    for _ in range(4):
        around = np.unique(adjacency[rim].indices)
        rim = around[~mark[around]]
        mark[rim] = True
        parts.append(rim)
    patch = np.concatenate(parts)
    mark[patch] = False
    return patch


def _neighbor_table(adjacency: Any, patch: NDArray[np.intp]) -> NDArray[np.int64]:
    """(n, K): for each vertex of the patch its neighbours as rows of the patch, padded with n."""
    size = len(patch)
    place = np.full(adjacency.shape[0], size, np.int64)
    place[patch] = np.arange(size)
    rows = adjacency[patch]
    degrees = np.diff(rows.indptr)
    table = np.full((size, int(degrees.max(initial=1))), size, np.int64)
    owner = np.repeat(np.arange(size), degrees)
    slot = np.arange(len(rows.indices)) - np.repeat(rows.indptr[:-1], degrees)
    table[owner, slot] = place[rows.indices]
    return table
