"""Datasets with a name: how many outfits, which kinds, how much motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

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

    outfits           how many; every fifth is held out, unless `hold_out` says none
    walks             built-in motions: walks through sampled poses
    held_out_motions  of those
    known_motions     motions of each outfit that training may see
    new_motions       motions of each held-out outfit from the held-out ones,
    known_sampled     and of one in so many of the others
    frames            length of a motion; the way in from rest, which is not kept, costs as much as some eighty frames
    new_frames        length of a held-out one
    fps               frames a second
    categories        taken in turn; one may come several times
    vertex_limit      most vertices of an outfit, None as drawn
    tshirt            one T-shirt topology, fitted to bodies and styles, instead of outfits
    poses             where the poses of walks come from, a name of `pose_walk.POSE_SOURCES`
    hold_out          whether outfits are held out at all
    """

    name: str
    outfits: int
    walks: int
    held_out_motions: int
    known_motions: int
    new_motions: int
    known_sampled: int
    frames: int
    new_frames: int
    fps: float = 30.0
    categories: tuple[str, ...] = _CLOTHES
    vertex_limit: int | None = None
    tshirt: bool = False
    poses: str = "ranges"
    hold_out: bool = True


BENCHMARK = Preset(
    "benchmark-v1",
    outfits=135,  # some fail
    walks=150,
    held_out_motions=3,
    known_motions=1,
    new_motions=2,
    known_sampled=18,
    frames=205,
    new_frames=64,
)

WARDROBE = Preset(  # many outfits in short motions: what a network needs to know of outfits, not of poses
    "wardrobe-v1",
    outfits=150,
    walks=150,
    held_out_motions=0,
    known_motions=1,
    new_motions=0,
    known_sampled=18,
    frames=96,
    new_frames=96,
    hold_out=False,
)

WARDROBE_2 = replace(  # still shorter, and more of what hangs free, where most of the error is
    WARDROBE,
    name="wardrobe-v2",
    outfits=190,
    frames=60,
    new_frames=60,
    categories=(*_CLOTHES, "dress", "top", "skirt", "jumpsuit"),
)

TSHIRT = Preset(
    "tshirt",
    outfits=45,
    walks=24,
    held_out_motions=3,
    known_motions=1,
    new_motions=1,
    known_sampled=3,
    frames=120,
    new_frames=64,
    tshirt=True,
)

SMALL = Preset(
    "small",
    outfits=5,
    walks=4,
    held_out_motions=1,
    known_motions=1,
    new_motions=1,
    known_sampled=1,
    frames=12,
    new_frames=12,
    vertex_limit=900,
)

PRESETS = {preset.name: preset for preset in (BENCHMARK, WARDROBE, WARDROBE_2, TSHIRT, SMALL)}
