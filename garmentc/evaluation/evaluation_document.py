"""An evaluation as the JSON that schemas/evaluation.schema.json describes: the same scores, the same bytes."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

from garmentc import __version__
from garmentc.evaluation.dataset_evaluation import DatasetEvaluation
from garmentc.evaluation.group_scores import by_category, by_garment, by_outfit, overall, ratios
from garmentc.evaluation.representative import Representative
from garmentc.schema import check_schema

_DECIMALS = 6


def evaluation_document(evaluation: DatasetEvaluation, samples: tuple[Representative, ...] = ()) -> dict[str, Any]:
    """Millimetres, and shares in [0, 1]. `samples` are those that the picture shows."""
    outfits = {outfit.outfit: outfit for outfit in evaluation.outfits}
    document = {
        "schema": 1,
        "garmentc": __version__,
        "dataset": {
            "name": evaluation.dataset,
            "sha256": evaluation.sha256,
            "complete": evaluation.complete,
            "split": evaluation.split,
            "frames_per_sequence": evaluation.frames,
        },
        "methods": [
            {
                "name": method.name,
                "bundle": None if method.bundle is None else method.bundle.name,
                "profile": method.profile,
                "baseline": method in evaluation.baseline,
            }
            for method in dict.fromkeys((*evaluation.methods, *evaluation.baseline))
        ],
        "overall": [asdict(row) for row in overall(evaluation)],
        "ratios": [asdict(row) for row in ratios(evaluation)],
        "categories": [asdict(row) for row in by_category(evaluation)],
        "garments": [asdict(row) for row in by_garment(evaluation)],
        "outfits": [
            {name: getattr(outfits[row.group], name) for name in ("category", "fabric", "gender")} | asdict(row)
            for row in by_outfit(evaluation)
        ],
        "samples": [asdict(sample) for sample in samples],
    }
    rounded: dict[str, Any] = _rounded(document)
    check_schema(rounded, "evaluation")
    return rounded


def evaluation_json(document: dict[str, Any]) -> str:
    """The text of `evaluation_document`."""
    return json.dumps(document, indent=1, allow_nan=False) + "\n"


def _rounded(value: Any) -> Any:
    """Far below anything measured: what differs between processors' last digits does not show."""
    if isinstance(value, float):
        return round(value, _DECIMALS)
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(item) for item in value]
    return value
