"""An evaluation as Markdown tables, the paper's own figures beside it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from garmentc.evaluation.dataset_evaluation import DatasetEvaluation
from garmentc.evaluation.group_scores import Figure, GroupScores, by_category, by_garment, overall, ratios
from garmentc.evaluation.method import SIMULATION
from garmentc.evaluation.published import PUBLISHED, PUBLISHED_GARMENTS

_METRICS = (
    "error mm",
    "95 %",
    "edge mm",
    "bend",
    "collided %",
    "> 1 mm deep %",
    "collided %, clean",
    "> 1 mm deep %, clean",
)


def evaluation_markdown(evaluation: DatasetEvaluation) -> str:
    """Everything over all outfits, then by category, then by kind of garment."""
    return "\n\n".join(part for part in _parts(evaluation) if part) + "\n"


def _parts(evaluation: DatasetEvaluation) -> Iterator[str]:
    rows = overall(evaluation)
    unfinished = "" if evaluation.complete else ", unfinished"
    yield (
        f"Dataset {evaluation.dataset} ({evaluation.sha256[:12]}{unfinished}), split {evaluation.split}: "
        f"{rows[0].outfits} outfits, {rows[0].frames} frames, {rows[0].clean_frames} of them clean. "
        "Means per outfit, then over outfits; 95 % is the percentile over frames."
    )
    yield _table(("method", *_METRICS), [(row.method, *_cells(row)) for row in rows])
    yield "\n".join(
        f"- {ratio.method}: error {_number(ratio.error, 2)} ×, collisions on clean frames "
        f"{_number(ratio.clean_collision, 2)} × those of {ratio.baseline}"
        for ratio in ratios(evaluation)
    )
    yield "By category"
    yield _table(
        ("category", "method", "outfits", "frames", *_METRICS),
        [(row.group, row.method, str(row.outfits), str(row.frames), *_cells(row)) for row in by_category(evaluation)],
        text=2,
    )
    yield "By kind of garment, whatever is worn with it; in the last column the paper's error, mm"
    yield _table(
        ("garment", "method", "outfits", "frames", "error mm", "95 %", "paper"),
        [
            (
                row.garment,
                row.method,
                str(row.outfits),
                str(row.frames),
                _number(row.error_mm.mean, 2),
                _number(row.error_mm.p95, 2),
                PUBLISHED_GARMENTS.get(row.garment, "–"),
            )
            for row in by_garment(evaluation)
            if row.method != SIMULATION
        ],
        text=2,
    )
    yield (
        "The paper's figures, on CLOTH3D. That dataset is closed: outfits, motions and cloth are others, "
        "so orders and ratios compare, not millimetres."
    )
    yield _table(
        ("method", "error mm", "edge mm", "bend", "collided %"),
        [
            (
                row.method,
                _number(row.error_mm, 2),
                _number(row.edge_mm, 2),
                _number(row.bend, 3),
                _number(row.collision, 2, 100),
            )
            for row in PUBLISHED
        ],
    )


def _cells(row: GroupScores) -> tuple[str, ...]:
    shares = (row.collision, row.deep, row.clean_collision, row.clean_deep)
    return (
        _number(row.error_mm.mean, 2),
        _number(row.error_mm.p95, 2),
        _number(row.edge_mm.mean, 2),
        _number(row.bend.mean, 3),
        *(_share(share) for share in shares),
    )


def _share(figure: Figure) -> str:
    return _number(figure.mean, 2, 100)


def _number(value: float | None, digits: int, scale: float = 1) -> str:
    return "–" if value is None else f"{scale * value:.{digits}f}"


def _table(header: Sequence[str], rows: Sequence[Sequence[str]], text: int = 1) -> str:
    """`text` columns at the left hold words."""
    lines = [header, ["---"] * text + ["---:"] * (len(header) - text), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
