"""Compiled files against their baselines, along motions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.evaluation.baselines import nearest_skinning
from garmentc.evaluation.evaluate import BodyFrames, EvaluationOptions, body_frames, evaluate
from garmentc.evaluation.posed_outfit import GlbOutfit, PosedOutfit, RigOutfit, read_outfit
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

    body, gender  of the body inside; by default what the compiler wrote into each file
    progress      called with each file's name as its turn comes
    Raises GarmentcError where a file cannot be read, or does not say for which body it was made.
    """
    options = options or EvaluationOptions()
    if not motions:
        raise GarmentcError("no motion is given; add one with --motion")
    stages: dict[object, list[BodyFrames]] = {}
    rows = []
    for path in outfits:
        progress(path.name)
        outfit = read_outfit(path)
        inside, betas = worn_by(outfit, path, body, gender)
        key = (inside.name, inside.gender, None if betas is None else tuple(betas))
        if key not in stages:
            joints = inside.joints(betas)
            stages[key] = [body_frames(inside, betas, read_motion(m, joints=joints), options) for m in motions]
        candidates: list[tuple[str, PosedOutfit]] = []
        if "nearest" in baselines:
            candidates.append(("nearest", RigOutfit(nearest_skinning(outfit.rest, outfit.triangles, inside, betas))))
        candidates.append((COMPILED, outfit))
        for method, candidate in candidates:
            rows.append(table_row(path.stem, method, [evaluate(candidate, inside, frames) for frames in stages[key]]))
    return rows


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
