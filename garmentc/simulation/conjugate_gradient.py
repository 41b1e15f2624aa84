"""The linear solver of cloth steps as one kernel: Newton's own launches six for every iteration.

On the CPU a launch costs more than the arithmetic on a garment's vertices; with this solver a simulation of some 1,500
vertices takes 0.6 of the time. Imported by `newton_cloth` only, after it has found Newton: kernels need their types
when the file is read.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import warp as wp

# Of the one release that garmentc pins; the struct is in the signature of the solver's matrices.
from newton._src.solvers.style3d.linear_solver import SparseMatrixELL

wp.set_module_options({"enable_backward": False})


@wp.func
def _row(
    matrix: SparseMatrixELL,
    diagonal: wp.array[float],
    contact: wp.array[wp.mat33],
    x: wp.array[wp.vec3],
    i: int,
):
    product = diagonal[i] * x[i] + contact[i] * x[i]
    for k in range(matrix.num_nz[i]):
        entry = matrix.nz_ell[k, i]
        product += x[entry.column_index] * entry.value
    return product


@wp.kernel
def _conjugate_gradient(
    matrix: SparseMatrixELL,
    diagonal: wp.array[float],
    contact: wp.array[wp.mat33],
    inverse: wp.array[wp.mat33],
    b: wp.array[wp.vec3],
    iterations: int,
    r: wp.array[wp.vec3],
    p: wp.array[wp.vec3],
    product: wp.array[wp.vec3],
    x: wp.array[wp.vec3],
):
    count = x.shape[0]
    for i in range(count):
        r[i] = b[i] - _row(matrix, diagonal, contact, x, i)
    before = wp.float64(0.0)
    for iteration in range(iterations):
        now = wp.float64(0.0)
        for i in range(count):
            now += wp.float64(wp.dot(r[i], inverse[i] * r[i]))
        if now < wp.float64(1.0e-30):
            break
        share = float(0.0)  # noqa: UP018 (a variable in a kernel, not a literal)
        if iteration > 0:
            share = float(now / before)
        before = now
        for i in range(count):
            p[i] = inverse[i] * r[i] + share * p[i]
        curvature = wp.float64(0.0)
        for i in range(count):
            product[i] = _row(matrix, diagonal, contact, p, i)
            curvature += wp.float64(wp.dot(p[i], product[i]))
        if curvature < wp.float64(1.0e-30):
            break
        length = float(now / curvature)
        for i in range(count):
            x[i] = x[i] + length * p[i]
            r[i] = r[i] - length * product[i]


class ConjugateGradient:
    """Takes the place of a Style3D solver's `linear_solver`; `contact` (N,) are the collision's 3 x 3 diagonal blocks.

    The same method with the same preconditioner; sums are taken in float64.
    """

    def __init__(self, count: int, contact: Any) -> None:
        self._contact = contact
        self._r, self._p, self._product = (wp.zeros(count, dtype=wp.vec3, device="cpu") for _ in range(3))

    def solve(
        self,
        off_diagonal: Any,
        diagonal: Any,
        start: Any,
        b: Any,
        inverse: Any,
        x: Any,
        iterations: int,
        additional_multiplier: Callable[[Any], Any] | None = None,
    ) -> None:
        """Newton's signature: (off_diagonal + diagonal + contact) x = b from `start` (None: zero), into `x`.

        inverse                of the diagonal blocks: the preconditioner
        additional_multiplier  not called: it multiplies by `contact`, which the kernel does itself
        """
        if start is None:
            x.zero_()
        elif start is not x:
            x.assign(start)
        self._p.zero_()
        wp.launch(
            _conjugate_gradient,
            dim=1,
            inputs=[off_diagonal, diagonal, self._contact, inverse, b, iterations, self._r, self._p, self._product, x],
            device="cpu",
        )
