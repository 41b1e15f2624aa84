"""How positions are stored: as float32 metres, or as integers in a box that the inverse bind matrices undo."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.skin import JOINT_GRID
from garmentc.rig import Rig

FULL = 32767
"""Steps that 16 bits give to each side of a box's centre."""

COARSE_STEP, COARSE_MORPHS, FEWEST_MORPHS = 5e-5, 32, 8
"""Where bytes count more: a step of 0.05 mm for 32 blend shapes, so that most deltas take one byte instead of two.

The errors of M rounded shapes add up like the root of M: with fewer shapes a larger step makes the same error.
"""


@dataclass(frozen=True)
class PositionCodec:
    """stored = (position - center) / scale, for blend shapes stored = delta / scale.

    quantized   stored as int16 (KHR_mesh_quantization); otherwise center is 0 and scale 1
    normalized  the integers stand for fractions; otherwise for themselves, and small deltas may be int8 in equal steps
    levels      integers on each side of the center
    """

    quantized: bool
    center: NDArray[np.float64]
    scale: float
    normalized: bool = True
    levels: int = FULL

    @property
    def step(self) -> float:
        """Metres between neighbouring integers."""
        return self.scale / self.levels

    @property
    def matrix(self) -> NDArray[np.float64]:
        """(4, 4): stored positions to metres."""
        scale = self.scale if self.normalized else self.step
        matrix = np.diag([scale, scale, scale, 1.0])
        matrix[:3, 3] = self.center
        return matrix

    def positions(self, points: NDArray[Any]) -> NDArray[Any]:
        """(N, 3) metres as stored."""
        return self._encode(points - self.center) if self.quantized else points.astype(np.float32)

    def deltas(self, deltas: NDArray[Any]) -> NDArray[Any]:
        """(N, 3) metres as stored."""
        if not self.quantized:
            return deltas.astype(np.float32, copy=False)
        encoded = self._encode(deltas)
        small = not self.normalized and encoded.min() >= -128 and encoded.max() <= 127
        return encoded.astype(np.int8) if small else encoded

    def _encode(self, vectors: NDArray[Any]) -> NDArray[np.int16]:
        return np.round(vectors * (self.levels / self.scale)).astype(np.int16)


def position_codec(*rigs: Rig, quantize: bool, compress: bool = False) -> PositionCodec:
    """One box for all vertices and blend shapes of the rigs: their skin has one set of inverse bind matrices.

    compress  for a file that will be compressed: coarser, and in integers that stand for themselves
    """
    if not quantize:
        return PositionCodec(False, np.zeros(3), 1.0)
    low = np.min([rig.template.min(axis=0) for rig in rigs], axis=0).astype(np.float64)
    high = np.max([rig.template.max(axis=0) for rig in rigs], axis=0).astype(np.float64)
    center = np.round((low + high) / 2 / JOINT_GRID) * JOINT_GRID
    reach = max(float((high - center).max()), float((center - low).max()), max(map(largest_delta, rigs)))
    scale = np.nextafter(np.float32(max(reach, JOINT_GRID)), np.float32(np.inf))
    morphs = max(FEWEST_MORPHS, *(rig.morph_count for rig in rigs))
    coarse = math.ceil(scale / (COARSE_STEP * math.sqrt(COARSE_MORPHS / morphs)))
    levels = min(FULL, coarse) if compress else FULL
    return PositionCodec(True, center, float(scale), not compress, levels)


def largest_delta(rig: Rig) -> float:
    """The largest coordinate of any blend shape, metres."""
    return max((float(max(shape.max(), -shape.min())) for shape in rig.blend_shapes), default=0.0)
