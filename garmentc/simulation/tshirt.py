"""One T-shirt with one topology on many bodies in many styles: what systems of fixed topology learn from.

As in TailorNet (Patel et al. 2020, section 4): nine body shapes, of which only the first two coefficients vary, times
styles. A style lengthens the sleeves and the trunk and gives ease; the mesh stays the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from garmentc.simulation.body_field import Array, RestBody
from garmentc.simulation.layers import push_from_body
from garmentc.simulation.outfit_parameters import GarmentParameters, OutfitParameters
from garmentc.simulation.outfits import GeneratedOutfit, generate_outfit
from garmentc.simulation.splits import digest
from garmentc.simulation.surface import vertex_normals
from garmentc.smpl.default_body import load_default_body
from garmentc.smpl.skeleton import JOINT_NAMES

BODIES = 9
VERTEX_COUNT = 3000
_SHAPE = 1.5
"""Standard deviations of the first two shape coefficients: less, mean, more."""

_STYLES = ((-0.3, 0.8), (-0.15, 0.3), (0.0, 0.02))
"""Limits of sleeve, length and ease."""

_NEIGHBOURS = 24
_ARMS = [k for k, name in enumerate(JOINT_NAMES) if "shoulder" in name or "elbow" in name]


@dataclass(frozen=True)
class TshirtStyle:
    """Which T-shirt on which body.

    betas   shape of the body
    sleeve  relative change of the sleeves' length
    length  relative change of the trunk's length below the armpits
    ease    room around the body beyond the basic shirt's, metres
    """

    betas: tuple[float, float]
    sleeve: float = 0.0
    length: float = 0.0
    ease: float = 0.0


def tshirt_style(seed: int, index: int) -> TshirtStyle:
    """Style number `index`: the nine bodies in turn; the first round is the basic shirt, the others are random."""
    body, style = index % BODIES, index // BODIES
    betas = (_SHAPE * (body % 3 - 1), _SHAPE * (body // 3 - 1))
    if style == 0:
        return TshirtStyle(betas)
    rng = np.random.default_rng([digest(seed, "tshirt", style) >> 33])  # one style on nine bodies
    drawn = rng.uniform(*np.transpose(_STYLES))
    return TshirtStyle(betas, *(round(float(value), 4) for value in drawn))


def tshirt_parameters(seed: int, style: TshirtStyle) -> OutfitParameters:
    """The shirt as an outfit; its garment is the basic one."""
    shirt = GarmentParameters("top", clearance=0.006, ease=0.006, hang=-0.2, sleeve=0.28, strap=0.95, length=0.55)
    return OutfitParameters(seed, "top", "female", (*style.betas, *[0.0] * 8), VERTEX_COUNT, (shirt,))


@lru_cache(maxsize=1)
def _basic_shirt() -> GeneratedOutfit:
    parameters = tshirt_parameters(0, TshirtStyle((0.0, 0.0)))
    return generate_outfit(parameters, load_default_body(parameters.gender))


def fit_tshirt(style: TshirtStyle, parameters: OutfitParameters) -> GeneratedOutfit:
    """The T-shirt in `style`: always the same triangles, at least 1.5 mm outside the default body with its betas.

    Raises ValueError where the style does not fit the body.
    """
    from scipy.spatial import cKDTree

    basic, body = _basic_shirt(), load_default_body(parameters.gender)
    mean = body.shaped()
    distance, nearest = cKDTree(mean).query(basic.vertices, _NEIGHBOURS)
    share = 1 / (distance + 0.01)
    share /= share.sum(axis=1, keepdims=True)
    betas = np.asarray(parameters.betas)
    moved = ((body.shaped(betas) - mean)[nearest] * share[..., None]).sum(axis=1)
    arm = (body.weights[:, _ARMS].sum(axis=1)[nearest] * share).sum(axis=1)
    vertices = _styled(basic, style, arm, body.joints()) + moved
    vertices = push_from_body(vertices, basic.triangles, RestBody.of(body, betas))
    return GeneratedOutfit(vertices, basic.triangles, basic.triangle_part, basic.part_names, parameters)


def _styled(basic: GeneratedOutfit, style: TshirtStyle, arm: Array, joints: Array) -> Array:
    vertices = basic.vertices.copy()
    shoulder = np.abs(joints[JOINT_NAMES.index("left_shoulder"), 0])
    chest = joints[JOINT_NAMES.index("spine3"), 1]
    side, beyond = np.sign(vertices[:, 0]), np.maximum(np.abs(vertices[:, 0]) - shoulder, 0)
    vertices[:, 0] += style.sleeve * arm * side * beyond
    below = np.minimum(vertices[:, 1] - chest, 0)
    vertices[:, 1] += style.length * (1 - arm) * below
    collar = np.clip((vertices[:, 1].max() - basic.vertices[:, 1]) / 0.15, 0, 1)  # the neckline stays as it is
    styled: Array = vertices + style.ease * collar[:, None] * vertex_normals(basic.vertices, basic.triangles)
    return styled
