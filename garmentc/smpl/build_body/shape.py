"""The shape space: principal components of random adults."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

COMPONENTS = 10


@dataclass(frozen=True)
class ShapeSpace:
    """Mean and principal directions; coefficients are in standard deviations.

    v_template   (V, 3)
    shapedirs    (V, 3, 10)
    J_template   (24, 3)
    J_shapedirs  (24, 3, 10)
    variance     (10,) share of the variance that each component explains
    error        mean distance of the samples' vertices from their reconstruction, metres
    """

    v_template: NDArray[np.float64]
    shapedirs: NDArray[np.float64]
    J_template: NDArray[np.float64]
    J_shapedirs: NDArray[np.float64]
    variance: NDArray[np.float64]
    error: float


def principal_components(vertices: NDArray[np.float64], joints: NDArray[np.float64]) -> ShapeSpace:
    """From samples (N, V, 3) and their joints (N, 24, 3).

    Joints are regressed on the coefficients. A component's sign is chosen so that a positive coefficient makes the
    body larger; otherwise it would be up to the solver.
    """
    count = len(vertices)
    mean, mean_joints = vertices.mean(axis=0), joints.mean(axis=0)
    u, s, vt = np.linalg.svd((vertices - mean).reshape(count, -1), full_matrices=False)
    deviation = s[:COMPONENTS] / np.sqrt(count - 1)
    from_centre = mean - mean.mean(axis=0)
    sign = np.array([np.sign((row.reshape(-1, 3) * from_centre).sum()) for row in vt[:COMPONENTS]])
    scaled = vt[:COMPONENTS] * sign[:, None] * deviation[:, None]
    shapedirs = scaled.reshape(COMPONENTS, -1, 3).transpose(1, 2, 0)
    betas = (u[:, :COMPONENTS] * s[:COMPONENTS] / deviation) * sign
    moved = np.linalg.lstsq(betas, (joints - mean_joints).reshape(count, -1), rcond=None)[0]
    rebuilt = mean + np.einsum("vck,nk->nvc", shapedirs, betas)
    return ShapeSpace(
        v_template=mean,
        shapedirs=shapedirs,
        J_template=mean_joints,
        J_shapedirs=moved.reshape(COMPONENTS, -1, 3).transpose(1, 2, 0),
        variance=s[:COMPONENTS] ** 2 / (s**2).sum(),
        error=float(np.linalg.norm(rebuilt - vertices, axis=2).mean()),
    )
