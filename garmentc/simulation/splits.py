"""Which outfits and motions are held out: decided by hashes, so that nothing but the names and the seed counts.

A network must never be measured on what it learned from. Both outfits and motions are held out, which makes four kinds
of sequences; whatever is learned may come from "train" only.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence

SPLITS = ("train", "test", "test_outfits", "test_motions")
"""train: known outfit, known motion. test: both are new. test_outfits, test_motions: only that one is new."""

BLOCK = 5
"""One outfit in each block of so many is held out."""


def split_name(outfit_held_out: bool, motion_held_out: bool) -> str:
    """The split of a sequence."""
    if outfit_held_out:
        return "test" if motion_held_out else "test_outfits"
    return "test_motions" if motion_held_out else "train"


def digest(*parts: object) -> int:
    """A 64-bit number that depends on the parts alone, on every machine."""
    return int.from_bytes(hashlib.sha256("/".join(map(str, parts)).encode()).digest()[:8], "big")


def is_block_held_out(index: int, seed: int) -> bool:
    """Whether number `index` of a growing list is held out: exactly one of each BLOCK, and adding more changes none."""
    return digest(seed, "block", index // BLOCK) % BLOCK == index % BLOCK


def lowest(names: Sequence[str], count: int, seed: int) -> frozenset[str]:
    """`count` of a fixed set of names: those whose digests are the lowest."""
    return frozenset(sorted(set(names), key=lambda name: (digest(seed, "held out", name), name))[:count])


def split_pairs(pairs: Iterable[tuple[str, str]], seed: int) -> dict[tuple[str, str], str]:
    """The split of each (outfit, motion) of data that others planned: a fifth of either is held out."""
    known = sorted(set(pairs))
    outfits, motions = ({pair[k] for pair in known} for k in (0, 1))
    new = [lowest(sorted(names), len(names) // BLOCK, seed) for names in (outfits, motions)]
    return {(outfit, motion): split_name(outfit in new[0], motion in new[1]) for outfit, motion in known}


def leaks(entries: Iterable[tuple[str, str, str]]) -> list[str]:
    """What (outfit, motion, split) triples give away: outfits or motions of "train" that a test split calls new."""
    entries = list(entries)
    trained = [entry for entry in entries if entry[2] == "train"]
    found = []
    for what, column, splits in (("outfit", 0, ("test", "test_outfits")), ("motion", 1, ("test", "test_motions"))):
        seen = {entry[column] for entry in trained}
        both = sorted(seen & {entry[column] for entry in entries if entry[2] in splits})
        found += [f"the {what} '{name}' is both trained on and held out" for name in both]
    return found
