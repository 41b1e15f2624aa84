"""What a pass says about itself."""

from __future__ import annotations

from dataclasses import dataclass

from garmentc.passes.posed_error import PosedError


@dataclass(frozen=True)
class PassReport:
    """One line of the compile report.

    name    of the pass
    detail  what it did, in words and numbers
    error   what that costs on the poses it did not see; None where it changes no posed vertex
    """

    name: str
    detail: str
    error: PosedError | None = None
