"""Compiled files against their baselines, along motions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.evaluation.baselines import nearest_skinning
from garmentc.evaluation.evaluate import BodyFrames, EvaluationOptions, body_frames, evaluate, posed_frames
from garmentc.evaluation.posed_outfit import GlbOutfit, RigOutfit, read_outfit
from garmentc.evaluation.table import Row, table_row
from garmentc.smpl.body import BodyModel
from garmentc.smpl.load import load_body
from garmentc.smpl.read_motion import read_motion

Baseline = Literal["nearest"]

COMPILED = "compiled"


def benchmark(
    outfits: Sequence[Path],
    motions: Sequence[Path],
    baselines: Sequence[Baseline] = ("nearest",),
    options: EvaluationOptions | None = None,
    body: Path | None = None,
    gender: str | None = None,
    progress: Callable[[str], None] = lambda outfit: None,
) -> list[Row]:
    """Evaluate compiled .glb files, and for each the baselines made from its own rest pose.

    motions       files; where there are none, each outfit is measured along its own animations
    body, gender  of the body inside; by default what the compiler wrote into each file
    progress      called with each file's name as its turn comes
    Raises GarmentcError where a file cannot be read, or does not say for which body it was made.
    """
    options = options or EvaluationOptions()
    stages: dict[object, list[BodyFrames]] = {}
    rows = []
    for path in outfits:
        progress(path.name)
        outfit = read_outfit(path)
        inside, betas = worn_by(outfit, path, body, gender)
        moved: list[Sequence[NDArray[Any]] | None] = [None] * len(motions)
        if motions:
            key = (inside.name, inside.gender, None if betas is None else tuple(betas))
            if key not in stages:
                joints = inside.joints(betas)
                stages[key] = [body_frames(inside, betas, read_motion(m, joints=joints), options) for m in motions]
            stage = stages[key]
        else:
            stage, moved = animation_frames(outfit, path, inside, betas, options)
        if "nearest" in baselines:
            nearest = RigOutfit(nearest_skinning(outfit.rest, outfit.triangles, inside, betas))
            rows.append(table_row(path.stem, "nearest", [evaluate(nearest, inside, frames) for frames in stage]))
        scores = [evaluate(outfit, inside, *each) for each in zip(stage, moved, strict=True)]
        rows.append(table_row(path.stem, COMPILED, scores))
    return rows


def animation_frames(
    outfit: GlbOutfit, path: Path, body: BodyModel, betas: NDArray[Any] | None, options: EvaluationOptions
) -> tuple[list[BodyFrames], list[Sequence[NDArray[Any]] | None]]:
    """The body in every `step`-th frame of the file's animations, and the outfit's vertices (N, 3) there.

    Raises GarmentcError where there are no animations, or where arms should be opened: then cloth would not fit.
    """
    if not outfit.asset.animations:
        raise GarmentcError("has no animation; give --motion, or compile it with one", path)
    if options.arms_opened:
        raise GarmentcError("arms are opened along motions alone, not in a file's own animations; give --motion")
    frames: list[BodyFrames] = []
    moved: list[Sequence[NDArray[Any]] | None] = []
    for number, animation in enumerate(outfit.asset.animations):
        fps = outfit.asset.frame_rate(number)
        times = np.arange(0, round(animation.duration * fps) + 1, options.step) / fps
        poses, vertices = zip(*(outfit.animated(number, time) for time in times), strict=True)
        frames.append(posed_frames(animation.name, body, betas, np.array(poses), options))
        moved.append(vertices)
    return frames, moved


def worn_by(
    outfit: GlbOutfit, path: Path, body: Path | None, gender: str | None
) -> tuple[BodyModel, NDArray[Any] | None]:
    """The body that a compiled file was made for, and its betas, as `asset.extras` say."""
    extras = outfit.asset.extras if isinstance(outfit.asset.extras, dict) else {}
    written, name, shape = (str(extras.get(key, "")) for key in ("gender", "body", "betas"))
    if not (gender or written):
        raise GarmentcError("does not say for which body it was made; give --gender", path)
    if body is None and name and not name.startswith("default"):
        raise GarmentcError(f"was made for the body '{name}'; give its model file with --body", path)
    try:
        betas = [float(word) for word in shape.split(",") if word]
    except ValueError as error:
        raise GarmentcError("has betas in its extras that are not numbers; compile it again", path) from error
    return load_body(body, gender or written), np.array(betas) if betas else None
