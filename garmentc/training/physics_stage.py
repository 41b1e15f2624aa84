"""Stage B: χ alone learns cloth consistency and clearance, in poses that were simulated and in poses that were not.

What χ adds to is frozen, so descriptors, blend weights and Ψ's shapes are computed once for each outfit (Bertiche et
al. 2021, section 4.3).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from garmentc.training.batch_plan import Batch, BatchPlan
from garmentc.training.deepsd_network import Deepsd, Descriptors, combined
from garmentc.training.losses import (
    MM,
    bend_loss,
    collision_loss,
    edge_lengths,
    edge_loss,
    largest,
    skin,
    vertex_normals,
)
from garmentc.training.mirroring import mirrored_poses, mirrored_sample, mirrored_transforms
from garmentc.training.pose_encodings import POSE_ENCODINGS
from garmentc.training.posed_bodies import PosedBodies, joined, pose_body, random_bodies
from garmentc.training.recipe import Optimisation, PhysicsStage, Recipe
from garmentc.training.simulated_outfits import SimulatedOutfit

NAME = "physics"


@dataclass(frozen=True)
class _Frozen:
    """What χ does not change: descriptors, blend weights (N, 24), Ψ's shapes (N, P, 3)."""

    descriptors: Descriptors
    weights: Tensor
    shapes: Tensor


@dataclass(frozen=True)
class PhysicsLearning:
    """A `garmentc.training.stage.Stage`."""

    network: Deepsd
    recipe: Recipe
    settings: PhysicsStage
    outfits: tuple[SimulatedOutfit, ...]
    name: str = NAME
    _frozen: dict[tuple[int, bool], _Frozen] = field(default_factory=dict, repr=False)
    _bodies: dict[int, PosedBodies] = field(default_factory=dict, repr=False)

    @property
    def plan(self) -> BatchPlan:
        settings = self.settings
        counts = tuple(min(len(outfit), settings.bodies) + settings.random_bodies for outfit in self.outfits)
        return BatchPlan(counts, settings.poses, settings.steps, settings.outfits_per_step, (self.recipe.seed, 1))

    @property
    def optimisation(self) -> Optimisation:
        return self.settings

    def parameters(self) -> Iterable[nn.Parameter]:
        """χ."""
        return self.network.physics_head.parameters()

    def losses(self, batch: Batch, done: float) -> tuple[Tensor, dict[str, Tensor]]:
        """What to minimise, and its terms."""
        settings, network = self.settings, self.network
        rng = np.random.default_rng(batch.seed)
        mirror = bool(rng.random() < 0.5 * self.recipe.mirror)
        influences = int(rng.choice(settings.influences))
        outfit, bodies = self.outfits[batch.outfit], self.bodies(batch.outfit)
        sample, frozen = outfit.sample, self.frozen(batch.outfit, mirror)
        poses, transforms = bodies.poses[batch.poses], bodies.transforms[batch.poses]
        if mirror:
            poses, transforms = mirrored_poses(poses), mirrored_transforms(transforms)
        rest = mirrored_sample(sample).vertices if mirror else sample.vertices

        def tensor(array: NDArray[Any]) -> Tensor:
            return torch.from_numpy(array).to(rest.device)

        features = POSE_ENCODINGS[network.config.pose_encoding].encode(poses).astype(np.float32)
        with torch.no_grad():
            keys = network.pose_keys(tensor(features))
            learned = combined(keys, frozen.shapes)
        deformations = combined(keys, network.blend_shapes(frozen.descriptors, data=False))
        weights = largest(frozen.weights, influences)
        vertices = skin(rest + learned + deformations, weights, tensor(transforms))
        if mirror:  # back to where the bodies are
            vertices = vertices * vertices.new_tensor([-1.0, 1.0, 1.0])

        points, normals = bodies.nearest(batch.poses, vertices.detach().cpu().numpy(), surface=settings.surface)
        terms = {
            "edge": edge_loss(edge_lengths(vertices, sample.edges), sample.rest_lengths),
            "bend": bend_loss(vertex_normals(vertices, sample.triangles), sample.edges, sample.counts),
            "collision": collision_loss(vertices, tensor(points), tensor(normals), settings.epsilon),
            "deformation": (deformations * MM).square().sum(dim=-1).mean(),
        }
        total = (
            settings.edge * terms["edge"]
            + settings.bend * terms["bend"]
            + settings.collision * terms["collision"]
            + settings.deformation * terms["deformation"]
        )
        return total, terms

    def frozen(self, index: int, mirror: bool) -> _Frozen:
        """What χ does not change about an outfit."""
        if (index, mirror) not in self._frozen:
            outfit, network = self.outfits[index], self.network
            sample = mirrored_sample(outfit.sample) if mirror else outfit.sample
            with torch.no_grad():
                metadata = torch.from_numpy(outfit.metadata).to(sample.vertices.device)
                descriptors = network.descriptors(*sample.seen, metadata)
                shapes = network.blend_shapes(descriptors, physics=False)
                self._frozen[index, mirror] = _Frozen(descriptors, network.blend_weights(descriptors), shapes)
        return self._frozen[index, mirror]

    def bodies(self, index: int) -> PosedBodies:
        """The posed bodies that an outfit meets: simulated poses spread over its sequences, then random ones."""
        if index not in self._bodies:
            outfit, settings = self.outfits[index], self.settings
            count = min(len(outfit), settings.bodies)
            spread = np.linspace(0, len(outfit) - 1, count).round().astype(np.intp)
            parts = [pose_body(outfit.sample.body, outfit.poses[spread])]
            if settings.random_bodies:
                seed = (self.recipe.seed, 2, index)
                parts.append(random_bodies(outfit.sample.body, settings.random_bodies, seed))
            self._bodies[index] = joined(parts)
        return self._bodies[index]
