"""The physics losses of DeePSD (section 4.3), per vertex or per edge, in square millimetres.

Sums of the paper become means, so that outfits of different density weigh the same.
"""

from __future__ import annotations

import torch
from torch import Tensor

MM = 1000.0


def skin(vertices: Tensor, weights: Tensor, transforms: Tensor) -> Tensor:
    """Linear blend skinning. vertices (T, N, 3), weights (N, 24), transforms (T, 24, 3, 4); returns (T, N, 3)."""
    blended = torch.matmul(weights, transforms.reshape(len(transforms), 24, 12)).reshape(*vertices.shape[:2], 3, 4)
    return (blended[..., :3] * vertices[..., None, :]).sum(dim=-1) + blended[..., 3]


def vertex_normals(vertices: Tensor, triangles: Tensor) -> Tensor:
    """Area-weighted unit normals (T, N, 3) of posed vertices (T, N, 3)."""
    a, b, c = (vertices[:, triangles[:, k]] for k in range(3))
    face = torch.linalg.cross(b - a, c - a)
    total = torch.zeros_like(vertices)
    for k in range(3):
        total = total.index_add(1, triangles[:, k], face)
    return torch.nn.functional.normalize(total, dim=-1, eps=1e-12)


def edge_lengths(vertices: Tensor, edges: Tensor) -> Tensor:
    """Lengths (T, E) of edges (E, 2) of vertices (T, N, 3), metres."""
    return torch.sqrt(((vertices[:, edges[:, 0]] - vertices[:, edges[:, 1]]) ** 2).sum(dim=-1) + 1e-14)


def edge_loss(lengths: Tensor, rest_lengths: Tensor) -> Tensor:
    """Mean squared change of edge length (equation 4, first term), mm²."""
    return ((lengths - rest_lengths) * MM).square().mean()


def bend_loss(normals: Tensor, edges: Tensor, counts: Tensor) -> Tensor:
    """Mean squared graph Laplacian of the vertex normals (equation 4, second term); counts (N,) neighbours."""
    i, j = edges[:, 0], edges[:, 1]
    difference = normals[:, i] - normals[:, j]
    laplacian = torch.zeros_like(normals).index_add(1, i, difference).index_add(1, j, -difference)
    return (laplacian / counts.clamp(min=1)[None, :, None]).square().sum(dim=-1).mean()


def collision_loss(vertices: Tensor, body_points: Tensor, body_normals: Tensor, epsilon: float) -> Tensor:
    """Mean squared shortfall from `epsilon` metres of clearance (equation 5), mm².

    body_points and body_normals (T, N, 3): the nearest body vertex of every outfit vertex, and its normal.
    """
    clearance = ((vertices - body_points) * body_normals).sum(dim=-1)
    return (torch.relu(epsilon - clearance) * MM).square().mean()


def largest(weights: Tensor, influences: int) -> Tensor:
    """Blend weights (N, 24) with all but the largest `influences` of each row dropped and the rest rescaled."""
    if influences >= weights.shape[1]:
        return weights
    kept, joints = weights.topk(influences, dim=1)
    return torch.zeros_like(weights).scatter(1, joints, kept / kept.sum(dim=1, keepdim=True))
