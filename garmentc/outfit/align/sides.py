"""Which side of the cloth is out: exports may wind all faces the other way round.

It matters beyond the looks, as the networks are told the way that the surface faces.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from garmentc.outfit.align.fit import ClothSample
from garmentc.outfit.align.skin import Skin
from garmentc.outfit.outfit import Outfit
from garmentc.outfit.topology import triangle_normals

INSIDE_OUT = 0.7
"""Share of the cloth that faces the skin in an outfit that is inside out. Of real suits it is less than 0.02, of shoes
and hats, which have soles, tongues and brims, 0.25; linings make it half."""


def facing_skin(cloth: ClothSample, skin: Skin) -> float:
    """Share of the cloth whose triangles, as they are wound, face against the nearest skin."""
    outward = skin.normals[skin.nearest(cloth.points)]
    return float((np.einsum("si,si->s", cloth.normals, outward) < 0).mean())


def turned_round(outfit: Outfit) -> Outfit:
    """The outfit with all triangles wound the other way; normals that agreed with them still do so."""
    turned = replace(
        outfit, tri_v=outfit.tri_v[:, [0, 2, 1]], tri_vt=outfit.tri_vt[:, [0, 2, 1]], tri_vn=outfit.tri_vn[:, [0, 2, 1]]
    )
    authored = (turned.tri_vn >= 0).all(axis=1)
    faces = triangle_normals(turned.vertices, turned.tri_v[authored])
    agreement = np.einsum("fi,fki->", faces, turned.normals[turned.tri_vn[authored]])
    return turned if agreement >= 0 else replace(turned, normals=-turned.normals)
