"""Fibres and matrices of composites, with their sources.

The tables were read at

- M: "Properties of Selected Fibres" and "Properties of Selected Matrices", tables of the course
  MY4150 at Michigan Technological University;
- H: M. W. Hyer (1998), as quoted in "Strengthening Design of Reinforced Concrete with
  FRP", table 3.2;
- G: R. F. Gibson (1994), as quoted there, table 3.1;
- B: K. G. Budinski and M. K. Budinski, "Engineering Materials" (1999), as quoted in the glossary of
  the course MAE 324 at Princeton University: epoxies have circa 1.3 Mg/m³;
- C: W. D. Callister, "Materials Science and Engineering", 7th edition, appendix B.

None of them gives Poisson's ratio ν23 across a fibre: that of anisotropic fibres is an assumption.
"""

from __future__ import annotations

from typing import NamedTuple

from spacemap_vtk.unit_cell.mixtures import Constituent


class Material(NamedTuple):
    """An entry of the library."""

    title: str
    constituent: Constituent
    source: str


FIBRES = {
    "e_glass": Material(
        "E-glass",
        Constituent.isotropic(72.4e9, 0.22, 5.0e-6, 2540.0),
        "modulus, density and expansion from H, Poisson's ratio from M",
    ),
    "carbon_t300": Material(
        "carbon T300",
        Constituent(231e9, 14e9, 14e9, 0.2, 0.25, -0.6e-6, 10e-6, 1770.0),
        "E1 and density from G, expansion from C (standard modulus), the rest from M (graphite "
        "AS); ν23 assumed",
    ),
    "carbon_as4": Material(
        "carbon AS-4",
        Constituent(228e9, 14e9, 14e9, 0.2, 0.25, -0.6e-6, 10e-6, 1800.0),
        "E1 and density from G, expansion from C (standard modulus), the rest from M (graphite "
        "AS); ν23 assumed",
    ),
    "carbon_hms": Material(
        "carbon HMS",
        Constituent(385e9, 6.3e9, 7.7e9, 0.2, 0.25, -1e-6, 10e-6, 1940.0),
        "M; ν23 assumed",
    ),
    "aramid": Material(
        "aramid (Kevlar 49)",
        Constituent(131e9, 4.2e9, 2.9e9, 0.35, 0.35, -2e-6, 60e-6, 1470.0),
        "E1 and density from G, expansion from C, the rest from M; ν23 assumed",
    ),
}

MATRICES = {
    "epoxy": Material(
        "epoxy",
        Constituent.isotropic(3.5e9, 0.33, 57.5e-6, 1300.0),
        "M, but the density from B, which is that of the resin HexPly 8552, too (M: 1540 kg/m³, "
        "high for an epoxy without filler)",
    ),
    "polyester": Material(
        "polyester",
        Constituent.isotropic(2.5e9, 0.33, 0.0, 1380.0),
        "M, which gives no expansion",
    ),
    "peek": Material("PEEK", Constituent.isotropic(3.6e9, 0.37, 47e-6, 1300.0), "M"),
}
