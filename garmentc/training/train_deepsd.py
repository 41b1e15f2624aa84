"""Train DeePSD on procedural outfits with physics losses alone.

Stage 0 trains Φ and Ω towards the blend weights of the nearest body vertex. Stage 1 trains Φ, Ω, Ψ and the pose MLP
on the edge, bend, collision and small-deformation losses over sampled poses. Stage 2 trains χ alone on the same
losses, as the paper does. Needs no simulation and no motion capture.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from garmentc.rig import encode_pose
from garmentc.training.deepsd_network import Deepsd, DeepsdConfig
from garmentc.training.losses import (
    MM,
    bend_loss,
    collision_loss,
    edge_lengths,
    edge_loss,
    skin,
    vertex_normals,
)
from garmentc.training.outfit_sample import OutfitSample
from garmentc.training.pose_pool import PosedBodies


@dataclass(frozen=True)
class TrainingConfig:
    """How long, how fast, and what each loss weighs (losses are in mm², see `garmentc.training.losses`)."""

    seed: int = 0
    minutes: float = 60.0
    stage_ends: tuple[float, float, float] = (0.04, 0.72, 1.0)  # of the time
    outfits_per_step: int = 2
    poses_per_outfit: int = 12
    learning_rate: float = 1e-3
    final_learning_rate: float = 3e-5
    epsilon: float = 0.005  # metres of clearance asked for (the paper's)
    edge: float = 1.0
    bend: float = 5.0
    collision: float = 3.0
    deformation: float = 0.01
    prior: float = 100.0  # on the blend weights; fades over the first tenth of stage 1
    prior_floor: float = 1.0
    influences: tuple[int, ...] = (4, 4, 8, 24)  # one is drawn per outfit and step: assets keep the largest 4 or 8


@dataclass(frozen=True)
class Example:
    """An outfit and the posed bodies it meets."""

    outfit: OutfitSample
    bodies: PosedBodies


@dataclass
class TrainingState:
    """What a checkpoint holds beside the network."""

    stage: int = 0
    step: int = 0
    seconds: float = 0.0  # of training so far, in all sessions


def largest(weights: Tensor, influences: int) -> Tensor:
    """Blend weights (N, 24) with all but the largest `influences` of each row dropped and the rest rescaled."""
    if influences >= weights.shape[1]:
        return weights
    kept, joints = weights.topk(influences, dim=1)
    return torch.zeros_like(weights).scatter(1, joints, kept / kept.sum(dim=1, keepdim=True))


def posed_outfit(
    network: Deepsd, example: Example, chosen: NDArray[Any], stage: int, influences: int
) -> tuple[Tensor, Tensor, Tensor]:
    """Posed vertices (B, N, 3), the deformations before skinning (B, N, 3) and blend weights (N, 24).

    Skinning uses the largest `influences` weights of each vertex, the weights returned are all.
    """
    outfit, bodies = example.outfit, example.bodies
    with torch.set_grad_enabled(stage == 1 and torch.is_grad_enabled()):
        descriptors = network.descriptors(outfit.vertices, outfit.normals, outfit.mean)
        weights = network.blend_weights(descriptors)
        features = torch.from_numpy(encode_pose(bodies.poses[chosen]).astype(np.float32))
        keys = network.pose_keys(features)
        shapes = network.blend_shapes(descriptors, physics=False)
    if stage == 2:
        shapes = shapes + network.blend_shapes(descriptors, data=False)
    deformations = torch.einsum("bp,npc->bnc", keys, shapes)
    transforms = torch.from_numpy(bodies.transforms[chosen])
    vertices = skin(outfit.vertices + deformations, largest(weights, influences), transforms)
    return vertices, deformations, weights


def physics_losses(
    vertices: Tensor, deformations: Tensor, example: Example, chosen: NDArray[Any], config: TrainingConfig
) -> dict[str, Tensor]:
    """The paper's four physics terms, unweighted."""
    outfit = example.outfit
    points, normals = example.bodies.nearest(chosen, vertices.detach().numpy())
    return {
        "edge": edge_loss(edge_lengths(vertices, outfit.edges), outfit.rest_lengths),
        "bend": bend_loss(vertex_normals(vertices, outfit.triangles), outfit.edges, outfit.counts),
        "collision": collision_loss(vertices, torch.from_numpy(points), torch.from_numpy(normals), config.epsilon),
        "deformation": (deformations * MM).square().sum(dim=-1).mean(),
    }


def train(
    examples: list[Example],
    held_out: list[Example],
    config: TrainingConfig,
    folder: Path,
    network_config: DeepsdConfig | None = None,
    log: Callable[[str], None] = print,
) -> Deepsd:
    """Train until the time is up; continue from `folder`/checkpoint.pt where there is one."""
    folder.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(config.seed)
    network = Deepsd(network_config)
    state = TrainingState()
    checkpoint = folder / "checkpoint.pt"
    optimizer_state: dict[str, Any] | None = None
    if checkpoint.exists():
        saved = torch.load(checkpoint, weights_only=True)
        network.load_state_dict(saved["network"])
        state = TrainingState(**saved["state"])
        optimizer_state = saved["optimizer"]
    while True:
        _train_stage(network, examples, held_out, config, state, optimizer_state, checkpoint, log)
        if state.stage == 2:
            return network
        state, optimizer_state = TrainingState(stage=state.stage + 1, seconds=state.seconds), None


