"""Four fabrics, each as the handful of numbers that a cloth simulation asks for.

Sources, and what was done to their numbers:

- [W] Wang, O'Brien and Ramamoorthi 2011, "Data-driven elastic models for cloth", and the measured materials that
  ARCSim ships with it: density, first stretching coefficient (doubled: the energy there has no factor 1/2) and bending
  stiffness along the warp at small curvature. Nonlinear and anisotropic there; one isotropic number each here.
- [D] "Regenerated Cellulose-Based Denim Fabric for Tropical Regions", Journal of Textiles 2016, 4614168, table 5:
  Kawabata shear stiffness of six denims, 1.5 to 3.4 gf/cm/degree (1 gf/cm/degree = 56.2 N/m per radian), thickness
  0.8 to 1.2 mm.
- [M] Matsudaira, "Characteristics of mechanical properties and handles of silk filament weaves": the shear stiffness of
  silk is extremely small at small strain. Momme is a unit: 4.34 g/m2.
- [L] Memon et al. 2021, Materials 14, 4553: sheep garment leather, thickness 0.64 to 0.96 mm. Lange, Niven and Laing
  2001, JSLTC 85: garment leather is heavier and stiffer than woven cloth for tailored garments.
- [T] Temel, Johnson and Lloyd 2022, Tribology Letters 70: cotton on skin, dynamic friction 0.25 (forearm) to
  0.79 (chest).

All numbers are rounded. Those marked "estimate" below have no table behind them, only the order that the sources give.
"""

from __future__ import annotations

from dataclasses import dataclass

from garmentc.errors import GarmentcError


@dataclass(frozen=True)
class Fabric:
    """A fabric for thin-shell simulation, alike in all directions.

    stretch    N/m: membrane stiffness, tension per unit of strain
    shear      N/m: tension per radian of shear
    bending    N m: moment per unit of width and curvature
    density    kg/m2
    friction   Coulomb coefficient against the body
    thickness  metres
    """

    name: str
    stretch: float
    shear: float
    bending: float
    density: float
    friction: float
    thickness: float


FABRICS = {
    fabric.name: fabric
    for fabric in (
        # T-shirt jersey. Density and bending: gray interlock of [W]. Stretch: geometric mean of the cotton-rich cloths
        # of [W], gray interlock, ivory rib knit and pink ribbon brown (69, 130 and 490). Friction: [T], between forearm
        # and chest. Shear, thickness: estimate.
        Fabric("cotton", stretch=160, shear=40, bending=23e-6, density=0.187, friction=0.4, thickness=0.7e-3),
        # 16 momme satin, 69 g/m2. Stretch: tango red jet set of [W], a light filament weave, for want of silk there.
        # Shear: 0.3 gf/cm/degree after [M]. Bending, friction, thickness: estimate.
        Fabric("silk", stretch=340, shear=17, bending=5e-6, density=0.07, friction=0.2, thickness=0.2e-3),
        # 11 oz black denim of [W]. Shear and thickness: [D]. Friction: estimate.
        Fabric("denim", stretch=2000, shear=120, bending=64e-6, density=0.324, friction=0.5, thickness=0.9e-3),
        # Sheep garment leather. Thickness: [L], at 0.65 g/cm3. Shear: isotropic, Poisson's ratio 0.3. Others: estimate
        # after [L].
        Fabric("leather", stretch=2000, shear=770, bending=200e-6, density=0.52, friction=0.6, thickness=0.8e-3),
    )
}
"""The fabrics by name."""


def find_fabric(name: str) -> Fabric:
    """The fabric called `name`. Raises GarmentcError where there is none."""
    if name not in FABRICS:
        raise GarmentcError(f"unknown fabric '{name}'; use one of {', '.join(FABRICS)}")
    return FABRICS[name]
