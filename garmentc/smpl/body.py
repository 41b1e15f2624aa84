"""The body model: SMPL's formula on any body with the 24 SMPL joints."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.smpl.correctives import PoseCorrectives
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_COUNT
from garmentc.smpl.skinning import joint_transforms, skin

LARGEST_BETA = 100.0
"""Whatever is beyond is no shape but a mistake, and would overflow."""


@dataclass(frozen=True)
class BodyModel:
    """A body with SMPL's interface (Loper et al. 2015, section 3).

    Metres; X to the body's left, Y up, +Z front; T-pose at zero pose.

    name         what reports call it
    gender       "female", "male" or "neutral"
    v_template   (V, 3) rest vertices of the mean shape
    faces        (F, 3) int32 triangles, counter-clockwise from outside
    weights      (V, 24) blend weights, rows sum to 1
    shapedirs    (V, 3, S) metres per unit of each shape coefficient
    J_template   (24, 3) rest joints of the mean shape
    J_shapedirs  (24, 3, S)
    correctives  pose correctives; `posedirs` is the dense array

    Arrays are float64: the reference. `astype(np.float32)` gives the fast path; results follow the arrays' dtype.
    """

    name: str
    gender: str
    v_template: NDArray[Any]
    faces: NDArray[np.int32]
    weights: NDArray[Any]
    shapedirs: NDArray[Any]
    J_template: NDArray[Any]
    J_shapedirs: NDArray[Any]
    correctives: PoseCorrectives

    def astype(self, dtype: type[np.floating[Any]]) -> BodyModel:
        """The same body with every float array in `dtype`."""
        names = ("v_template", "weights", "shapedirs", "J_template", "J_shapedirs", "correctives")
        return replace(self, **{name: getattr(self, name).astype(dtype) for name in names})

    def of_vertices(self, rows: NDArray[Any]) -> BodyModel:
        """A body of some of the vertices, which pose as they do in the whole; without faces."""
        return replace(
            self,
            v_template=self.v_template[rows],
            faces=np.zeros((0, 3), dtype=np.int32),
            weights=self.weights[rows],
            shapedirs=self.shapedirs[rows],
            correctives=self.correctives.of_vertices(rows),
        )

    @property
    def dtype(self) -> np.dtype[Any]:
        return self.v_template.dtype

    @cached_property
    def posedirs(self) -> NDArray[Any]:
        """(V, 3, 207) pose correctives for the row-major entries of R[1:] - I; filled when first asked for."""
        return self.correctives.dense(len(self.v_template))

    def _betas(self, betas: NDArray[Any] | None) -> NDArray[Any]:
        given = np.zeros(0) if betas is None else np.asarray(betas)
        count = self.shapedirs.shape[-1]
        if given.ndim != 1 or given[count:].any():
            shape = "x".join(map(str, given.shape))
            message = (
                f"got {shape} shape coefficients (betas), but the body '{self.name}' has {count}; leave the rest out"
            )
            raise GarmentcError(message)
        if not (np.abs(given) <= LARGEST_BETA).all():  # also refuses NaN
            raise GarmentcError(f"a shape coefficient (beta) is beyond {LARGEST_BETA:g}; people are within about 3")
        padded = np.zeros(count, dtype=self.dtype)
        padded[: len(given)] = given[:count]
        return padded

    def shaped(self, betas: NDArray[Any] | None = None) -> NDArray[Any]:
        """Rest vertices (V, 3) of the body with shape `betas`: up to S coefficients, missing ones are zero.

        Raises GarmentcError where a coefficient beyond the S-th is not zero.
        """
        vertices: NDArray[Any] = self.v_template + self.shapedirs @ self._betas(betas)
        return vertices

    def joints(self, betas: NDArray[Any] | None = None) -> NDArray[Any]:
        """Rest joints (24, 3) of the body with shape `betas`."""
        joints: NDArray[Any] = self.J_template + self.J_shapedirs @ self._betas(betas)
        return joints

    def posed(
        self,
        poses: NDArray[Any],
        betas: NDArray[Any] | None = None,
        translation: NDArray[Any] | None = None,
        correctives: bool = True,
    ) -> NDArray[Any]:
        """Posed vertices (..., V, 3).

        poses        (..., 24, 3) or (..., 72) axis-angle, radians, relative to the parent
        betas        (S,) shape coefficients
        translation  (..., 3) metres
        correctives  add the pose correctives before skinning (SMPL equation 9)
        """
        poses = np.asarray(poses, dtype=self.dtype)
        if poses.shape[-1] == 3 * JOINT_COUNT:
            poses = poses.reshape(*poses.shape[:-1], JOINT_COUNT, 3)
        rotations = axis_angle_to_matrix(poses)
        shaped = self.shaped(betas)
        vertices = np.array(np.broadcast_to(shaped, (*poses.shape[:-2], *shaped.shape)))
        if correctives:
            self.correctives.add_to(vertices, rotations)
        moved = None if translation is None else np.asarray(translation, dtype=self.dtype)
        return skin(vertices, self.weights, joint_transforms(rotations, self.joints(betas), moved))
