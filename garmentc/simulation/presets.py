"""Datasets with a name: how many outfits, which kinds, how much motion."""

from __future__ import annotations

from dataclasses import dataclass

FABRICS = ("cotton", "silk", "denim", "leather")

_CLOTHES = (
    "top",
    "trousers",
    "skirt",
    "dress",
    "jumpsuit",
    "open_top",
    "top_trousers",
    "top_skirt",
    "jacket_top_trousers",
    "jacket_dress",
)
"""What hangs and swings. Shoes, hats and bands need no simulation."""


@dataclass(frozen=True)
class Preset:
    """What a dataset is made of.

    outfits           how many; every fifth is held out
    categories        taken in turn
    walks             built-in motions: walks through sampled poses
    held_out_motions  of those
    known_motions     motions of each outfit that training may see
    new_motions       motions of each outfit from the held-out ones
    frames, fps       length and rate of each sequence
    vertex_limit      most vertices of an outfit, None as drawn
    tshirt            one T-shirt topology, fitted to bodies and styles, instead of outfits
    """

    name: str
    outfits: int
    walks: int
    held_out_motions: int
    known_motions: int
    new_motions: int
    frames: int
    fps: float = 30.0
    categories: tuple[str, ...] = _CLOTHES
    vertex_limit: int | None = None
    tshirt: bool = False


PRESETS = {
    preset.name: preset
    for preset in (
        Preset("benchmark-v1", 130, walks=60, held_out_motions=3, known_motions=3, new_motions=1, frames=64),
        Preset("tshirt", 45, walks=24, held_out_motions=3, known_motions=2, new_motions=1, frames=64, tshirt=True),
        Preset("small", 5, walks=4, held_out_motions=1, known_motions=1, new_motions=1, frames=12, vertex_limit=900),
    )
}
