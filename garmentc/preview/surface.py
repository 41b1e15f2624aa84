"""What the renderer draws: posed triangles with a material."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.preview.material import Material


@dataclass(frozen=True)
class Surface:
    """A posed mesh of one material, drawn from both sides.

    positions  (V, 3) metres
    normals    (V, 3) unit
    triangles  (F, 3)
    texcoords  (V, 2) or None
    colors     (V, 3) linear light, in place of the material's base colour; or None
    behind     metres that it is drawn further away than it is
    """

    positions: NDArray[np.float64]
    normals: NDArray[np.float64]
    triangles: NDArray[Any]
    material: Material
    texcoords: NDArray[Any] | None = None
    colors: NDArray[Any] | None = None
    behind: float = 0.0


@dataclass(frozen=True)
class Scene:
    """Surfaces, and where the floor is; metres, None draws none."""

    surfaces: tuple[Surface, ...]
    floor: float | None = None

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """The first vertex of each surface in `positions`, and the end."""
        return np.cumsum([0, *(len(surface.positions) for surface in self.surfaces)])

    @cached_property
    def positions(self) -> NDArray[np.float64]:
        return _stacked([surface.positions for surface in self.surfaces])

    @cached_property
    def normals(self) -> NDArray[np.float64]:
        return _stacked([surface.normals for surface in self.surfaces])

    @cached_property
    def triangles(self) -> NDArray[np.int64]:
        """(F, 3) of all surfaces, counting in `positions`."""
        parts = [
            surface.triangles.astype(np.int64) + start
            for surface, start in zip(self.surfaces, self.starts[:-1], strict=True)
        ]
        return np.concatenate([np.zeros((0, 3), np.int64), *parts])

    @cached_property
    def owner(self) -> NDArray[np.int64]:
        """(F,) which surface each triangle belongs to."""
        return np.repeat(np.arange(len(self.surfaces)), [len(surface.triangles) for surface in self.surfaces])

    @cached_property
    def casters(self) -> NDArray[np.int64]:
        """Those of `triangles` that cast shadows: not those with holes, for depth maps know no textures."""
        solid = np.array([not surface.material.is_cut_out for surface in self.surfaces], dtype=bool)
        casters: NDArray[np.int64] = self.triangles[solid[self.owner]]
        return casters

    @cached_property
    def behind(self) -> NDArray[np.float64]:
        """(V,) metres that each vertex is drawn further away than it is."""
        return np.repeat([surface.behind for surface in self.surfaces], np.diff(self.starts))


def _stacked(parts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    return np.concatenate([np.zeros((0, 3)), *parts])
