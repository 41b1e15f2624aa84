"""DeePSD's network (Bertiche et al. 2021, sections 4.2 and 9) in torch, and the variants of its ablations.

Where it departs from the paper, and why:
- Ω ends in a softmax, so no weight row is ever all zero (the published code ends in ReLU and can produce one).
- The key normalisation has an epsilon in its denominator, and keys are taken relative to the rest pose, so that
  the outfit at rest is the outfit as authored.
- Weights are drawn as He et al. 2015 do for ReLU, and what keys are multiplied with is KEY_SCALE times the numbers that
  are learned: the published start needs several times as many steps.
- What its rim holds up (`garmentc.families.held_cloth`) is known: Φ sees it, and there cloth has the skin's weights and
  no blend shapes.
- The pose enters as up-in-the-pelvis-frame (3) and the axis-angle of joints 1..23 (69): 72 numbers as in the paper,
  but blind to heading (`garmentc.rig.encode_pose`); other encodings are in `garmentc.training.pose_encodings`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn

from garmentc.rig import ENCODING_GRAVITY_AXIS_ANGLE, NORMALIZED_RELU_EPSILON
from garmentc.training.pose_encodings import POSE_ENCODINGS

BLEND_SHAPES, VERTICES, NONE = "blend_shapes", "vertices", "none"
DEFORMATIONS = (BLEND_SHAPES, VERTICES, NONE)
"""DeePSD itself; the paper's baseline, which deforms a vertex by its descriptor and the pose; skinning only.

The baseline is no blend-shape model, so it has no rig and no bundle.
"""

KEY_SCALE = 8.0
"""What a key moves is so many times what the heads say: embedded keys sum to 1, so each is small and moves little."""


@dataclass(frozen=True)
class DeepsdConfig:
    """Layer widths and variants; the defaults are the paper's network.

    keys               pose keys, P in the paper; ignored without pose embedding or blend shapes
    deformation        one of DEFORMATIONS
    global_descriptor  whether heads see the outfit as a whole
    pose_embedding     whether an MLP makes the keys; otherwise the encoded pose is the keys
    pose_encoding      one of POSE_ENCODINGS; a bundle can only have those of garmentc.rig.ENCODING_WIDTHS
    ignored_joints     whose rotations the keys do not see: what a hand or a foot does says nothing about cloth, but
                       with few motions a network finds coincidences (TailorNet masks joints too)
    metadata_width     numbers that describe fabric and fit, see `garmentc.training.metadata`
    """

    convolutions: tuple[int, ...] = (32, 64, 128, 256)
    global_width: int = 256
    weight_head: tuple[int, ...] = (128, 64, 32)
    shape_head: tuple[int, ...] = (256, 256, 256)
    pose_head: tuple[int, ...] = (256, 256, 256)
    keys: int = 128
    joints: int = 24
    deformation: str = BLEND_SHAPES
    global_descriptor: bool = True
    pose_embedding: bool = True
    pose_encoding: str = ENCODING_GRAVITY_AXIS_ANGLE
    ignored_joints: tuple[int, ...] = ()
    metadata_width: int = 0

    @property
    def pose_features(self) -> int:
        return POSE_ENCODINGS[self.pose_encoding].width

    @property
    def key_scale(self) -> float:
        """KEY_SCALE for embedded keys; angles are large enough."""
        return KEY_SCALE if self.pose_embedding else 1.0

    @property
    def pose_code(self) -> int:
        """Width of what stands for the pose: P."""
        return self.keys if self.pose_embedding else self.pose_features


class Descriptors(NamedTuple):
    """What the heads see, and what their weights are mixed with.

    local     (N, 256) of each vertex
    shared    (S,) of the outfit
    firmness  (N, 1) how much the skin holds each vertex
    skin      (N, 24) blend weights of the skin there
    """

    local: Tensor
    shared: Tensor
    firmness: Tensor
    skin: Tensor


class GraphConvolution(nn.Module):
    """ReLU(X·A + mean_neighbours(X)·B + b): perceptive field 1, no self-loop in the mean."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.own = nn.Linear(inputs, outputs)
        self.neighbour = nn.Linear(inputs, outputs, bias=False)

    def forward(self, x: Tensor, around: Tensor) -> Tensor:
        """x (N, inputs), around (N, inputs) the means of x over neighbours; returns (N, outputs)."""
        return torch.relu(self.own(x) + self.neighbour(around))


