"""What training holds of one outfit, and the bodies it is posed on."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy import sparse
from torch import Tensor

from garmentc.families.held_cloth import held_cloth
from garmentc.outfit.topology import edges as unique_edges
from garmentc.outfit.topology import vertex_normals
from garmentc.smpl.body import BodyModel
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skinning import joint_transforms, skin


@dataclass(frozen=True)
class OutfitSample:
    """One outfit at rest on its body, as tensors.

    vertices, normals  (N, 3) float32
    triangles, edges   (F, 3), (E, 2) int64
    rest_lengths       (E,) metres
    counts             (N,) neighbours of each vertex
    mean               (N, N) sparse: the mean over neighbours
    held               (N, 2) firmness and held of `garmentc.families.held_cloth`
    skin               (N, 24) blend weights of the nearest skin, which the network also starts towards
    body               the body it was made for, shape baked in, float32
    """

    name: str
    vertices: Tensor
    normals: Tensor
    triangles: Tensor
    edges: Tensor
    rest_lengths: Tensor
    counts: Tensor
    mean: Tensor
    held: Tensor
    skin: Tensor
    body: PosableBody

    @property
    def seen(self) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        """What the network's descriptors are made of."""
        return self.vertices, self.normals, self.mean, self.held, self.skin

    def to(self, device: torch.device) -> OutfitSample:
        """The same with its tensors on `device`."""
        tensors: dict[str, Any] = {
            name: value.to(device) for name, value in vars(self).items() if isinstance(value, Tensor)
        }
        return replace(self, **tensors)


@dataclass(frozen=True)
class PosableBody:
    """A body of fixed shape `betas` that is posed often: vertices (V, 3), weights (V, 24), all float32."""

    vertices: NDArray[Any]
    faces: NDArray[np.int32]
    joints: NDArray[Any]
    weights: NDArray[Any]
    model: BodyModel
    betas: NDArray[Any]

    @staticmethod
    def of(model: BodyModel, betas: NDArray[Any]) -> PosableBody:
        small = model.astype(np.float32)
        return PosableBody(small.shaped(betas), small.faces, small.joints(betas), small.weights, small, betas)

    def transforms(self, poses: NDArray[Any]) -> NDArray[Any]:
        """Joint transforms (T, 24, 4, 4) of poses (T, 24, 3)."""
        return joint_transforms(axis_angle_to_matrix(poses.astype(np.float32)), self.joints)

    def posed(self, poses: NDArray[Any], transforms: NDArray[Any]) -> NDArray[Any]:
        """Body vertices (T, V, 3), pose correctives on."""
        rotations = axis_angle_to_matrix(poses.astype(np.float32))
        vertices = np.repeat(self.vertices[None], len(poses), axis=0)
        self.model.correctives.add_to(vertices, rotations)
        posed: NDArray[Any] = skin(vertices, self.weights, transforms)
        return posed


def body_normals(vertices: NDArray[Any], faces: NDArray[np.int32]) -> NDArray[Any]:
    """Area-weighted unit normals (T, V, 3) of posed bodies (T, V, 3)."""
    a, b, c = (vertices[:, faces[:, k]] for k in range(3))
    face = np.cross(b - a, c - a)
    count = vertices.shape[1]
    rows = faces.T.ravel()
    gather = sparse.csr_matrix(
        (np.ones(len(rows), np.float32), (rows, np.tile(np.arange(len(faces)), 3))), shape=(count, len(faces))
    )
    total = np.stack([gather @ f for f in face])
    unit: NDArray[Any] = total / np.maximum(np.linalg.norm(total, axis=-1, keepdims=True), 1e-12)
    return unit


def make_sample(
    name: str,
    vertices: NDArray[Any],
    triangles: NDArray[np.int32],
    body: PosableBody,
) -> OutfitSample:
    """Precompute everything about an outfit that does not change in training."""
    edges = unique_edges(triangles)
    count = len(vertices)
    both = np.concatenate([edges, edges[:, ::-1]])
    adjacency = sparse.csr_matrix((np.ones(len(both), np.float32), (both[:, 0], both[:, 1])), shape=(count, count))
    degree = np.asarray(adjacency.sum(axis=1)).ravel()
    mean = sparse.diags(1 / np.maximum(degree, 1)) @ adjacency
    mean = mean.tocsr().astype(np.float32)
    mean.sort_indices()
    cloth = held_cloth(vertices, edges, body.model, body.betas)
    points = torch.from_numpy(np.asarray(vertices, np.float32))
    edge_tensor = torch.from_numpy(edges.astype(np.int64))
    return OutfitSample(
        name=name,
        vertices=points,
        normals=torch.from_numpy(vertex_normals(vertices, triangles).astype(np.float32)),
        triangles=torch.from_numpy(triangles.astype(np.int64)),
        edges=edge_tensor,
        rest_lengths=(points[edge_tensor[:, 0]] - points[edge_tensor[:, 1]]).norm(dim=1),
        counts=torch.from_numpy(degree.astype(np.float32)),
        mean=_sparse(mean),
        held=torch.from_numpy(cloth.features),
        skin=torch.from_numpy(cloth.skin),
        body=body,
    )


def _sparse(matrix: Any) -> Tensor:
    """A scipy CSR matrix in torch."""
    rows, columns = (torch.from_numpy(array.astype(np.int64)) for array in (matrix.indptr, matrix.indices))
    values = torch.from_numpy(matrix.data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # "in beta state"
        return torch.sparse_csr_tensor(rows, columns, values, size=matrix.shape, check_invariants=True)
