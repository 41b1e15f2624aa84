"""A simulator for tests: skinning and a little noise in place of physics. Fast, deterministic, picklable."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np

from garmentc.simulation.outfits import generate_outfit
from garmentc.simulation.plan import Task, outfit_document
from garmentc.simulation.sequence import REASONS, QualityTrack, Sequence, SequenceFacts
from garmentc.simulation.task_graph import RejectedSequence
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.nearest import nearest_vertex
from garmentc.smpl.pose_sampler import sample_poses

__all__ = ["fail_some", "kill_first_worker", "skinned_patch", "slow_patch", "whole_outfit"]


def skinned_patch(task: Task) -> Sequence:
    """A strip of the body's skin, moved out by a little noise, wherever the task's outfit would be."""
    parameters = task.outfit.parameters
    body = load_default_body(parameters.gender)
    betas = np.asarray(parameters.betas)
    rng = np.random.default_rng(task.seed)
    if task.motion.clip is None:
        poses = 0.3 * sample_poses(task.motion.frames, task.motion.seed)
        trans = np.cumsum(rng.normal(0, 0.01, (len(poses), 3)), axis=0)
    else:
        poses, trans = task.motion.clip.poses, task.motion.clip.trans
    faces = body.faces[1000:1060]
    used, triangles = np.unique(faces, return_inverse=True)
    posed = body.posed(poses, betas, trans)[:, used] + rng.normal(0, 1e-3, (len(poses), len(used), 3))
    frames = len(poses)
    quality = QualityTrack.unmeasured(frames)
    quality.rejected[frames // 3] = 1 << REASONS.index("stretch")
    quality.strain[:, 2] = rng.uniform(1, 1.2, frames)
    quality.penetration[:] = 0.001
    facts = SequenceFacts(
        name=task.name,
        outfit=task.outfit.name,
        motion=task.motion.group,
        category=parameters.category,
        fabric=task.outfit.fabric,
        body=body.name,
        gender=parameters.gender,
        fps=30.0,
        seed=task.seed,
        parts=tuple(garment.kind for garment in parameters.garments),
        tightness=(),
        parameters=outfit_document(task.outfit),
    )
    return Sequence(
        facts,
        body.shaped(betas)[used].astype(np.float32),
        triangles.reshape(-1, 3).astype(np.int32),
        np.zeros(len(faces), np.int32),
        None,
        betas.astype(np.float32),
        poses.astype(np.float32),
        trans.astype(np.float32),
        posed.astype(np.float32),
        quality,
    )


def slow_patch(task: Task) -> Sequence:
    """The same, slowly enough to be killed in the middle."""
    time.sleep(0.1)
    return skinned_patch(task)


def fail_some(task: Task) -> Sequence:
    """Some outfits explode, some come out bad, in some the simulator has a bug."""
    number = int(task.outfit.name[-4:])
    if number == 1:
        raise RejectedSequence("explosion", "frame 7: a vertex moved by 12 m")
    if number == 2:
        raise ZeroDivisionError("division by zero")
    sequence = skinned_patch(task)
    if number == 3:
        sequence.vertices[2, 5] = np.nan
    if number == 4:
        sequence.quality.rejected[:] = 1 << REASONS.index("jump")
    return sequence


def kill_first_worker(task: Task) -> Sequence:
    """The first worker to come here is killed as it writes; later ones find the mark that it left in $KILL_ONCE."""
    mark = Path(os.environ["KILL_ONCE"])
    if not mark.exists():
        mark.touch()
        mark.with_name("data").joinpath("sequences", ".torn.npz.1.tmp").touch()
        os.kill(os.getpid(), 9)
    return skinned_patch(task)


def whole_outfit(task: Task) -> Sequence:
    """The task's own outfit, skinned rigidly with the nearest body vertices: slower, and looks like clothes."""
    from dataclasses import replace

    from garmentc.smpl.rotations import axis_angle_to_matrix
    from garmentc.smpl.skinning import joint_transforms, skin

    patch = skinned_patch(task)
    body = load_default_body(task.outfit.parameters.gender)
    betas = np.asarray(task.outfit.parameters.betas)
    outfit = generate_outfit(task.outfit.parameters, body)
    weights = body.weights[nearest_vertex(outfit.vertices, body.shaped(betas))]
    transforms = joint_transforms(axis_angle_to_matrix(patch.poses), body.joints(betas), patch.trans)
    posed = skin(np.repeat(outfit.vertices[None], len(patch), axis=0), weights, transforms)
    return replace(
        patch,
        template=outfit.vertices.astype(np.float32),
        faces=outfit.triangles,
        triangle_part=outfit.triangle_part,
        vertices=posed.astype(np.float32),
    )
