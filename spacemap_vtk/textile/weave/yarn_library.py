"""Library of weaving yarns: materials, and the yarns that weavers buy under names as "20/2 cotton".

A name consists of a count and a material. The material decides the system of the count, the density
of the fibres and how much of the yarn's section they fill, so names that are not in the library are
understood, too: "24/2 cotton", "30 tex silk".

Sources of the materials:

- Systems of counts: T. Woodhouse, "Yarn Counts and Calculations" (1921), by definition.
  Handweavers' silk is counted in Nm, because 20/2 silk has 5000 yards in a pound (M. Petrini).
- Density of fibres at 65 % relative humidity: W. E. Morton, J. W. S. Hearle, "Physical Properties
  of Textile Fibres", 4th ed. (2008), table 5.1. Flax is taken as cellulose with filled lumen, as
  cotton in that table; lyocell as regenerated cellulose, as viscose.
- Diameters: T. R. Ashenhurst, "A Treatise on Textile Calculations and the Structure of Fabrics"
  (1884): as many yarns lie side by side in an inch as k times the root of the yards in a pound.
- Share of fibre in the section: for cotton from a specific volume of 1.1 cm3/g (F. T. Peirce,
  1937), for the others from Ashenhurst's diameters.

Usual setts and put-ups are those that makers, dealers and guilds publish; each names its source.

Stiffness of the yarns follows from that of their fibres, and is right within a factor of two:

- Tension: `YARN_MODULUS` times the initial modulus of the fibres (W. E. Morton, J. W. S. Hearle,
  table 13.1, at 65 % relative humidity).
- Bending: `COHESION` times the sum of the rigidities of the fibres, which is that of fibres that
  slide freely (G. J. Livesey, J. D. Owen, "Cloth Stiffness and Hysteresis in Bending", J. Textile
  Inst. 55 (1964) T516). If no fibre could slide, it would be larger by their number, about a
  hundred. The rigidity of a fibre of linear density T is r T², where r = η E / (4 π ρ), with the
  shape factor η, the modulus E and the density ρ (Morton and Hearle, chapter 17).
"""

from __future__ import annotations

import re
from functools import lru_cache
from math import pi
from typing import NamedTuple

from spacemap_vtk.errors import InputError
from spacemap_vtk.parameters import suggestion
from spacemap_vtk.textile.weave.yarn import COTTON, PACKING, parse_yarn_count
from spacemap_vtk.units import UNITS

_INCH = UNITS["1/m"]["/in"]
_YARD = 0.9144
_POUND = UNITS["kg"]["lb"]

_MORTON = "Morton and Hearle (2008), table 5.1"
_ASHENHURST = "Ashenhurst's diameters (1884)"


#: Modulus of a yarn over that of its fibres: 3 N/tex for spun cotton. Their inclination alone, by
#: 24 degrees, gives cos² = 0.83; the rest is slip.
YARN_MODULUS = 0.6
#: Bending rigidity of a yarn over that of its fibres if these slide freely. Twice that gives spun
#: cotton of 30 tex 2 mN mm², with which light cotton cloth has a usual bending length (14 mm).
COHESION = 2.0


class Fibre(NamedTuple):
    """Stiffness of the fibres of a material."""

    modulus: float
    """Initial modulus, force over linear density [N m/kg]."""
    linear_density: float
    """Mass per length of one fibre, in kg/m."""
    rigidity: float
    """Specific flexural rigidity r, bending rigidity over linear density squared [N m4/kg2]."""
    source: str
    """Sources of the three."""

    @property
    def yarn_modulus(self) -> float:
        """Specific modulus of a yarn of these fibres, EA over its linear density [N m/kg]."""
        return YARN_MODULUS * self.modulus

    def bending(self, linear_density: float) -> float:
        """Compute the bending rigidity of a yarn [N m2] of a linear density [kg/m]."""
        return COHESION * self.rigidity * self.linear_density * linear_density


class Material(NamedTuple):
    """What yarns are made of, and how they are counted."""

    system: str
    """System of counts, as in `spacemap_vtk.textile.weave.yarn.parse_yarn_count`."""
    density: float
    """Density of the fibres, in kg/m3."""
    diameters: float
    """Ashenhurst's factor k: yarns in an inch over the root of the yards in a pound."""
    packing: float
    """Share of fibre in the yarn's section."""
    source: str
    """Sources of density and packing."""
    fibre: Fibre
    """Stiffness of its fibres."""


def _packing_from_diameters(diameters: float, density: float) -> float:
    """Compute the share of fibre in the section of a yarn of Ashenhurst's diameter."""
    return 4.0 * diameters**2 * (_POUND / _YARD) * _INCH**2 / (pi * density)


def _material(
    system: str, density: float, diameters: float, density_source: str, fibre: Fibre
) -> Material:
    packing = round(_packing_from_diameters(diameters, density), 2)
    source = f"density: {density_source}; packing: {_ASHENHURST}"
    return Material(system, density, diameters, packing, source, fibre)


