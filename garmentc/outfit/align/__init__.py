"""Bring an artist's outfit into the body's canonical pose and axes: metres, Y up, +Z front, T-pose."""

from garmentc.outfit.align.alignment import Alignment, align
from garmentc.outfit.align.axes import Frame
from garmentc.outfit.align.fit import Fit
from garmentc.outfit.align.options import AlignOptions

__all__ = ["AlignOptions", "Alignment", "Fit", "Frame", "align"]
