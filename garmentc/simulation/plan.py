"""What a dataset shall contain: outfits and motions, drawn from a preset and a seed and nothing else."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from garmentc import __version__
from garmentc.errors import GarmentcError
from garmentc.simulation.outfit_parameters import CATEGORIES, OutfitParameters
from garmentc.simulation.outfit_sampling import sample_parameters
from garmentc.simulation.presets import FABRICS, Preset
from garmentc.simulation.splits import digest, is_block_held_out, lowest, split_name
from garmentc.simulation.tshirt import TshirtStyle, tshirt_parameters, tshirt_style
from garmentc.smpl.motion import Motion


@dataclass(frozen=True)
class PlannedOutfit:
    """One outfit of the plan. `tshirt` is the style of the fixed-topology T-shirt, None for other outfits."""

    name: str
    parameters: OutfitParameters
    fabric: str
    held_out: bool
    tshirt: TshirtStyle | None = None


@dataclass(frozen=True)
class PlannedMotion:
    """One motion of the plan: a clip from a file, or where that is None a walk through sampled poses, from `seed`.

    name   of this stretch
    group  of the whole motion, which several stretches may share; splits never part a group
    poses  where those of a walk come from, a name of `pose_walk.POSE_SOURCES`
    """

    name: str
    group: str
    frames: int
    seed: int
    clip: Motion | None
    held_out: bool
    poses: str = "ranges"


@dataclass(frozen=True)
class Task:
    """One sequence to simulate. `seed` is its own; its result depends on nothing but the task."""

    outfit: PlannedOutfit
    motion: PlannedMotion
    seed: int

    @property
    def name(self) -> str:
        return f"{self.outfit.name}.{self.motion.name}"

    @property
    def split(self) -> str:
        return split_name(self.outfit.held_out, self.motion.held_out)


@dataclass(frozen=True)
class Plan:
    """All sequences of a dataset, in order."""

    preset: Preset
    seed: int
    outfits: tuple[PlannedOutfit, ...]
    motions: tuple[PlannedMotion, ...]

    def tasks_of(self, outfit: PlannedOutfit) -> tuple[Task, ...]:
        """The outfit's sequences: some known motions, some held-out ones, drawn by the outfit's name."""
        drawn: list[PlannedMotion] = []
        sampled = digest(self.seed, "known", outfit.name) % self.preset.known_sampled == 0
        new = self.preset.new_motions if outfit.held_out or sampled else 0
        for held_out, count in ((False, self.preset.known_motions), (True, new)):
            pool = [motion for motion in self.motions if motion.held_out == held_out]
            drawn += sorted(pool, key=lambda motion: digest(self.seed, outfit.name, motion.name))[:count]
        return tuple(Task(outfit, motion, digest(self.seed, outfit.name, motion.name) >> 33) for motion in drawn)

    @property
    def tasks(self) -> Iterator[Task]:
        for outfit in self.outfits:
            yield from self.tasks_of(outfit)

    def document(self) -> dict[str, Any]:
        """What tells one plan from another, as JSON values."""
        return {
            "garmentc": __version__,
            "preset": self.preset.name,
            "seed": self.seed,
            "outfits": len(self.outfits),
            "categories": list(self.preset.categories),
            "frames": self.preset.frames,
            "new_frames": self.preset.new_frames,
            "known_motions": self.preset.known_motions,
            "new_motions": self.preset.new_motions,
            "known_sampled": self.preset.known_sampled,
            "motions": [_motion_document(motion) for motion in self.motions],
        }


def _motion_document(motion: PlannedMotion) -> dict[str, Any]:
    document: dict[str, Any] = {"name": motion.name, "frames": motion.frames, "held_out": motion.held_out}
    if motion.clip is None:
        source = {} if motion.poses == "ranges" else {"poses": motion.poses}  # younger than the first datasets
        return {**document, "seed": motion.seed, **source}
    arrays = (np.ascontiguousarray(array, np.float64) for array in (motion.clip.poses, motion.clip.trans))
    return {**document, "sha256": hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()}


def make_plan(
    preset: Preset,
    seed: int = 0,
    outfits: int | None = None,
    motion_files: Sequence[Path] = (),
    categories: Sequence[str] = (),
) -> Plan:
    """The plan for `outfits` outfits (None: as many as the preset says). The same arguments give the same plan.

    motion_files  motions (AMASS .npz or .bvh) in place of the preset's walks through sampled poses
    categories    restrict the outfits to these

    A plan for more outfits starts with the plan for fewer, so that a dataset can grow.
    Raises GarmentcError where a category is unknown or a motion file cannot be read.
    """
    for category in categories:
        if category not in CATEGORIES:
            raise GarmentcError(f"unknown category '{category}'; the categories are {', '.join(CATEGORIES)}")
        if preset.tshirt:
            raise GarmentcError(f"the preset '{preset.name}' has one T-shirt only; leave the category out")
    if categories:
        preset = replace(preset, categories=tuple(dict.fromkeys(categories)))
    motions = _clips(motion_files, preset, seed) if motion_files else _walks(preset, seed)
    count = preset.outfits if outfits is None else outfits
    return Plan(preset, seed, tuple(_outfit(preset, seed, index) for index in range(count)), motions)


def _outfit(preset: Preset, seed: int, index: int) -> PlannedOutfit:
    held_out = preset.hold_out and is_block_held_out(index, seed)
    if preset.tshirt:
        style = tshirt_style(seed, index)
        return PlannedOutfit(f"tshirt{index:04d}", tshirt_parameters(seed, style), FABRICS[0], held_out, style)
    category = preset.categories[index % len(preset.categories)]
    attempt = 0
    while (drawn := sample_parameters(digest(seed, "outfit", index, attempt) >> 33)).category != category:
        attempt += 1
    if preset.vertex_limit is not None:
        drawn = replace(drawn, vertex_count=min(drawn.vertex_count, preset.vertex_limit))
    fabric = FABRICS[digest(seed, "fabric", index) % len(FABRICS)]
    return PlannedOutfit(f"outfit{index:04d}", drawn, fabric, held_out)


def _walks(preset: Preset, seed: int) -> tuple[PlannedMotion, ...]:
    names = [f"walk{index:03d}" for index in range(preset.walks)]
    new = lowest(names, preset.held_out_motions, seed)
    motions = []
    for name in names:
        frames = preset.new_frames if name in new else preset.frames
        motions.append(PlannedMotion(name, name, frames, digest(seed, name) >> 33, None, name in new, preset.poses))
    return tuple(motions)


def _clips(files: Sequence[Path], preset: Preset, seed: int) -> tuple[PlannedMotion, ...]:
    """Every file cut into stretches of the preset's length; a last stretch of less than half of it is left out."""
    from garmentc.smpl.read_motion import read_motion

    clips: dict[str, Motion] = {}
    for file in files:
        name = _plain(file.stem)
        if name in clips:
            raise GarmentcError(f"two motion files are called '{name}'; rename one", file)
        clips[name] = read_motion(file).resampled(preset.fps)
    new = lowest(list(clips), min(preset.held_out_motions, len(clips) // 4), seed)
    stretches = []
    for name, clip in clips.items():
        length = preset.new_frames if name in new else preset.frames
        starts = range(0, max(len(clip) - length // 2, 1), length)
        for number, start in enumerate(starts):
            part = replace(clip.clipped(start, start + length), betas=None, gender=None, source="", warnings=())
            label = name if len(starts) == 1 else f"{name}_{number:03d}"
            stretches.append(PlannedMotion(label, name, len(part), digest(seed, label) >> 33, part, name in new))
    return tuple(stretches)


def _plain(name: str) -> str:
    """A name that every file system takes."""
    return "".join(letter if letter.isascii() and (letter.isalnum() or letter in "_-") else "_" for letter in name)[:60]


def outfit_document(outfit: PlannedOutfit) -> dict[str, Any]:
    """How the outfit is made, as JSON values."""
    document = asdict(outfit.parameters)
    if outfit.tshirt is not None:
        document["tshirt"] = asdict(outfit.tshirt)
    plain: dict[str, Any] = json.loads(json.dumps(document))  # lists in place of tuples
    return plain