def _rigidity(shape: float, modulus: float, density: float) -> float:
    """Compute the specific flexural rigidity of fibres from a shape factor and a modulus."""
    return shape * modulus / (4.0 * pi * density)


def _fibre(modulus: float, tex: float, rigidity: float, source: str) -> Fibre:
    """Describe fibres by their modulus in N/tex, tex, and rigidity in mN mm2/tex2."""
    return Fibre(1e6 * modulus, 1e-6 * tex, 1e3 * rigidity, f"modulus: {_TENSILE}; {source}")


_TENSILE = "Morton and Hearle (2008), table 13.1"
_FLEXURAL = "rigidity: Morton and Hearle (2008), table 17.1"
#: Fibres by material. Shape factors of cotton and flax were not found; those of viscose and of a
#: circle are assumed. Fineness of wool and flax is that of usual diameters.
_COTTON = _fibre(
    5.0,
    0.165,
    1e-3 * _rigidity(0.74, 5e6, COTTON),
    "Upper cotton; fineness: Micronaire 4.2 (Rieter); rigidity: shape factor 0.74 assumed",
)
_FLAX = _fibre(
    18.0,
    0.38,
    1e-3 * _rigidity(1.0, 18e6, COTTON),
    "flax; fineness: ultimate fibres of 18 um, assumed; rigidity: shape factor 1 assumed",
)
_WOOL = _fibre(2.1, 0.59, 0.20, f"crossbred 56s; fineness: 24 um, assumed; {_FLEXURAL}")
_COARSE_WOOL = _fibre(2.1, 0.81, 0.20, f"crossbred 56s; fineness: 28 um, assumed; {_FLEXURAL}")
_SILK = _fibre(7.3, 0.13, 0.19, f"silk; fineness: 1.2 denier, assumed; {_FLEXURAL}")
_VISCOSE = _fibre(6.5, 0.17, 0.19, f"Fibro; fineness: 1.5 denier, assumed; {_FLEXURAL}")
_COTTOLIN = _fibre(
    11.5, 0.27, 1e-3 * _rigidity(0.87, 11.5e6, COTTON), "means of cotton and flax, half of each"
)


#: Materials by the word that names them. Ashenhurst's k is 0.84 for woollen yarns, 0.9 for cotton
#: and worsted, 0.91 for the firmest ones (linen, silk).
MATERIALS = {
    "cotton": Material(
        "Ne",
        COTTON,
        0.9,
        PACKING,
        f"density: {_MORTON}; packing: Peirce's specific volume of 1.1 cm3/g (1937)",
        _COTTON,
    ),
    "linen": _material("NeL", COTTON, 0.91, f"{_MORTON}, taken as cotton", _FLAX),
    "cottolin": _material("NeL", COTTON, 0.9, f"{_MORTON}, taken as cotton", _COTTOLIN),
    "worsted": _material("NeK", 1310.0, 0.9, _MORTON, _WOOL),
    "wool": _material("Nm", 1310.0, 0.84, _MORTON, _COARSE_WOOL),
    "silk": _material("Nm", 1340.0, 0.91, _MORTON, _SILK),
    "tencel": _material("Ne", 1490.0, 0.91, f"{_MORTON}, taken as viscose", _VISCOSE),
    "rayon": _material("Ne", 1490.0, 0.91, _MORTON, _VISCOSE),
}


class LibraryYarn(NamedTuple):
    """What is published of a yarn that is sold under its name."""

    package: float
    """Mass of a usual cone, tube or skein, in kg."""
    plain_sett: float | None
    """Usual sett of the warp for plain weave, in 1/m; None where none is published."""
    highest_sett: float | None
    """Highest usual sett, for twills and other weaves with floats, in 1/m; likewise."""
    source: str
    """Source of the setts and of the length of a pound; empty: by definition of the count."""


_PETRINI = 'M. Petrini, "Yarn Systems" (2020)'
_HANDWOVEN = 'M. van der Hoogt, "Ask Madelyn", Handwoven, by its Master Yarn Chart'


def _yarn(
    package: float, plain: float | None = None, highest: float | None = None, source: str = ""
) -> LibraryYarn:
    """Describe a yarn by its package in g and its setts in ends per inch."""
    plain_sett, highest_sett = (None if each is None else each * _INCH for each in (plain, highest))
    return LibraryYarn(1e-3 * package, plain_sett, highest_sett, source)


