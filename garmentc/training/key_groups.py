"""Pose keys in groups: each sees the joints of one region of the body, and is normalised by itself.

With few motions a network that sees all joints for every key finds coincidences: a raised arm says nothing about a
trouser leg. Each group has its own slice of every hidden layer, so it is a network of its own, and the whole is still
a stack of dense layers, with zeros.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from garmentc.rig import output_groups
from garmentc.smpl.skeleton import JOINT_NAMES

KEY_GROUPS = {
    "trunk": ("spine1", "spine2", "spine3", "left_hip", "right_hip", "left_collar", "right_collar"),
    "lower body": ("spine1", "left_hip", "right_hip", "left_knee", "right_knee"),
    "left leg": ("spine1", "left_hip", "left_knee", "left_ankle"),
    "right leg": ("spine1", "right_hip", "right_knee", "right_ankle"),
    "left arm": ("spine1", "spine2", "spine3", "left_collar", "left_shoulder", "left_elbow"),
    "right arm": ("spine1", "spine2", "spine3", "right_collar", "right_shoulder", "right_elbow"),
    "upper body": (
        "spine1", "spine2", "spine3", "neck", "left_collar", "right_collar", "left_shoulder", "right_shoulder",
    ),
}  # fmt: skip
"""Joints that each group sees, beside gravity at the pelvis."""


class MaskedLinear(nn.Linear):
    """A linear layer some of whose weights are nought and stay so. `mask` is (outputs, inputs), 1 or 0."""

    mask: Tensor

    def __init__(self, mask: NDArray[np.float32]) -> None:
        super().__init__(mask.shape[1], mask.shape[0])
        self.register_buffer("mask", torch.from_numpy(mask), persistent=False)

    @property
    def masked_weight(self) -> Tensor:
        """(outputs, inputs)."""
        return self.weight * self.mask

    def forward(self, x: Tensor) -> Tensor:
        return nn.functional.linear(x, self.masked_weight, self.bias)

    def allow_for_mask(self) -> None:
        """Scale weights that were drawn for all inputs to the smaller number that each output has."""
        with torch.no_grad():
            inputs = self.mask.sum(dim=1, keepdim=True).clamp(min=1)
            self.weight.mul_((self.mask.shape[1] / inputs).sqrt())


def linear_weight(layer: nn.Linear) -> Tensor:
    """The weight that a layer multiplies with, (outputs, inputs)."""
    return layer.masked_weight if isinstance(layer, MaskedLinear) else layer.weight


def grouped_mlp(sizes: tuple[int, ...]) -> nn.Sequential:
    """As many networks side by side as there are KEY_GROUPS, from sizes[0] features of a pose to sizes[-1] keys."""
    layers: list[nn.Module] = []
    for mask in _masks(sizes):
        layers += [MaskedLinear(mask), nn.ReLU()]
    return nn.Sequential(*layers[:-1])


def _masks(sizes: tuple[int, ...]) -> Iterator[NDArray[np.float32]]:
    """(outputs, inputs) of each layer: groups see their joints first, and their own slice of the layer before then."""
    first, *others = sizes
    slices = [output_groups(width, len(KEY_GROUPS)) for width in others]
    yield group_features(first)[slices[0]]
    for inputs, outputs in itertools.pairwise(slices):
        yield np.equal.outer(outputs, inputs).astype(np.float32)


def group_features(width: int) -> NDArray[np.float32]:
    """(groups, width): 1 for the numbers of an encoded pose that a group sees; the first three are the root's."""
    seen = np.zeros((len(KEY_GROUPS), width), np.float32)
    seen[:, :3] = 1
    joints = seen[:, 3:].reshape(len(KEY_GROUPS), len(JOINT_NAMES) - 1, -1)  # a view
    for row, names in zip(joints, KEY_GROUPS.values(), strict=True):
        row[[JOINT_NAMES.index(name) - 1 for name in names]] = 1
    return seen


def group_sums(keys: Tensor) -> Tensor:
    """The sum of the group that each key is in: (T, P) to (T, P)."""
    group = torch.from_numpy(output_groups(keys.shape[1], len(KEY_GROUPS))).to(keys.device)
    sums = keys.new_zeros(len(keys), len(KEY_GROUPS)).index_add(1, group, keys)
    return sums[:, group]
