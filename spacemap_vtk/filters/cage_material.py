"""Parameters for the material of a cage: a solid, or a sheet with the figures of a fabric."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.textile import StatedYarns
from spacemap_vtk.filters.textile_sheet import sheet_of_textile
from spacemap_vtk.filters.textiles.kind import TextileKind
from spacemap_vtk.filters.yarn_parameters import WarpAndWeft, YarnParameters
from spacemap_vtk.mechanics.boundary.supports import is_thin
from spacemap_vtk.mechanics.elements.materials import fabric_to_xyz, isotropic, orthotropic
from spacemap_vtk.mechanics.elements.measured_fabrics import FABRICS
from spacemap_vtk.mechanics.elements.plates import Plate, apply_measurements, homogeneous_plate
from spacemap_vtk.mechanics.elements.shell import SHEET_ASPECT
from spacemap_vtk.ndarrays import Floats, Ints, Progress
from spacemap_vtk.parameters import Choice, Parameterised, Real, Vector
from spacemap_vtk.textile.crimp.interchange import YarnMechanics
from spacemap_vtk.textile.crimp.stiffness import cloth_stiffness
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.threads import Threads
from spacemap_vtk.units import GRAVITY, parse_quantity, split_quantity

#: Density of a cage if none is given [kg/m³]: woven cotton, including air.
DENSITY = 300.0

#: Automatic Young's modulus of an object, over its weight per area.
_STIFFNESS_RATIO = 16.0

#: Material whose stiffness follows from the yarns of the weave in the cage.
WOVEN = "yarns"
#: A cloth with which yarns can be checked before the actual cloth is known.
_SAMPLE_CLOTH = Cloth(
    drawdown=np.eye(2, dtype=bool),
    warp=Threads(diameter=1e-4, spacing=3e-4),
    weft=Threads(diameter=1e-4, spacing=3e-4),
    density=1e3,
)
#: Materials for which the moduli and ratios of each type have an effect.
_ISOTROPIC = {"material": ("isotropic",)}
_ORTHOTROPIC = {"material": ("orthotropic", *FABRICS)}
#: Elements for which the figures of a sheet have an effect.
_SHEET = {"elements": ("auto", "sheet")}

#: The constants of an orthotropic solid, and all constants that have no default.
_MODULI = ("youngs_moduli", "shear_moduli", "poissons_ratios")
_CONSTANTS = (
    *_MODULI,
    "density",
    "thickness",
    "tensile_rigidity",
    "shear_rigidity",
    "poissons_ratio_in_plane",
    "bending_rigidity",
    "bending_length",
    "twisting_rigidity",
    "areal_mass",
)


class ShearRigidity(Real):
    """A sheet's stiffness in shear: force per width over an angle."""

    @property
    def units(self) -> list[str]:
        """The units except gf/cm, which does not name the angle: radian or degree."""
        return [unit for unit in super().units if unit != "gf/cm"]

    def parse(self, text: str) -> float:
        """Convert to N/m per radian; refuse gf/cm, which may be per radian or per degree."""
        found = split_quantity(text)
        if found is not None and found[1] == "gf/cm":
            number, per_radian = found[0], parse_quantity(text, self.unit)
            raise InputError(
                "the unit must name the angle, because Kawabata's shear stiffness is per degree",
                cure=f'Write "{number:g} gf/(cm.deg)", or "{per_radian:.6g} N/m" if the value is '
                "per radian.",
            )
        return parse_quantity(text, self.unit)


