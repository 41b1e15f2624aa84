"""Names of nodes: engines look nodes up by name, so no two may have the same."""

from __future__ import annotations

from collections.abc import Sequence

from garmentc.smpl.skeleton import JOINT_NAMES


def unique_names(wanted: Sequence[str], taken: Sequence[str] = JOINT_NAMES) -> tuple[str, ...]:
    """The names that are wanted, with a number where one is taken by a joint or came before."""
    used = set(taken)
    names = []
    for name in wanted:
        unique, number = name, 2
        while unique in used:
            unique, number = f"{name}_{number}", number + 1
        used.add(unique)
        names.append(unique)
    return tuple(names)