def _trained_parameters(network: Deepsd, stage: int) -> list[torch.nn.Parameter]:
    parts: dict[int, list[torch.nn.Module]] = {
        0: [network.convolutions, network.global_layer, network.weight_head],
        1: [network.convolutions, network.global_layer, network.weight_head, network.data_head, network.pose_head],
        2: [network.physics_head],
    }
    return [parameter for module in parts[stage] for parameter in module.parameters()]


def _step_losses(
    network: Deepsd,
    example: Example,
    chosen: NDArray[Any],
    config: TrainingConfig,
    stage: int,
    done: float,
    influences: int,
) -> tuple[Tensor, dict[str, Tensor]]:
    """The loss to minimise and its terms; `done` is the share of the stage that is over."""
    outfit = example.outfit
    if stage == 0:
        descriptors = network.descriptors(outfit.vertices, outfit.normals, outfit.mean)
        logarithms = torch.log_softmax(network.weight_head(descriptors), dim=1)
        entropy = -(outfit.prior * logarithms).sum(dim=1).mean()
        return entropy, {"prior": (logarithms.exp() - outfit.prior).square().sum(dim=1).mean()}
    vertices, deformations, weights = posed_outfit(network, example, chosen, stage, influences)
    losses = physics_losses(vertices, deformations, example, chosen, config)
    total = (
        config.edge * losses["edge"]
        + config.bend * losses["bend"]
        + config.collision * losses["collision"]
        + config.deformation * losses["deformation"]
    )
    if stage == 1:
        losses["prior"] = (weights - outfit.prior).square().sum(dim=1).mean()
        fading = max(0.0, 1 - 10 * done)
        total = total + (config.prior * fading + config.prior_floor) * losses["prior"]
    return total, losses


def _train_stage(
    network: Deepsd,
    examples: list[Example],
    held_out: list[Example],
    config: TrainingConfig,
    state: TrainingState,
    optimizer_state: dict[str, Any] | None,
    checkpoint: Path,
    log: Callable[[str], None],
) -> None:
    parameters = _trained_parameters(network, state.stage)
    optimizer = torch.optim.Adam(parameters, lr=config.learning_rate)
    if optimizer_state is not None:
        optimizer.load_state_dict(optimizer_state)
    start, end = (60 * config.minutes * share for share in (0.0, *config.stage_ends)[state.stage : state.stage + 2])
    saved_at = logged_at = time.monotonic()
    sums: dict[str, float] = {}
    count = 0
    while state.seconds < end:
        began = time.monotonic()
        done = (state.seconds - start) / (end - start)
        rng = np.random.default_rng([config.seed, state.stage, state.step])
        rate = config.final_learning_rate + (config.learning_rate - config.final_learning_rate) * 0.5 * (
            1 + np.cos(np.pi * done)
        )
        for group in optimizer.param_groups:
            group["lr"] = float(rate)  # a numpy number would keep the checkpoint from being read back
        optimizer.zero_grad()
        for index in rng.choice(len(examples), config.outfits_per_step, replace=False):
            example = examples[index]
            chosen = rng.choice(len(example.bodies), config.poses_per_outfit, replace=False)
            influences = int(rng.choice(config.influences))
            total, losses = _step_losses(network, example, chosen, config, state.stage, done, influences)
            (total / config.outfits_per_step).backward()  # type: ignore[no-untyped-call]
            for name, value in losses.items():
                sums[name] = sums.get(name, 0.0) + float(value)
            count += 1
        torch.nn.utils.clip_grad_norm_(parameters, 50.0)
        optimizer.step()
        state.step += 1
        now = time.monotonic()
        state.seconds += now - began
        if now - logged_at > 60:
            terms = " ".join(f"{name} {value / count:.4f}" for name, value in sums.items())
            measured = measure(network, held_out, state.stage)
            figures = " ".join(f"{name} {value:.3f}" for name, value in measured.items())
            place = f"stage {state.stage} step {state.step} {state.seconds / 60:.1f} min lr {rate:.1e}"
            log(f"{place} | {terms} | {figures}")
            sums, count, logged_at = {}, 0, time.monotonic()
        if now - saved_at > 120:
            _save(network, optimizer, state, checkpoint)
            saved_at = time.monotonic()
    _save(network, optimizer, state, checkpoint)


def _save(network: Deepsd, optimizer: torch.optim.Optimizer, state: TrainingState, path: Path) -> None:
    part = path.with_suffix(".part")
    torch.save({"network": network.state_dict(), "optimizer": optimizer.state_dict(), "state": asdict(state)}, part)
    part.replace(path)


def measure(network: Deepsd | None, examples: list[Example], stage: int = 2) -> dict[str, float]:
    """Collision share (%) and edge error (mm) over all poses of the examples, four influences a vertex.

    Without a network: skinning with the weights of the nearest body vertex.
    """
    collided, edges = [], []
    with torch.no_grad():
        for example in examples:
            outfit = example.outfit
            chosen = np.arange(len(example.bodies))
            if network is None:
                rest = outfit.vertices.expand(len(chosen), -1, -1)
                vertices = skin(rest, outfit.prior, torch.from_numpy(example.bodies.transforms))
            else:
                vertices = posed_outfit(network, example, chosen, stage, influences=4)[0]
            points, normals = example.bodies.nearest(chosen, vertices.numpy())
            clearance = ((vertices.numpy() - points) * normals).sum(axis=-1)
            collided.append(float((clearance < 0).mean()))
            edges.append(float((edge_lengths(vertices, outfit.edges) - outfit.rest_lengths).abs().mean()))
    return {"collided%": 100 * float(np.mean(collided)), "edge_mm": MM * float(np.mean(edges))}
