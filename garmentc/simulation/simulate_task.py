"""A task carried out in earnest: outfit made, motion prepared, cloth simulated, every frame judged."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.simulation.cloth_simulator import Cloth, simulate
from garmentc.simulation.fabrics import FABRICS
from garmentc.simulation.motion_preparation import PreparationOptions, PreparedMotion, prepare_motion
from garmentc.simulation.outfits import GeneratedOutfit, generate_outfit
from garmentc.simulation.panels import lay_flat
from garmentc.simulation.pins import pin, worn_tight
from garmentc.simulation.plan import PlannedMotion, PlannedOutfit, Task, outfit_document
from garmentc.simulation.pose_walk import WalkOptions, pose_walk
from garmentc.simulation.quads import pair_triangles
from garmentc.simulation.quality_gate import SequenceQuality, check_sequence
from garmentc.simulation.sequence import REASONS, QualityTrack, Sequence, SequenceFacts, Texcoords
from garmentc.simulation.simulation_settings import SimulationSettings
from garmentc.simulation.task_graph import RejectedSequence
from garmentc.simulation.tshirt import fit_tshirt
from garmentc.smpl.body import BodyModel
from garmentc.smpl.default_body import load_default_body

SETTINGS = SimulationSettings()


def simulate_task(task: Task) -> Sequence:
    """The task's sequence by physics; a `task_graph.Simulator`. The way in from rest is simulated but not kept.

    Raises RejectedSequence where the outfit cannot be made, the cloth explodes, or too few frames are good.
    """
    body = load_default_body(task.outfit.parameters.gender)
    betas = np.asarray(task.outfit.parameters.betas)
    try:
        outfit, texcoords = make_outfit(task.outfit)
    except ValueError as error:
        raise RejectedSequence("outfit", str(error)) from None
    rest = body.shaped(betas)
    pins = pin(outfit.vertices, worn_tight(outfit), rest, body.faces, SETTINGS.clearance)
    try:
        prepared = prepared_motion(task.motion, body, betas)
        body_frames = body.posed(prepared.motion.poses, betas, prepared.motion.trans)
        cloth = Cloth(outfit.vertices, outfit.triangles, FABRICS[task.outfit.fabric], pins)
        simulated = simulate(cloth, rest, body_frames, body.faces, SETTINGS)
    except GarmentcError as error:
        raise RejectedSequence("simulation", error.message) from None
    proper = slice(prepared.lead_in, None)
    frames = simulated.frames[proper]
    judged = check_sequence(outfit.vertices, outfit.triangles, frames, body_frames[proper], body.faces)
    if not judged.accepted:
        raise RejectedSequence(judged.reasons[0].split(":")[0], "; ".join([*judged.reasons, _counts(judged)]))
    return Sequence(
        facts=_facts(task, body),
        template=simulated.template,
        faces=outfit.triangles.astype(np.int32),
        triangle_part=outfit.triangle_part,
        texcoords=texcoords,
        betas=betas.astype(np.float32),
        poses=prepared.motion.poses[proper].astype(np.float32),
        trans=prepared.motion.trans[proper].astype(np.float32),
        vertices=frames,
        quality=_track(judged, prepared),
    )


@lru_cache(maxsize=1)
def make_outfit(planned: PlannedOutfit) -> tuple[GeneratedOutfit, Texcoords]:
    """The outfit and its panels laid flat. Raises ValueError where its parameters leave no cloth."""
    if planned.tshirt is not None:
        outfit = fit_tshirt(planned.tshirt, planned.parameters)
    else:
        outfit = generate_outfit(planned.parameters, load_default_body(planned.parameters.gender))
    partner = pair_triangles(outfit.vertices, outfit.triangles, outfit.triangle_part)
    panels = lay_flat(outfit.vertices, outfit.triangles, outfit.triangle_part, partner)
    return outfit, Texcoords(panels.texcoords.astype(np.float32), panels.corners.astype(np.int32))


def prepared_motion(planned: PlannedMotion, body: BodyModel, betas: NDArray[np.float64]) -> PreparedMotion:
    """The motion as the body with shape `betas` (S,) can do it. Walks are clear already: no arms need opening."""
    if planned.clip is not None:
        return prepare_motion(planned.clip, body, betas, PreparationOptions(fps=SETTINGS.fps))
    walk = pose_walk(planned.frames, planned.seed, body, betas, WalkOptions(fps=SETTINGS.fps, poses=planned.poses))
    return prepare_motion(walk, body, betas, PreparationOptions(fps=SETTINGS.fps, arms=0.0))


def _facts(task: Task, body: BodyModel) -> SequenceFacts:
    parameters = task.outfit.parameters
    return SequenceFacts(
        name=task.name,
        outfit=task.outfit.name,
        motion=task.motion.group,
        category=parameters.category,
        fabric=task.outfit.fabric,
        body=body.name,
        gender=parameters.gender,
        fps=SETTINGS.fps,
        seed=task.seed,
        parts=tuple(garment.kind for garment in parameters.garments),
        tightness=(),
        parameters=outfit_document(task.outfit),
    )


def _track(judged: SequenceQuality, prepared: PreparedMotion) -> QualityTrack:
    """The gate's verdicts as arrays, and frames without room for cloth rejected too."""
    rejected = np.zeros(len(judged.frames), np.uint16)
    for at, frame in enumerate(judged.frames):
        for reason in frame.reasons:
            rejected[at] |= 1 << REASONS.index(reason.split(":")[0])
    rejected[~prepared.clear[prepared.lead_in :]] |= 1 << REASONS.index("body")
    return QualityTrack(
        rejected,
        np.array([frame.penetration for frame in judged.frames], np.float32),
        np.array([frame.depth for frame in judged.frames], np.float32),
        np.array([frame.crossings for frame in judged.frames], np.int32),
        np.array([frame.strain for frame in judged.frames], np.float32),
        np.array([frame.jump for frame in judged.frames], np.float32),
    )


def _counts(judged: SequenceQuality) -> str:
    return ", ".join(f"{name} {count}" for name, count in judged.rejections.items())
