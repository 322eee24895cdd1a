"""Measured fabrics: stiffness per width and mass per area, for a sheet or a solid.

A sheet has the measured stiffness in stretching, shear and bending, see `MeasuredFabric.sheet`. A
cage of tetrahedra is a solid: its moduli are the sheet's stiffness divided by the thickness of the
cage, so it stretches, shears and weighs as the fabric does. Its frequencies in the plane do not
depend on that thickness, but its bending does, see `MeasuredFabric.plate`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elements.plates import Plate

#: Source of all `FABRICS`.
SOURCE = (
    "H. Wang, J. F. O'Brien, R. Ramamoorthi, Data-driven elastic models for cloth: modeling and "
    "measurement, ACM Transactions on Graphics 30 (4), 71 (2011), table of material parameters, "
    "as distributed with the program ARCSim (materials/*.json)"
)

#: Assumptions where the source gives no value.
ASSUMPTIONS = (
    "the constants are the first of six sets in the table, for zero strain; real cloth stiffens as "
    "it is stretched, a linear model does not",
    "force per width = constant times Green's strain, with the shear in tensor measure, as in the "
    "paper; ARCSim doubles all constants, which makes in-plane frequencies 1.41 times higher",
    "a negative C12 in the table (knits, up to 15 N/m) is set to 0, as in ARCSim; otherwise a "
    "pulled fabric would grow wider",
    "direction 1 of the table is the weft (for a knit: the courses), because denim stretches more "
    "along its weft, which contains the elastane",
    "across the thickness E3 = sqrt(E1 E2), G13 = G23 = G12, ν13 = ν23 = 0; none was measured",
    "the thickness was not measured: for tetrahedra, stiffness per width and mass per area are "
    "divided by modal.thickness",
    "for a sheet, bending along one direction has no effect along the other (D12 = 0), as in "
    "ARCSim; D66 follows from the bias, B45 = (D11 + D22 + 2 D12 + 4 D66)/4",
    "for a sheet, the thickness is constant and normals stay upright",
)


#: Smallest thickness over which a fabric's constants can be spread [m].
THINNEST = 1e-9
#: Largest thickness over which a fabric's constants can be spread [m].
THICKEST = 1e9


class SolidConstants(NamedTuple):
    """Constants of an orthotropic solid along the axes of a fabric."""

    #: Young's moduli E1 (warp), E2 (weft), E3 (normal) [Pa].
    youngs_moduli: tuple[float, float, float]
    #: Shear moduli G12, G13, G23 [Pa].
    shear_moduli: tuple[float, float, float]
    #: Poisson's ratios ν12, ν13, ν23.
    poissons_ratios: tuple[float, float, float]
    #: Density [kg/m³].
    density: float


class MeasuredFabric(NamedTuple):
    """Measured constants of a fabric."""

    #: Name of the sample in the source.
    sample: str
    #: Product that it is sold for, and its fibres.
    use: str
    #: Mass per area [kg/m²].
    areal_mass: float
    #: Membrane stiffness C11, C12, C22, C33 [N/m].
    stiffness: tuple[float, float, float, float]
    #: Bending stiffness along direction 1, the bias and direction 2 at small curvature [N m].
    bending: tuple[float, float, float]

    @property
    def plate_thickness(self) -> float:
        """Thickness [m] at which a homogeneous plate stretches and bends as the fabric does."""
        # A plate of stiffness A per width has the bending stiffness A h²/12. A and the bending
        # stiffness are geometric means of warp and weft.
        c11, _, c22, _ = self.stiffness
        along, _, across = self.bending
        return math.sqrt(12 * math.sqrt(along * across / (c11 * c22)))

    @property
    def sheet(self) -> Plate:
        """Stiffness of the fabric as a sheet, per width."""
        c11, c12, c22, c33 = self.stiffness
        c12 = max(c12, 0.0)
        along, bias, across = self.bending
        # Bending along the bias is (D11 + D22 + 2 D12 + 4 D66)/4, with D12 = 0. The shear is in
        # tensor measure: force per width = c33 γ / 2.
        twisting = bias - (along + across) / 4
        stretched = np.array([[c11, c12, 0.0], [c12, c22, 0.0], [0.0, 0.0, c33 / 2]])
        bent = np.diag([along, across, twisting])
        return Plate(stretched, bent)

    def solid(self, thickness: float) -> SolidConstants:
        """Compute the solid that represents the fabric at a given thickness."""
        if not THINNEST <= thickness <= THICKEST:
            raise InputError(
                f"the thickness must be between {THINNEST:g} m and {THICKEST:g} m",
                key="thickness",
                value=thickness,
            )
        c11, c12, c22, c33 = self.stiffness
        c12 = max(c12, 0.0)
        weft = (c11 - c12**2 / c22) / thickness
        warp = (c22 - c12**2 / c11) / thickness
        # The shear is in tensor measure: force per width = c33 γ / 2.
        shear = c33 / 2 / thickness
        return SolidConstants(
            (warp, weft, math.sqrt(warp * weft)),
            (shear, shear, shear),
            (c12 / c11, 0.0, 0.0),
            self.areal_mass / thickness,
        )


#: Name in the source and product of each fabric. The source has a tenth one (navy-sparkle-sweat, a
#: sweater), whose C22 at no strain, 3 N/m, is an eightieth of that at the next strain.
_SAMPLES = {
    "denim": ("11oz-black-denim", "jeans, 99 % cotton, 1 % elastane"),
    "trousers": ("royal-target", "trousers, 65 % cotton, 35 % polyester"),
    "tablecloth": ("white-dots-on-blk", "tablecloth, polyester"),
    "blanket": ("pink-ribbon-brown", "blanket, polyester"),
    "jacket": ("tango-red-jet-set", "jacket, polyester"),
    "t-shirt": ("gray-interlock", "T-shirt, interlock knit, 60 % cotton, 40 % polyester"),
    "rib-knit": ("ivory-rib-knit", "underwear, rib knit, 95 % cotton, 5 % elastane"),
    "ponte-knit": ("camel-ponte-roma", "jacket, double knit, 60 % polyester, 40 % rayon"),
    "swimsuit": ("white-swim-solid", "swimsuit, 87 % nylon, 13 % elastane"),
}
#: Mass [kg/m²]; C11, C12, C22, C33 [N/m]; bending along direction 1, the bias and 2 [µN m].
_MEASURED = """
denim      0.324 205.352005  10.234077 1013.88629  53.387184  64.196457  73.384567  96.951576
trousers   0.220 2016.55456   9.170511 2034.97644 104.759674 125.409805 107.997696 125.409805
tablecloth 0.128 2002.08618   0.345588 2027.48559  19.189022  51.713814  40.659470  31.282822
blanket    0.228 151.503906 106.028160 244.830673  30.250183 117.070122  87.509773  59.774277
jacket     0.113  43.067627  54.373299 171.424835  14.314700  14.293814  21.951700  20.345654
t-shirt    0.187  16.593832 -14.695990  34.477123  36.860302  23.191698  24.749964  14.267624
rib-knit   0.276  42.871021  -0.234556  65.166023  83.175644  46.237591  30.015930  32.243889
ponte-knit 0.284  31.146198 -12.802702  44.028667  31.896357  36.348366  33.013252  37.157593
swimsuit   0.204  47.971176   6.834521 104.615456  60.773663  60.237942  58.803211  51.018833
"""


def _parse_table() -> Iterator[tuple[str, MeasuredFabric]]:
    for name, *words in map(str.split, _MEASURED.strip().splitlines()):
        mass, c11, c12, c22, c33 = map(float, words[:5])
        along, bias, across = (float(f"{word}e-6") for word in words[5:])
        bending = along, bias, across
        yield name, MeasuredFabric(*_SAMPLES[name], mass, (c11, c12, c22, c33), bending)


#: Fabrics by name.
FABRICS = dict(_parse_table())
