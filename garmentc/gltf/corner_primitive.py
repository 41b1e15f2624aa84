"""Stand-in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class CornerPrimitive:
    material: int
    vertices: NDArray[np.int32]
    triangles: NDArray[np.uint32]
    texcoords: NDArray[np.float32] | None = None
    normals: NDArray[Any] | None = None
    colors: NDArray[Any] | None = None
