"""DeePSD's network (Bertiche et al. 2021, sections 4.2 and 9) in torch.

Where it departs from the paper, and why:
- Ω ends in a softmax, so no weight row is ever all zero (the published code ends in ReLU and can produce one).
- The key normalisation has an epsilon in its denominator, and keys are taken relative to the rest pose, so that
  the outfit at rest is the outfit as authored.
- The pose enters as up-in-the-pelvis-frame (3) and the axis-angle of joints 1..23 (69): 72 numbers as in the paper,
  but blind to heading (`garmentc.rig.encode_pose`).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from garmentc.rig import NORMALIZED_RELU_EPSILON


@dataclass(frozen=True)
class DeepsdConfig:
    """Layer widths; the defaults are the paper's."""

    convolutions: tuple[int, ...] = (32, 64, 128, 256)
    global_width: int = 256
    weight_head: tuple[int, ...] = (128, 64, 32)
    shape_head: tuple[int, ...] = (256, 256, 256)
    pose_head: tuple[int, ...] = (256, 256, 256)
    keys: int = 128
    joints: int = 24
    pose_features: int = 72


class GraphConvolution(nn.Module):
    """ReLU(X·A + mean_neighbours(X)·B + b): perceptive field 1, no self-loop in the mean."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.own = nn.Linear(inputs, outputs)
        self.neighbour = nn.Linear(inputs, outputs, bias=False)

    def forward(self, x: Tensor, mean: Tensor) -> Tensor:
        """x (N, inputs), mean (N, N) sparse row-stochastic; returns (N, outputs)."""
        return torch.relu(self.own(x) + self.neighbour(mean @ x))


def _mlp(sizes: tuple[int, ...]) -> nn.Sequential:
    layers: list[nn.Module] = []
    for inputs, outputs in itertools.pairwise(sizes):
        layers += [nn.Linear(inputs, outputs), nn.ReLU()]
    return nn.Sequential(*layers[:-1])


class Deepsd(nn.Module):
    """Φ (`convolutions`, `global_layer`), Ω (`weight_head`), Ψ (`data_head`), χ (`physics_head`) and the pose MLP."""

    def __init__(self, config: DeepsdConfig | None = None) -> None:
        super().__init__()
        self.config = config = config or DeepsdConfig()
        widths = (6, *config.convolutions)
        self.convolutions = nn.ModuleList(GraphConvolution(a, b) for a, b in itertools.pairwise(widths))
        self.global_layer = nn.Linear(widths[-1], config.global_width)
        features = widths[-1] + config.global_width
        self.weight_head = _mlp((features, *config.weight_head, config.joints))
        self.data_head = _mlp((features, *config.shape_head, 3 * config.keys))
        self.physics_head = _mlp((features, *config.shape_head, 3 * config.keys))
        self.pose_head = _mlp((config.pose_features, *config.pose_head, config.keys))
        for module in self.modules():
            if isinstance(module, nn.Linear):
                nn.init.xavier_normal_(module.weight)
                if module.bias is not None:
                    nn.init.zeros_(module.bias)
        for head in (self.data_head, self.physics_head):  # start near "no deformation"
            last = head[-1]
            assert isinstance(last, nn.Linear)
            with torch.no_grad():
                last.weight.mul_(0.1)

    def descriptors(self, vertices: Tensor, normals: Tensor, mean: Tensor) -> Tensor:
        """Φ: vertices and normals (N, 3), mean (N, N) sparse; returns local and global descriptors (N, 512)."""
        x = torch.cat([vertices, normals], dim=1)
        for convolution in self.convolutions:
            x = convolution(x, mean)
        pooled = torch.relu(self.global_layer(x)).amax(dim=0)
        return torch.cat([x, pooled.expand(len(x), -1)], dim=1)

    def blend_weights(self, descriptors: Tensor) -> Tensor:
        """Ω: (N, 512) to (N, 24), rows sum to 1."""
        return torch.softmax(self.weight_head(descriptors), dim=1)

    def blend_shapes(self, descriptors: Tensor, *, data: bool = True, physics: bool = True) -> Tensor:
        """Ψ + χ: (N, 512) to (N, P, 3), metres per unit of key."""
        parts = [head(descriptors) for head, wanted in ((self.data_head, data), (self.physics_head, physics)) if wanted]
        return torch.stack(parts).sum(dim=0).reshape(len(descriptors), -1, 3)

    def absolute_keys(self, features: Tensor) -> Tensor:
        """g: encoded poses (T, 72) to keys (T, P), each row of positive numbers that sum to 1."""
        keys = torch.relu(self.pose_head(features))
        return keys / (keys.sum(dim=1, keepdim=True) + NORMALIZED_RELU_EPSILON)

    def pose_keys(self, features: Tensor) -> Tensor:
        """f(θ) = g(θ) − g(rest): zero at rest. (T, 72) to (T, P)."""
        rest = torch.zeros(1, self.config.pose_features, dtype=features.dtype)
        both = self.absolute_keys(torch.cat([rest, features]))
        return both[1:] - both[:1]