def _mlp(sizes: tuple[int, ...]) -> nn.Sequential:
    layers: list[nn.Module] = []
    for inputs, outputs in itertools.pairwise(sizes):
        layers += [nn.Linear(inputs, outputs), nn.ReLU()]
    return nn.Sequential(*layers[:-1])


def _with_shared(head: nn.Sequential, descriptors: Descriptors) -> Tensor:
    """`head` of every row of `local` with `shared` behind it; what is shared is multiplied once, not once a row."""
    local, shared = descriptors.local, descriptors.shared
    first = head[0]
    assert isinstance(first, nn.Linear)
    width = local.shape[-1]
    around = nn.functional.linear(shared, first.weight[:, width:], first.bias)
    x: Tensor = head[1:](nn.functional.linear(local, first.weight[:, :width]) + around)
    return x


class Deepsd(nn.Module):
    """Φ (`convolutions`, `global_layer`), Ω (`weight_head`), Ψ (`data_head`), χ (`physics_head`) and the pose MLP.

    Only blend-shape models have χ. The modules that a variant does without are absent.
    """

    seen: Tensor

    def __init__(self, config: DeepsdConfig | None = None) -> None:
        super().__init__()
        self.config = config = config or DeepsdConfig()
        widths = (8, *config.convolutions)
        self.convolutions = nn.ModuleList(GraphConvolution(a, b) for a, b in itertools.pairwise(widths))
        shared = config.metadata_width
        if config.global_descriptor:
            self.global_layer = nn.Linear(widths[-1], config.global_width)
            shared += config.global_width
        features = widths[-1] + shared
        self.weight_head = _mlp((features, *config.weight_head, config.joints))
        if config.deformation == BLEND_SHAPES:
            self.data_head = _mlp((features, *config.shape_head, 3 * config.pose_code))
            self.physics_head = _mlp((features, *config.shape_head, 3 * config.pose_code))
        elif config.deformation == VERTICES:
            self.data_head = _mlp((features + config.pose_code, *config.shape_head, 3))
        if config.deformation != NONE and config.pose_embedding:
            self.pose_head = _mlp((config.pose_features, *config.pose_head, config.keys))
            self.register_buffer("seen", seen_features(config), persistent=False)
        self._draw_weights()

    def _draw_weights(self) -> None:
        for module in self.modules():
            if isinstance(module, nn.Linear):
                nn.init.kaiming_normal_(module.weight)
                if module.bias is not None:
                    nn.init.zeros_(module.bias)
        with torch.no_grad():
            for module in self.modules():
                if isinstance(module, GraphConvolution):  # the sum of two
                    module.own.weight.mul_(0.5**0.5)
                    module.neighbour.weight.mul_(0.5**0.5)
            for head, share in zip(self.deforming_heads, (0.05, 0.0), strict=False):  # start near "no deformation"
                last = head[-1]  # χ starts with none at all: until it is trained, it adds nothing
                assert isinstance(last, nn.Linear)
                last.weight.mul_(share)

    @property
    def deforming_heads(self) -> tuple[nn.Sequential, ...]:
        """Ψ and χ, those that this variant has."""
        kinds = {BLEND_SHAPES: ("data_head", "physics_head"), VERTICES: ("data_head",), NONE: ()}
        return tuple(getattr(self, name) for name in kinds[self.config.deformation])

    def descriptors(
        self,
        vertices: Tensor,
        normals: Tensor,
        mean: Tensor,
        held: Tensor,
        skin: Tensor,
        metadata: Tensor | None = None,
        rows: Tensor | None = None,
    ) -> Descriptors:
        """Φ: vertices and normals (N, 3), mean (N, N) sparse, metadata (metadata_width,), zeros where None.

        held (N, 2) and skin (N, 24) are HeldCloth's firmness and held side by side, and the skin's blend weights.

        rows  the vertices whose descriptors are wanted; all by default. They are the same whatever else is wanted.
        """
        x = torch.cat([vertices, normals, held], dim=1)
        *first, last = self.convolutions
        for convolution in first:
            x = convolution(x, mean @ x)
        around = mean @ x
        shared = []
        if self.config.global_descriptor:
            shared.append(self._pooled(x, around))
        if self.config.metadata_width:
            shared.append(x.new_zeros(self.config.metadata_width) if metadata is None else metadata)
        firmness = held[:, :1]
        if rows is not None:
            x, around, firmness, skin = x[rows], around[rows], firmness[rows], skin[rows]
        return Descriptors(last(x, around), torch.cat(shared) if shared else x.new_zeros(0), firmness, skin)

    def _pooled(self, x: Tensor, around: Tensor) -> Tensor:
        """The global descriptor (256,): the largest over the vertices of what `global_layer` makes of each.

        Only the vertices that win have a gradient, so only they are computed with one: the same numbers, faster.
        """
        last = self.convolutions[-1]
        with torch.no_grad():
            winners = self.global_layer(last(x, around)).argmax(dim=0)
        local = last(x[winners], around[winners])
        return torch.relu((local * self.global_layer.weight).sum(dim=1) + self.global_layer.bias)

    def blend_weights(self, descriptors: Descriptors) -> Tensor:
        """Ω, mixed with the skin's weights where that holds the cloth: (N, 24), rows sum to 1."""
        learned = torch.softmax(_with_shared(self.weight_head, descriptors), dim=1)
        return descriptors.firmness * descriptors.skin + (1 - descriptors.firmness) * learned

    def blend_shapes(self, descriptors: Descriptors, *, data: bool = True, physics: bool = True) -> Tensor:
        """Ψ + χ: (N, P, 3), metres per unit of key; 0 where the skin holds the cloth."""
        wanted = [head for head, take in zip(self.deforming_heads, (data, physics), strict=True) if take]
        parts = [_with_shared(head, descriptors) for head in wanted]
        loose = self.config.key_scale * (1 - descriptors.firmness)
        return (loose * torch.stack(parts).sum(dim=0)).reshape(len(descriptors.local), -1, 3)

    def absolute_keys(self, features: Tensor) -> Tensor:
        """g: encoded poses (T, pose_features) to keys (T, P), each row of positive numbers that sum to 1."""
        if not self.config.pose_embedding:
            return features
        keys = torch.relu(self.pose_head(features * self.seen))
        return keys / (keys.sum(dim=1, keepdim=True) + NORMALIZED_RELU_EPSILON)

    def pose_keys(self, features: Tensor) -> Tensor:
        """f(θ) = g(θ) − g(rest): zero at rest. (T, pose_features) to (T, P)."""
        both = self.absolute_keys(torch.cat([torch.zeros_like(features[:1]), features]))
        return both[1:] - both[:1]

    def deformations(self, descriptors: Descriptors, features: Tensor, *, physics: bool = True) -> Tensor:
        """How each vertex moves before skinning, (T, N, 3) metres, in the poses `features` (T, pose_features)."""
        return self.deformer(descriptors, physics=physics)(features)

    def deformer(self, descriptors: Descriptors, *, physics: bool = True) -> Callable[[Tensor], Tensor]:
        """`deformations` as a function of the poses: what depends on the outfit alone is computed once."""
        kind, count = self.config.deformation, len(descriptors.local)
        if kind == NONE:
            return lambda features: features.new_zeros(len(features), count, 3)
        if kind == BLEND_SHAPES:
            shapes = self.blend_shapes(descriptors, physics=physics)
            return lambda features: combined(self.pose_keys(features), shapes)
        first = self.data_head[0]
        assert isinstance(first, nn.Linear)
        width = first.in_features - self.config.pose_code
        at_vertex = nn.functional.linear(descriptors.local, first.weight[:, : descriptors.local.shape[1]])
        around = nn.functional.linear(descriptors.shared, first.weight[:, descriptors.local.shape[1] : width])

        def moved(features: Tensor) -> Tensor:
            keys = self.config.key_scale * self.pose_keys(features)
            in_pose = nn.functional.linear(keys, first.weight[:, width:], first.bias)
            result: Tensor = self.data_head[1:](at_vertex + around + in_pose[:, None])
            return (1 - descriptors.firmness) * result

        return moved


def seen_features(config: DeepsdConfig) -> Tensor:
    """(pose_features,): 0 for the numbers of ignored joints, 1 for all others; the first three are the root's."""
    per_joint = (config.pose_features - 3) // (config.joints - 1)
    seen = torch.ones(config.pose_features)
    for joint in config.ignored_joints:
        start = 3 + (joint - 1) * per_joint
        seen[start : start + per_joint] = 0
    return seen


def combined(keys: Tensor, shapes: Tensor) -> Tensor:
    """sum_i keys_i D_i: keys (T, P), shapes (N, P, 3); returns (T, N, 3)."""
    count = len(shapes)
    return (keys @ shapes.transpose(0, 1).reshape(keys.shape[1], 3 * count)).reshape(len(keys), count, 3)
