"""The rig: the one intermediate representation that every model family is lowered to.

    V(pose) = LBS( T + sum_i f(pose)_i D_i, J, pose, W )

and its reference evaluation in numpy. Families make rigs, passes turn rigs into rigs, the glTF back end writes them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_COUNT, PARENTS
from garmentc.smpl.skinning import joint_transforms, skin

ENCODING_GRAVITY_AXIS_ANGLE = "gravity_axis_angle"
"""72 numbers: up in the pelvis frame minus up at rest (3), then the axis-angle of joints 1..23 (69).

The root's heading does not appear: turning the whole body about the vertical changes nothing.
"""

ENCODING_GRAVITY_JOINTS = "gravity_joints"
"""141 numbers: up in the pelvis frame minus up at rest (3), then 6 of each joint 1..23: up in that joint's frame minus
up at rest, and its axis-angle. So a sleeve or a trouser leg knows where it hangs.
"""

ENCODING_WIDTHS = {
    ENCODING_GRAVITY_AXIS_ANGLE: 3 + 3 * (JOINT_COUNT - 1),
    ENCODING_GRAVITY_JOINTS: 3 + 6 * (JOINT_COUNT - 1),
}
"""How many numbers a network of each encoding sees: the encodings that rigs, bundles and glTF files can have."""

ACTIVATIONS = ("linear", "relu", "normalized_relu", "nonnegative")
"""`nonnegative` is x - min(x), for blend shapes that sum to nothing: a common amount of all of them changes nothing."""

NORMALIZED_RELU_EPSILON = 1e-6
"""`normalized_relu` is max(x, 0) / (sum(max(x, 0)) + epsilon): the paper's key normalisation, never 0 / 0."""


def encode_pose(poses: NDArray[Any], encoding: str = ENCODING_GRAVITY_AXIS_ANGLE) -> NDArray[Any]:
    """An encoding of poses (..., 24, 3); returns (..., ENCODING_WIDTHS[encoding]), 0 at rest.

    Joint angles are taken in [0, pi] (the shorter way round), so equal rotations have equal encodings.
    """
    angle = np.linalg.norm(poses, axis=-1, keepdims=True)
    wrapped = np.remainder(angle + np.pi, 2 * np.pi) - np.pi
    short = np.where(angle > np.pi, poses * (wrapped / np.where(angle > 0, angle, 1)), poses)
    root = axis_angle_to_matrix(short[..., 0, :])
    up = root[..., 1, :]  # row 1 of R is R^T e_y: world up seen from the pelvis
    rest = np.array([0, 1, 0], dtype=poses.dtype)
    numbers = joints = short[..., 1:, :]
    if encoding == ENCODING_GRAVITY_JOINTS:
        numbers = np.concatenate([_up_in_joints(up, axis_angle_to_matrix(joints)) - rest, joints], axis=-1)
    return np.concatenate([up - rest, numbers.reshape(*poses.shape[:-2], -1)], axis=-1)


def _up_in_joints(up: NDArray[Any], rotations: NDArray[Any]) -> NDArray[Any]:
    """World up in the frames of joints 1..23, (..., 23, 3), from that in the pelvis' and rotations (..., 23, 3, 3).

    With G_k = G_parent R_k it is G_k^T y = R_k^T (G_parent^T y): down the tree, one vector turned back at each joint.
    """
    found = [up[..., None, :]]
    for joint in range(1, JOINT_COUNT):
        found.append(found[PARENTS[joint]] @ rotations[..., joint - 1, :, :])
    return np.concatenate(found[1:], axis=-2)


@dataclass(frozen=True)
class DenseLayer:
    """activation(weight @ x + bias); weight (outputs, inputs), bias (outputs,), float32."""

    weight: NDArray[Any]
    bias: NDArray[Any]
    activation: str = "linear"

    def __call__(self, x: NDArray[Any]) -> NDArray[Any]:
        y: NDArray[Any] = x @ self.weight.T.astype(x.dtype) + self.bias.astype(x.dtype)
        if self.activation in ("relu", "normalized_relu"):
            y = np.maximum(y, 0)
        if self.activation == "normalized_relu":
            y = y / (y.sum(axis=-1, keepdims=True) + NORMALIZED_RELU_EPSILON)
        if self.activation == "nonnegative":
            y = y - y.min(axis=-1, keepdims=True)
        return y


