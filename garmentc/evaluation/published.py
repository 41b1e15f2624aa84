"""What the paper prints: DeePSD (Bertiche et al. 2021), tables 1 to 4 and 6, on CLOTH3D.

CLOTH3D is closed, so these stand beside our figures for orientation: other outfits, other motions, other cloth.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PublishedRow:
    """error and edge in mm, collision as a share; None where the paper gives none."""

    method: str
    error_mm: float
    edge_mm: float | None = None
    bend: float | None = None
    collision: float | None = None


PUBLISHED = (
    PublishedRow("skinning only", 36.73, 1.16, 0.015, 0.154),
    PublishedRow("deformations in place of blend shapes", 29.98),
    PublishedRow("deformations with global descriptor", 28.04),
    PublishedRow("DeePSD without pose embedding", 30.93),
    PublishedRow("DeePSD", 25.13),
    PublishedRow("DeePSD with fabric and tightness, no physics", 24.66, 1.27, 0.031, 0.1159),
    PublishedRow("DeePSD with physics", 33.75, 1.13, 0.029, 0.0129),
    PublishedRow("DeePSD with physics and random poses", 34.45, 1.12, 0.029, 0.0102),
)

PUBLISHED_GARMENTS = {
    "top": "T-shirt 25.77, top 17.33",
    "trousers": "trousers 14.50",
    "jumpsuit": "jumpsuit 17.23",
    "skirt": "skirt 41.15",
    "dress": "dress 35.94",
}
"""Its error per garment, mm, by our kinds of garments."""
