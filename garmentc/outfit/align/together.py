"""One body for several outfits: they are worn together."""

from __future__ import annotations

from collections.abc import Sequence

from garmentc.errors import Diagnostic, GarmentcError
from garmentc.outfit.align.alignment import Alignment
from garmentc.outfit.align.choose import UNCERTAIN


def common_gender(alignments: Sequence[Alignment]) -> tuple[str, tuple[Diagnostic, ...]]:
    """The gender of the body that fits all outfits, which were aligned one by one; and a warning where one yields.

    A hat fits every body, so an outfit takes any that it sits on nearly as well as on its best.
    Raises GarmentcError where no body fits all of them.
    """
    found = {alignment.gender for alignment in alignments}
    if len(found) == 1:
        return found.pop(), ()
    shared = [
        gender
        for gender in alignments[0].misfits
        if all(alignment.misfits[gender] < UNCERTAIN * min(alignment.misfits.values()) for alignment in alignments)
    ]
    if not shared:
        fits = ", ".join(f"{alignment.outfit.path.name} the {alignment.gender} one" for alignment in alignments)
        raise GarmentcError(f"the outfits fit different bodies ({fits}); choose one body for all with --gender")
    chosen = min(shared, key=lambda gender: sum(alignment.misfits[gender] for alignment in alignments))
    yielding = ", ".join(alignment.outfit.path.name for alignment in alignments if alignment.gender != chosen)
    message = f"{yielding} would fit another body slightly better; fitted to the {chosen} body, as what it is worn with"
    return chosen, (Diagnostic("gender-shared", message),)
