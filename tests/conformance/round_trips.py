"""What other people's tools make of a file that they read and write: is it the same, and can an engine drive it?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import engine_runs
import numpy as np
from engine_runs import Refused
from scipy.spatial import cKDTree

from conformance.subject import Subject
from garmentc.smpl.pose_sampler import sample_poses


@dataclass(frozen=True)
class Trip:
    """What is done to a file.

    program  one of the rewrite_*.mjs
    job      what it wants to know
    """

    name: str
    program: str
    job: dict[str, Any] = field(hash=False)

    def __str__(self) -> str:
        return self.name


def _gltf_transform(name: str, *steps: str) -> Trip:
    return Trip(f"glTF-Transform {name}", "rewrite_gltf_transform.mjs", {"steps": steps})


def _gltfpack(*flags: str) -> Trip:
    kept = ("-kn", "-km", "-ke", "-kv", "-af", "0", *flags)
    return Trip(" ".join(("gltfpack", *kept)), "rewrite_gltfpack.mjs", {"flags": kept})


COPY = _gltf_transform("read, write")
DENSE = _gltf_transform("sparse --ratio 0", "dense")
TIDY = _gltf_transform("dedup, flatten, weld, prune", "dense", "dedup", "flatten", "weld", "prune")
OPTIMIZED = _gltf_transform("the same, resample", "dense", "dedup", "flatten", "weld", "prune", "resample")
MESHOPT = _gltf_transform("dedup, meshopt", "dense", "dedup", "meshopt")
PACKED = _gltfpack()
FLOAT_PACKED = _gltfpack("-noq")
COMPRESSED = _gltfpack("-cc")
TRIPS = (COPY, DENSE, TIDY, OPTIMIZED, MESHOPT, FLOAT_PACKED, PACKED, COMPRESSED)


@dataclass(frozen=True)
class Returned:
    """A file that came back. Errors in metres: distance to the nearest vertex of the rig, and the other way round.

    clip    largest at frames of the animation
    driven  largest in poses of no animation, the joints set by hand and the morphs by the file's pose-key network;
            or why there was none
    issues  the Khronos validator's errors and warnings
    """

    glb: Path
    clip: float
    driven: float | Refused
    issues: tuple[str, ...]


def make_trips(journeys: Sequence[tuple[Trip, Subject]], folder: Path) -> list[Returned]:
    """Send files through tools, and look at what comes back in three.js."""
    glbs = _rewritten(journeys, folder)
    poses, translations = sample_poses(6, seed=4), 0.3 * np.random.default_rng(4).normal(size=(6, 3))
    driven = engine_runs.try_posed_positions(glbs, poses, translations, folder)
    reports = engine_runs.khronos_reports(glbs, folder)
    jobs = [{"glb": str(glb), "times": subject.times} for glb, (_, subject) in zip(glbs, journeys, strict=True)]
    clips = engine_runs.run("three_cpu.mjs", jobs, folder)
    returned = []
    for (_, subject), glb, clip, moved, report in zip(journeys, glbs, clips, driven, reports, strict=True):
        shown = np.fromfile(clip).reshape(len(subject.times), -1, 3)
        truth = subject.posed(poses, translations, influences=4)
        serious = {message["code"] for message in report["issues"]["messages"] if message["severity"] < 2}
        returned.append(
            Returned(
                glb=glb,
                clip=farthest(shown, subject.positions(influences=4)),
                driven=moved if isinstance(moved, Refused) else farthest(moved, truth),
                issues=tuple(sorted(serious)),
            )
        )
    return returned


def _rewritten(journeys: Sequence[tuple[Trip, Subject]], folder: Path) -> list[Path]:
    glbs = [folder / f"{subject.glb.stem}-back-{number}.glb" for number, (_, subject) in enumerate(journeys)]
    for program in sorted({trip.program for trip, _ in journeys}):
        chosen = [number for number, (trip, _) in enumerate(journeys) if trip.program == program]
        jobs = [{"glb": str(journeys[number][1].glb), **journeys[number][0].job} for number in chosen]
        for number, out in zip(chosen, engine_runs.run(program, jobs, folder), strict=True):
            out.replace(glbs[number])
    return glbs


def farthest(found: np.ndarray, expected: np.ndarray) -> float:
    """The largest distance from any of (T, S, 3) to the nearest of (T, S', 3) at the same time, and back; metres."""
    return max(
        float(cKDTree(there).query(here)[0].max())
        for frame, truth in zip(found, expected, strict=True)
        for here, there in ((frame, truth), (truth, frame))
    )


def clipped(subject: Subject) -> np.ndarray:
    """(T, S, 3) at `times` with all morph weights brought between 0 and 1, as gltfpack stores them; metres."""
    from garmentc.gltf.evaluate import world_positions
    from garmentc.gltf.posing import state_at_time
    from garmentc.gltf.read import read_glb

    glb = read_glb(subject.glb)
    frames = []
    for time in subject.times:
        state = state_at_time(glb, time)
        held = replace(state, weights={node: np.clip(weights, 0, 1) for node, weights in state.weights.items()})
        frames.append(np.concatenate(world_positions(glb, held)))
    return np.stack(frames)
