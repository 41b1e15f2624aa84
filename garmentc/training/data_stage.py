"""Stage A: Φ, Ω, Ψ and the pose MLP learn the simulated vertices (Bertiche et al. 2021, section 4.3 and 9)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from garmentc.training.batch_plan import Batch, BatchPlan
from garmentc.training.deepsd_network import Deepsd, Descriptors
from garmentc.training.losses import MM, edge_lengths, largest, skin
from garmentc.training.mirroring import mirrored_poses, mirrored_sample, mirrored_transforms, mirrored_vertices
from garmentc.training.outfit_sample import OutfitSample
from garmentc.training.pose_encodings import POSE_ENCODINGS
from garmentc.training.recipe import Optimisation, Recipe
from garmentc.training.simulated_outfits import SimulatedOutfit

NAME = "data"
_TINY = 1e-9


@dataclass(frozen=True)
class DataLearning:
    """A `garmentc.training.stage.Stage`."""

    network: Deepsd
    recipe: Recipe
    outfits: tuple[SimulatedOutfit, ...]
    name: str = NAME

    @property
    def plan(self) -> BatchPlan:
        settings = self.recipe.data
        counts = tuple(len(outfit) for outfit in self.outfits)
        return BatchPlan(counts, settings.poses, settings.steps, settings.outfits_per_step, (self.recipe.seed, 0))

    @property
    def optimisation(self) -> Optimisation:
        return self.recipe.data

    def parameters(self) -> Iterable[nn.Parameter]:
        """All but χ."""
        return (parameter for name, parameter in self.network.named_parameters() if not name.startswith("physics_head"))

    def losses(self, batch: Batch, done: float) -> tuple[Tensor, dict[str, Tensor]]:
        """What to minimise, and its terms."""
        settings, network = self.recipe.data, self.network
        rng = np.random.default_rng(batch.seed)
        outfit = self.outfits[batch.outfit]
        sample, poses = outfit.sample, outfit.poses[batch.poses]
        rows, edges, rest_lengths = None, sample.edges, sample.rest_lengths
        if 0 < settings.vertices < len(sample.vertices):
            if settings.edge:
                rows, edges, rest_lengths = drawn_edges(sample, settings.vertices, rng)
            else:
                rows = np.sort(rng.choice(len(sample.vertices), settings.vertices, replace=False))
        targets = outfit.targets(batch.poses, rows)
        transforms = outfit.transforms[batch.poses]
        if rng.random() < 0.5 * self.recipe.mirror:
            sample, poses, targets = mirrored_sample(sample), mirrored_poses(poses), mirrored_vertices(targets)
            transforms = mirrored_transforms(transforms)
        withheld = rng.random() < settings.metadata_dropout
        device = sample.vertices.device

        def tensor(array: NDArray[Any]) -> Tensor:
            return torch.from_numpy(array).to(device)

        metadata = None if withheld else tensor(outfit.metadata)
        influences = int(rng.choice(settings.influences))

        chosen = tensor(np.arange(len(sample.vertices)) if rows is None else rows)
        descriptors = network.descriptors(*sample.seen, metadata, chosen)
        if settings.dropout:
            descriptors = _thinned(descriptors, settings.dropout, int(rng.integers(1 << 31)))
        weights = network.blend_weights(descriptors)
        features = POSE_ENCODINGS[network.config.pose_encoding].encode(poses).astype(np.float32)
        deformations = network.deformations(descriptors, tensor(features), physics=False)
        posed = skin(sample.vertices[chosen] + deformations, largest(weights, influences), tensor(transforms))
        distance = (posed - tensor(targets)) * MM
        terms = {
            "distance": (distance.square().sum(dim=-1) + 1e-6).sqrt().mean(),
            "squared": distance.square().sum(dim=-1).mean(),
            "weights": -(sample.skin[chosen] * (weights + _TINY).log()).sum(dim=1).mean(),
            "deformation": (deformations * MM).square().sum(dim=-1).mean(),
        }
        total = terms[settings.loss]
        if settings.edge:
            terms["edge"] = (edge_lengths(posed, edges) - rest_lengths).abs().mean() * MM
            total = total + settings.edge * terms["edge"]
        if done < settings.prior_share:
            fading = 0.1 ** (done / settings.prior_share)
            priors = settings.weight_prior * terms["weights"] + settings.deformation_prior * terms["deformation"]
            total = total + fading * priors
        return total, terms


def drawn_edges(
    sample: OutfitSample, vertices: int, rng: np.random.Generator
) -> tuple[NDArray[np.intp], Tensor, Tensor]:
    """Some edges: the vertices at their ends, at most `vertices`; the edges as indices into those; lengths at rest."""
    count = min(vertices // 2, len(sample.edges))
    drawn = torch.from_numpy(rng.choice(len(sample.edges), count, replace=False)).to(sample.edges.device)
    rows, ends = np.unique(sample.edges[drawn].cpu().numpy(), return_inverse=True)
    return rows, torch.from_numpy(ends.reshape(-1, 2)).to(sample.edges.device), sample.rest_lengths[drawn]


def _thinned(descriptors: Descriptors, share: float, seed: int) -> Descriptors:
    """Whole channels dropped, the others scaled up (Srivastava et al. 2014): the same channels at every vertex."""
    generator = torch.Generator().manual_seed(seed)

    def thinned(x: Tensor) -> Tensor:
        kept = (torch.rand(x.shape[-1], generator=generator) >= share) / (1 - share)
        return x * kept.to(x)

    return descriptors._replace(local=thinned(descriptors.local), shared=thinned(descriptors.shared))