#: The yarns of the library by name.
YARNS = {
    "3/2 cotton": _yarn(454, 12, 15, "label of UKI: 1260 yd/lb"),
    "5/2 cotton": _yarn(200, source="label of Ashford: 927 yd in 200 g"),
    "8/2 cotton": _yarn(227, 20, 24, f"{_HANDWOVEN}: 3360 yd/lb"),
    "10/2 cotton": _yarn(200, 24, None, f"{_HANDWOVEN}: 4200 yd/lb; package: label of Ashford"),
    "16/2 cotton": _yarn(227, 25.4, 32, "Horsens Vævekreds: 10/cm, 13500 m/kg; L. Fry: 32 epi"),
    "20/2 cotton": _yarn(454, 30, 48, f"{_PETRINI}: 8400 yd/lb"),
    "16/2 linen": _yarn(250),
    "20/2 linen": _yarn(250, 24, 30, f"{_PETRINI}: 3000 yd/lb"),
    "40/2 linen": _yarn(250, 36, None, "label: 3300 yd in 8.8 oz; Interlacements: 36 epi"),
    "22/2 cottolin": _yarn(227, source=f"{_HANDWOVEN}: 3360 yd/lb"),
    "2/8 worsted": _yarn(227),
    "2/18 worsted": _yarn(454),
    "2/20 worsted": _yarn(454, 20, 30, f"{_PETRINI}: 5600 yd/lb"),
    "6/1 wool": _yarn(200),
    "20/2 silk": _yarn(100, 24, 28, f"{_PETRINI}: 5000 yd/lb"),
    "30/2 silk": _yarn(100),
    "60/2 silk": _yarn(100, source="Woolsome: 60 m of a single in 1 g"),
    "5/2 tencel": _yarn(113, 16, 20, "Shiny Dime Fibers"),
    "8/2 tencel": _yarn(227, 20, 24, f"{_HANDWOVEN}: 3360 yd/lb; Shiny Dime Fibers: 18 to 24 epi"),
    "10/2 tencel": _yarn(100, 24, None, f"{_HANDWOVEN}: 4200 yd/lb; package: BB Yarn"),
    "20/2 tencel": _yarn(100, source="package: BB Yarn"),
}

#: A count of two numbers without a system.
_PLIED = re.compile(r"(\d+(?:\.\d+)?)\s*/\s*(\d+(?:\.\d+)?)")
#: What a name looks like, for messages and help.
GRAMMAR = (
    'a count and a material, as "20/2 cotton", "16/2 linen" or "30 tex silk"; materials: '
    + ", ".join(MATERIALS)
)


class Yarn(NamedTuple):
    """A yarn that a name describes."""

    name: str
    """The name in canonical spelling."""
    linear_density: float
    """Mass per length, in kg/m."""
    plies: int
    """Number of singles that are twisted together."""
    material: Material
    """Its material."""
    published: LibraryYarn | None
    """Its entry in the library; None for yarns that are not in it."""

    @property
    def word(self) -> str:
        """The word of its material, a key of `MATERIALS`."""
        return self.name.rpartition(" ")[2]

    @property
    def bulk_density(self) -> float:
        """Mass over the volume of the yarn, air included, in kg/m3."""
        return self.material.density * self.material.packing

    @property
    def tension(self) -> float:
        """Tensile stiffness EA [N]."""
        return self.material.fibre.yarn_modulus * self.linear_density

    @property
    def bending(self) -> float:
        """Bending rigidity B [N m2]."""
        return self.material.fibre.bending(self.linear_density)

    @property
    def diameters_per_metre(self) -> float:
        """Number of yarns that lie side by side in a metre, by Ashenhurst, in 1/m."""
        return self.material.diameters * (_POUND / _YARD / self.linear_density) ** 0.5 * _INCH


def parse_yarns(names: str | tuple[str, ...] | None) -> tuple[Yarn, ...]:
    """Parse the name of a yarn, or of several.

    Parameters
    ----------
    names : str or tuple of str, optional
        As for `parse_yarn`.

    Returns
    -------
    tuple of Yarn
        Empty without a name.
    """
    if names is None:
        return ()
    return tuple(map(parse_yarn, (names,) if isinstance(names, str) else names))


@lru_cache(200)
def parse_yarn(text: str) -> Yarn:
    """Parse the name of a yarn.

    Parameters
    ----------
    text : str
        Count and material, as ``"20/2 cotton"``, ``"2/18 worsted"``, ``"30 tex silk"`` or
        ``"Nm 12/2 wool"``. Of two numbers the larger is the count of the single yarn in the
        material's system, the smaller the number of plies.

    Returns
    -------
    Yarn
        With its entry in the library, if there is one.

    Raises
    ------
    InputError
        The text names no yarn.

    Examples
    --------
    >>> parse_yarn("20/2 Cotton").name
    '20/2 cotton'
    >>> round(parse_yarn("16/2 linen").linear_density * 1e6, 1)
    206.7
    """
    count_text, _, word = " ".join(text.lower().split()).rpartition(" ")
    material = MATERIALS.get(word)
    if material is None or not count_text:
        known = [f"{count_text} {each}" for each in MATERIALS]
        cure = suggestion(f"{count_text} {word}", known) if count_text else suggestion(word, YARNS)
        raise InputError(f'"{text}" is not the name of a yarn', allowed=GRAMMAR, cure=cure)
    plies, count_in_system = 1, count_text
    if plied := _PLIED.search(count_text):
        plies = int(min(float(plied[1]), float(plied[2])))
        if plied[0] == count_text:
            count_text = f"{plied[1]}/{plied[2]}"
            count_in_system = f"{material.system} {count_text}"
    name = f"{count_text} {word}"
    return Yarn(name, parse_yarn_count(count_in_system), plies, material, YARNS.get(name))