@dataclass(frozen=True, eq=False)
class KeyNetwork:
    """f: joint rotations to pose keys (morph weights). Zero at rest, by construction of the last bias."""

    layers: tuple[DenseLayer, ...]
    encoding: str = ENCODING_GRAVITY_AXIS_ANGLE

    @property
    def output_size(self) -> int:
        return len(self.layers[-1].bias)

    def __call__(self, poses: NDArray[Any]) -> NDArray[Any]:
        """Keys (..., K) of poses (..., 24, 3), in the dtype of `poses`."""
        x = encode_pose(poses, self.encoding)
        for layer in self.layers:
            x = layer(x)
        return x


@dataclass(frozen=True)
class Rig:
    """An outfit that moves with the 24 SMPL joints.

    template       (N, 3) vertices in the rest pose, metres, in the body's axes
    triangles      (F, 3) int32, welded topology
    joints         (24, 3) rest joints
    weights        (N, 24) float32, rows sum to 1
    blend_shapes   (M, N, 3) float32, metres
    keys           pose to the first K of the M keys, those that are driven; None where M = 0
    blend_normals  (M, N, 3) float32 normal deltas, or None
    animation_keys (T, M) keys in all frames of the animations, one animation after the other; None has those of `keys`.
                   Those that no pose drives are left to them
    """

    template: NDArray[Any]
    triangles: NDArray[np.int32]
    joints: NDArray[Any]
    weights: NDArray[Any]
    blend_shapes: NDArray[Any]
    keys: KeyNetwork | None
    blend_normals: NDArray[Any] | None = None
    animation_keys: NDArray[np.float64] | None = None

    @property
    def vertex_count(self) -> int:
        return len(self.template)

    @property
    def morph_count(self) -> int:
        return len(self.blend_shapes)

    @property
    def balanced(self) -> bool:
        """Whether the driven blend shapes sum to nothing, so that a common amount of them changes nothing."""
        return self.keys is not None and self.keys.layers[-1].activation == "nonnegative"

    @property
    def driven_count(self) -> int:
        """K: as many of the first keys depend on the pose."""
        return 0 if self.keys is None else self.keys.output_size

    def pose_keys(self, poses: NDArray[Any]) -> NDArray[Any]:
        """Keys (..., M) of poses (..., 24, 3); 0 for those that no pose drives."""
        keys = np.zeros((*poses.shape[:-2], self.morph_count), dtype=poses.dtype)
        if self.keys is not None:
            keys[..., : self.driven_count] = self.keys(poses)
        return keys

    def posed(
        self,
        poses: NDArray[Any],
        translation: NDArray[Any] | None = None,
        keys: NDArray[Any] | None = None,
        dtype: type[np.floating[Any]] = np.float64,
    ) -> NDArray[Any]:
        """Posed vertices (..., N, 3): the reference evaluation.

        poses        (..., 24, 3) axis-angle, radians
        translation  (..., 3) metres
        keys         (..., M) morph weights; by default those of the key network
        """
        poses = np.asarray(poses, dtype=dtype).reshape(*np.shape(poses)[:-2], JOINT_COUNT, 3)
        amounts = self.pose_keys(poses) if keys is None else np.asarray(keys, dtype=dtype)
        vertices = self.template.astype(dtype)
        if self.morph_count:
            flat = self.blend_shapes.reshape(self.morph_count, -1).astype(dtype)
            vertices = vertices + (amounts @ flat).reshape(*amounts.shape[:-1], -1, 3)
        moved = None if translation is None else np.asarray(translation, dtype=dtype)
        transforms = joint_transforms(axis_angle_to_matrix(poses), self.joints.astype(dtype), moved)
        return skin(vertices, self.weights.astype(dtype), transforms)