class CageMaterial(Parameterised):
    """Parameters for the material of a cage."""

    elements = Choice(
        "auto",
        "Mechanical model of the cage: a solid of tetrahedra, or a sheet that stretches, bends and "
        "twists as cloth does. A sheet needs a lattice of one layer, whole or carved. auto: a "
        f"sheet if the cells of this lattice are more than {SHEET_ASPECT:g} times as wide as "
        "thick.",
        ["auto", "sheet", "tetrahedra"],
    )
    material = Choice(
        "isotropic",
        "Material of the cage: isotropic; orthotropic along the fabric; yarns (a sheet whose "
        "stiffness follows from the yarns of its weave, see the section [yarns], or of its "
        "textile, see tension and bending in [textile]); or a measured "
        'fabric (see "spacemap materials"). Other constants that are given replace those of the '
        "yarns or the measured fabric.",
        ["isotropic", "orthotropic", WOVEN, *FABRICS],
    )
    youngs_modulus = Real(
        1e6,
        "Young's modulus of an isotropic cage.",
        unit="Pa",
        above=0.0,
        automatic="for an object, a value with which it sags slightly under its own weight",
        when=_ISOTROPIC,
    )
    poissons_ratio = Real(
        0.3,
        "Poisson's ratio of an isotropic cage. Linear tetrahedra become too stiff near 0.5.",
        above=-1.0,
        below=0.5,
        when=_ISOTROPIC,
    )
    youngs_moduli = Vector(
        None,
        "Young's moduli of an orthotropic cage, along the warp (1, y), the weft (2, x) and the "
        "normal (3, z). For a measured fabric they replace its own.",
        component=Real(1.0, "", unit="Pa", above=0.0),
        labels=("E1", "E2", "E3"),
        automatic="none",
        when=_ORTHOTROPIC,
    )
    shear_moduli = Vector(
        None,
        "Shear moduli of an orthotropic cage: G12 in the plane of the fabric, G13 across the "
        "warp's thickness, G23 across the weft's.",
        component=Real(1.0, "", unit="Pa", above=0.0),
        labels=("G12", "G13", "G23"),
        automatic="none",
        when=_ORTHOTROPIC,
    )
    poissons_ratios = Vector(
        None,
        "Poisson's ratios of an orthotropic cage: νij is the contraction along j for a stretch "
        "along i.",
        component=Real(0.0, ""),
        labels=("ν12", "ν13", "ν23"),
        automatic="none",
        when=_ORTHOTROPIC,
    )
    density = Real(
        None,
        "Mass density of the cage.",
        unit="kg/m3",
        above=0.0,
        automatic=f"{DENSITY:g} kg/m3; that of a measured fabric; for a sheet, that of the weave",
    )
    thickness = Real(
        None,
        "Thickness by which a measured fabric's stiffness per width and mass per area are divided "
        "if the elements are tetrahedra. With the cage's own thickness it stretches and weighs as "
        "the fabric does.",
        unit="m",
        above=0.0,
        plausible=(1e-6, 0.05),
        usual_units="mm",
        automatic="the cage's extent along z",
        when={"material": tuple(FABRICS), "elements": ("auto", "tetrahedra")},
    )
    tensile_rigidity = WarpAndWeft(
        Real(
            "1 kN/m",
            "Tensile rigidity of a sheet, measured on a strip with free sides: force per width "
            "over strain.",
            unit="N/m",
            trade_unit="gf/cm",
            above=0.0,
        ),
        automatic="Young's modulus times the cage's thickness; that of a measured fabric or of the "
        "yarns",
        group="Sheet",
        when=_SHEET,
    )
    shear_rigidity = ShearRigidity(
        None,
        "Shear rigidity of a sheet: force per width over the angle; Kawabata's values are per "
        "degree, gf/(cm.deg). That of a woven fabric is far less than follows from its tensile "
        "rigidity.",
        unit="N/m",
        trade_unit="gf/cm.deg",
        above=0.0,
        automatic="the shear modulus times the cage's thickness; that of a measured fabric or of "
        "the yarns; for an isotropic sheet from tensile_rigidity, if that is given",
        group="Sheet",
        when=_SHEET,
    )
    poissons_ratio_in_plane = Real(
        None,
        "Poisson's ratio of a sheet: contraction along the weft for a stretch along the warp. The "
        "ratio for a stretch along the weft follows from both tensile rigidities; bending uses the "
        "geometric mean of the two.",
        automatic="that of the material, as geometric mean of both directions",
        group="Sheet",
        when=_SHEET,
    )
    bending_rigidity = WarpAndWeft(
        Real(
            "10 uN.m",
            "Bending rigidity of a sheet, measured on a strip with free sides: moment per width "
            "over curvature.",
            unit="N.m",
            trade_unit="gf.cm2/cm",
            above=0.0,
        ),
        automatic="Young's modulus times the cube of the cage's thickness over 12; that of a "
        "measured fabric or of the yarns",
        group="Sheet",
        when=_SHEET,
    )
    bending_length = WarpAndWeft(
        Real(
            "20 mm",
            "Peirce's bending length c, instead of bending_rigidity (c³ times the weight of a unit "
            "area). It is half the length of a strip that hangs over an edge at 41.5 degrees.",
            unit="m",
            trade_unit="cm",
            above=0.0,
            plausible=(1e-4, 0.5),
            usual_units="mm, cm",
        ),
        automatic="from bending_rigidity",
        group="Sheet",
        when=_SHEET,
    )
    twisting_rigidity = Real(
        None,
        "Twisting rigidity D66 of a sheet: moment per width over twice the twist. For a "
        "homogeneous sheet it is the geometric mean of both bending rigidities over 2 (1 + "
        "Poisson's ratio).",
        unit="N.m",
        trade_unit="gf.cm2/cm",
        above=0.0,
        automatic="that of a measured fabric or of the yarns; otherwise, or if a bending rigidity "
        "is given, that of a homogeneous sheet",
        group="Sheet",
        when=_SHEET,
    )
    areal_mass = Real(
        None,
        "Mass per area of a sheet.",
        unit="kg/m2",
        trade_unit="oz/yd2",
        above=0.0,
        automatic="density times the cage's thickness, if density is given; otherwise that of a "
        f"measured fabric or of the weave, or {DENSITY:g} kg/m3 times the thickness",
        group="Sheet",
        when=_SHEET,
    )

    def progress_of(self, step: str) -> Progress | None:
        """Return what reports the share of a step that is done; None where nothing shows it."""
        return None

    def check_material(self, yarns: YarnParameters | YarnMechanics | StatedYarns | None) -> None:
        """Check what can be checked without a cage; `yarns` are those of the weave in it."""
        if self.material == WOVEN and self.elements != "tetrahedra":
            self._given_constants()
            if not isinstance(yarns, StatedYarns):
                self._yarn_stiffness(_SAMPLE_CLOTH, yarns)
            return
        self.solid_constants(1.0)
        if self.elements != "tetrahedra":
            self.sheet_stiffness(1.0)

    def solid_constants(self, extent: float) -> tuple[Floats, float]:
        """Return elasticity along x, y, z [Pa], (6, 6), and density [kg/m³] of a solid cage."""
        # `extent`, the cage's size along z [m], is the thickness of a measured fabric by default.
        if self.material == WOVEN:
            raise InputError(
                "this material needs a cage that is a sheet",
                key="material",
                value=WOVEN,
                cure='Set [cage] divisions such as [20, 20, 1], and elements = "sheet".',
            )
        given = self._given_constants()
        return self._solid_material(given, given.get("thickness", extent))

    def sheet_stiffness(
        self,
        thickness: float,
        normal: int = 2,
        woven: float | None = None,
        cloth: Cloth | TextileKind | None = None,
        yarns: YarnParameters | YarnMechanics | StatedYarns | None = None,
    ) -> tuple[Plate, float]:
        """Return the stiffness of a cage that is a sheet, and its mass per area [kg/m²]."""
        # Figures that are not measured are those of a homogeneous plate of the cage's thickness
        # [m]. `woven` is the mass per area of the weave in the cage, which is `cloth` with `yarns`.
        # For `normal` see `homogeneous`.
        given = self._given_constants()
        elasticity, density = self._solid_material(given, thickness)
        fabric = FABRICS.get(self.material)
        mass = given.get("areal_mass", density * thickness)
        if woven is not None and fabric is None and not {"areal_mass", "density"} & given.keys():
            mass = woven
        if self.material == WOVEN:
            own = self._yarn_stiffness(cloth, yarns)
        elif fabric is None:
            own = homogeneous_plate(elasticity, thickness, normal)
        else:
            own = homogeneous_plate(elasticity, thickness)
            own = replace(fabric.sheet, membrane=own.membrane)
        shear = self.shear_rigidity
        if shear is None and self.material != "isotropic":
            shear = float(own.membrane[2, 2])  # an independent constant of these materials
        bending = WarpAndWeft.pair(self.bending_rigidity)
        if (lengths := WarpAndWeft.pair(self.bending_length)) is not None:
            bending = (mass * GRAVITY * lengths[0] ** 3, mass * GRAVITY * lengths[1] ** 3)
        plate = apply_measurements(
            own,
            tensile=WarpAndWeft.pair(self.tensile_rigidity),
            shear=shear,
            ratio=self.poissons_ratio_in_plane,
            bending=bending,
            twisting=self.twisting_rigidity,
        )
        return plate, mass

    def warnings_for_other_elements(self, sheet: bool) -> Iterator[str]:
        """Yield a warning for each given value that is for other elements than those in use."""
        for name in self.given_values:
            if why := self.disabled_for(name, sheet):
                yield (
                    f"{self.section}.{name} has no effect: {why}; "
                    f'elements = "{"tetrahedra" if sheet else "sheet"}" would change that'
                )

    @classmethod
    def disabled_for(cls, name: str, sheet: bool) -> str:
        """Return why a parameter has no effect on a cage that is a sheet, or is not."""
        kind = "sheet" if sheet else "tetrahedra"
        if kind in cls.parameter(name).when.get("elements", kind):
            return ""
        return "the cage is a sheet" if sheet else "the cage is not a sheet"

    def _yarn_stiffness(
        self,
        cloth: Cloth | TextileKind | None,
        yarns: YarnParameters | YarnMechanics | StatedYarns | None,
    ) -> Plate:
        """Return the stiffness of the sheet that the yarns of a cloth form."""
        if isinstance(cloth, TextileKind):
            return sheet_of_textile(cloth, self.progress_of("stiffness of the yarns")).plate
        if yarns is None or isinstance(yarns, StatedYarns):
            raise InputError(
                "the stiffness of the yarns is not given",
                key="material",
                value=WOVEN,
                cure="Add a section [yarns] with tension and bending; in Python set the solver's "
                "yarns to a CrimpInterchange with both; in ParaView enter the values that "
                '"spacemap info" prints for a scene with this section.',
            )
        if cloth is None:
            raise InputError(
                "this material needs a weave in the cage",
                key="material",
                value=WOVEN,
                cure="Add a section [weave], or choose another material.",
            )
        try:
            known = yarns.yarns(cloth) if isinstance(yarns, YarnParameters) else yarns
            return cloth_stiffness(cloth, known)
        except InputError as error:
            if error.key not in YarnParameters.parameters:
                raise
            # The error belongs to another section than the one of this stage.
            raise InputError(f"[yarns] {error}", key="material", value=WOVEN) from None

    def _given_constants(self) -> dict[str, Any]:
        """Return the given constants by name; refuse those without effect, and contradictions."""
        # In the order of _CONSTANTS, so that the reported one does not depend on the order of
        # setting.
        given = {key: self.given_values[key] for key in _CONSTANTS if key in self.given_values}
        for key, value in given.items():
            if why := self.disabled_by(key):
                raise InputError(
                    f"the value has no effect: {why}",
                    key=key,
                    value=value,
                    cure=f"It has an effect where {self.parameter(key).condition}.",
                )
        for key, other in (("bending_length", "bending_rigidity"), ("areal_mass", "density")):
            if key in given and other in given:
                raise InputError(
                    f"{other} is given, too, and determines the same property",
                    key=key,
                    value=given[key],
                    cure=f"Leave out {other} or {key}.",
                )
        return given

    def _solid_material(self, given: dict[str, Any], thickness: float) -> tuple[Floats, float]:
        """Return elasticity and density; a measured fabric is spread over the thickness."""
        own = {key: given[key] for key in (*_MODULI, "density") if key in given}
        if self.material in FABRICS:
            solid = FABRICS[self.material].solid(thickness)._replace(**own)
            return fabric_to_xyz(orthotropic(*solid[:3])), solid.density
        density = own.get("density", DENSITY)
        if self.material == "orthotropic":
            for key in _MODULI:
                if key not in own:
                    raise InputError(
                        "an orthotropic material needs this value",
                        key=key,
                        allowed=self.parameter(key).allowed,
                    )
            return fabric_to_xyz(orthotropic(*(own[key] for key in _MODULI))), density
        modulus = self.values_in_use.get("youngs_modulus", type(self).youngs_modulus.default)
        if self.youngs_modulus is not None:
            modulus = self.youngs_modulus
        return isotropic(modulus, self.poissons_ratio), density

    def choose_modulus(self, vertices: Floats, elements: Ints, up: int | None) -> None:
        """Set an automatic Young's modulus that suits an object of unknown size."""
        if self.youngs_modulus is not None or up is None:
            self.values_in_use = {}
            return
        # An object that stands or hangs deforms by ρ g H² / (2 E). The end of a level plate of
        # length L and thickness t sinks by 1.5 ρ g L⁴ / (E t²). The filled share of the box allows
        # for parts, such as legs, that are thinner than the box.
        extent = np.ptp(vertices, axis=0)
        long, thick = float(extent.max()), float(extent.min())
        level = is_thin(extent) and int(extent.argmin()) == up
        length = long * (long / thick) ** 2 if level else float(extent[up])
        edges = vertices[elements[:, 1:4]] - vertices[elements[:, :1]]
        filled = float(np.abs(np.linalg.det(edges)).sum() / 6.0 / extent.prod())
        density = DENSITY if self.density is None else self.density
        found = _STIFFNESS_RATIO * density * GRAVITY * length / filled
        self.values_in_use = {"youngs_modulus": float(f"{found:.2g}")}
