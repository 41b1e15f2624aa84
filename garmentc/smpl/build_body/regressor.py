"""Joints as convex combinations of vertices, as SMPL's J_regressor has them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.skeleton import JOINT_COUNT, PARENTS

NEARBY = 400
"""Vertices that a joint may depend on: the nearest ones that it, its parent or its children carry."""

SUM_WEIGHT = 30.0
"""Metres. Weight of the row that asks the coefficients to sum to 1."""


def fit_regressor(
    vertices: NDArray[np.float64],
    joints: NDArray[np.float64],
    weights: NDArray[np.float64],
    chosen: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Regressor (24, V) from samples (N, V, 3), their joints (N, 24, 3) and blend weights (V, 24).

    Vertices are picked by the means of all samples; the fit itself takes only the `chosen` samples, for speed.
    Non-negative least squares (Lawson and Hanson 1974); rows sum to 1.
    """
    import scipy.optimize

    mean, mean_joints = vertices.mean(axis=0), joints.mean(axis=0)
    regressor = np.zeros((JOINT_COUNT, len(mean)))
    for joint in range(JOINT_COUNT):
        family = [k for k in range(JOINT_COUNT) if joint in (k, PARENTS[k]) or k == PARENTS[joint]]
        candidates = np.flatnonzero(weights[:, family].sum(axis=1) > 0.5)
        distance = np.linalg.norm(mean[candidates] - mean_joints[joint], axis=1)
        nearby = candidates[np.argsort(distance)[:NEARBY]]
        equations = vertices[chosen][:, nearby].transpose(0, 2, 1).reshape(-1, len(nearby))
        system = np.vstack([equations, np.full((1, len(nearby)), SUM_WEIGHT)])
        wanted = np.append(joints[chosen, joint].reshape(-1), SUM_WEIGHT)
        solution, _ = scipy.optimize.nnls(system, wanted, maxiter=20000)
        regressor[joint, nearby] = solution / solution.sum()
    return np.where(regressor > 1e-6, regressor, 0)
