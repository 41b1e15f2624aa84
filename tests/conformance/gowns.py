"""Small synthetic files, one for every way to store a rig: the gown of gltf_samples with a second of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path

from gltf_samples import make_asset

from garmentc.gltf.asset import Asset
from garmentc.gltf.write import write_glb


@dataclass(frozen=True)
class Gown:
    """How a gown is stored. All keyframes are kept, so that what is left between a file and its rig is rounding."""

    influences: int
    morphs: int
    sparse: bool
    quantize: bool
    meshopt: bool = False
    parts: int = 2
    normals: bool = True
    columns: int = 24
    rows: int = 20

    def __str__(self) -> str:
        words = ["sparse" if self.sparse else "dense", "quantized" if self.quantize else "float"]
        words += ["meshopt"] if self.meshopt else []
        words += [f"{self.parts}parts"] if self.parts != 2 else []
        words += [] if self.normals else ["nonormals"]
        words += [f"{self.columns}x{self.rows}"] if (self.columns, self.rows) != (24, 20) else []
        return f"{self.influences}-{self.morphs}-" + "-".join(words)

    def asset(self) -> Asset:
        """What is written; its rig is in float."""
        return _asset(self)


@cache
def _asset(gown: Gown) -> Asset:
    options = {"sparse": gown.sparse, "quantize": gown.quantize, "meshopt": gown.meshopt, "key_tolerance": 0}
    return make_asset(
        gown.morphs, gown.influences, gown.parts, gown.normals, columns=gown.columns, rows=gown.rows, **options
    )


QUICK = [
    *(Gown(*values) for values in product((4, 8), (8, 32, 128), (False, True), (False, True))),
    *(Gown(influences, 32, True, quantize, meshopt=True) for influences, quantize in product((4, 8), (False, True))),
    Gown(4, 8, True, False, parts=1),
    Gown(4, 8, True, True, parts=4),
    Gown(4, 8, True, False, normals=False),
    Gown(4, 0, True, False),
]
"""What `make test` looks at."""

ALL = [
    *(Gown(*values) for values in product((4, 8), (8, 32, 64, 128), (False, True), (False, True), (False, True))),
    *(
        Gown(4, 32, True, quantize, meshopt, **other)
        for other in ({"parts": 1}, {"parts": 4}, {"normals": False})
        for quantize, meshopt in product((False, True), (False, True))
    ),
    Gown(4, 0, True, False),
    Gown(4, 0, True, True),
]
"""What `make conformance` looks at."""


def write_gowns(gowns: Sequence[Gown], folder: Path) -> list[Path]:
    """Write a .glb for each into `folder`."""
    paths = [folder / f"{gown}.glb" for gown in gowns]
    for gown, path in zip(gowns, paths, strict=True):
        write_glb(gown.asset(), path)
    return paths
