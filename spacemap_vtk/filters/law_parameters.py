"""Parameters for the law of a sheet's membrane: linear, from its yarns, or from measured curves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.cage_material import WOVEN, CageMaterial
from spacemap_vtk.filters.textile import StatedYarns
from spacemap_vtk.filters.textile_sheet import law_of_textile
from spacemap_vtk.filters.textiles.kind import TextileKind
from spacemap_vtk.filters.yarn_parameters import YarnParameters
from spacemap_vtk.io import registry
from spacemap_vtk.mechanics.elements.curve_law import CurveLaw
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.parameters import Choice, FilePath
from spacemap_vtk.textile.crimp.cloth_law import cloth_law
from spacemap_vtk.textile.crimp.interchange import YarnMechanics
from spacemap_vtk.textile.weave.cloth import Cloth

#: Elements for which the law of a sheet has an effect.
_SHEET = {"elements": ("auto", "sheet")}
#: Figures of a linear membrane, which other laws replace.
_LINEAR_FIGURES = ("tensile_rigidity", "poissons_ratio_in_plane")


class LawParameters(CageMaterial):
    """Parameters for the law of a sheet's membrane."""

    law = Choice(
        None,
        "Law of a sheet's membrane. linear: the stress is the stiffness times the strain; slack "
        "cloth pushes as hard as taut cloth pulls. yarns: the energy of the yarns as they exchange "
        "crimp, are slack, straighten or jam, and touch each other in shear; of a textile, that of "
        "its strained cell, which takes half a minute to some minutes once. curves: forces that "
        "were measured, see warp_curve. Small vibrations about an undeformed sheet are linear with "
        "each of them.",
        ["linear", "yarns", "curves"],
        automatic='yarns with material = "yarns" of a weave; curves with warp_curve; otherwise, or '
        "with tensile_rigidity or poissons_ratio_in_plane, linear",
        group="Sheet",
        when=_SHEET,
    )
    warp_curve = FilePath(
        None,
        "Text file of a tensile test along the warp with the width held: a line for each point, "
        "with the stretch (length over length at rest) and the force per width in N/m. Below its "
        "first point the warp is slack.",
        automatic="none",
        group="Sheet",
        when=_SHEET,
    )
    weft_curve = FilePath(
        None,
        "The same along the weft.",
        automatic="that of the warp",
        group="Sheet",
        when=_SHEET,
    )
    shear_curve = FilePath(
        None,
        "Text file of a shear test: a line for each point, with the angle in degrees and the force "
        "per width in N/m.",
        automatic="a line, with shear_rigidity",
        group="Sheet",
        when=_SHEET,
    )

    @property
    def has_textile(self) -> bool:
        """Whether the yarns are those of a textile, whose law takes long."""
        return False

    def law_in_use(self) -> str:
        """Return the law that applies; refuse contradictory values."""
        curves = [name for name in ("warp_curve", "weft_curve", "shear_curve") if self._has(name)]
        linear = [name for name in _LINEAR_FIGURES if self._has(name)]
        from_yarns = self.material == WOVEN
        if self.law is None and not curves:
            nonlinear = from_yarns and not linear and not self.has_textile
            return "yarns" if nonlinear else "linear"
        law = self.law or "curves"
        if law == "yarns" and not from_yarns:
            raise InputError(
                "this law needs a cloth whose yarns are known",
                key="law",
                value=law,
                cure='Set modal.material = "yarns", with [weave] and [yarns]; or measure curves.',
            )
        if law != "linear" and linear:
            raise InputError(
                f'the value is that of a linear sheet, and the law is "{law}"',
                key=linear[0],
                value=getattr(self, linear[0]),
                cure=f'Leave out {linear[0]}, or set law = "linear".',
            )
        if law == "curves" and not self._has("warp_curve"):
            raise InputError(
                "the law needs a measured curve",
                key="warp_curve",
                allowed="a text file of stretches and forces in N/m",
                cure='Give warp_curve, or set law = "linear".',
            )
        if law != "curves" and curves:
            raise InputError(
                f'the curve has no effect with the law "{law}"',
                key=curves[0],
                value=str(getattr(self, curves[0])),
                cure=f'Leave out {curves[0]}, or set law = "curves".',
            )
        return law

    def check_material(self, yarns: YarnParameters | YarnMechanics | StatedYarns | None) -> None:
        """Check what can be checked without a cage; `yarns` are those of the weave in it."""
        super().check_material(yarns)
        if self.elements != "tetrahedra":
            self.law_in_use()

    def sheet_stiffness(
        self,
        thickness: float,
        normal: int = 2,
        woven: float | None = None,
        cloth: Cloth | TextileKind | None = None,
        yarns: YarnParameters | YarnMechanics | StatedYarns | None = None,
    ) -> tuple[Plate, float]:
        """Return stiffness and law of a cage that is a sheet, and its mass per area [kg/m²]."""
        plate, mass = super().sheet_stiffness(thickness, normal, woven, cloth, yarns)
        known: Any = yarns
        if isinstance(yarns, YarnParameters) and isinstance(cloth, Cloth):
            known = yarns.yarns(cloth)
        return self._add_law(plate, cloth, known), mass

    def _add_law(self, plate: Plate, cloth: Cloth | TextileKind | None, yarns: Any) -> Plate:
        """Add the law of the membrane to a plate, which has its stiffness at rest."""
        law = self.law_in_use()
        if isinstance(cloth, TextileKind) and law == "yarns":
            found_law = law_of_textile(cloth, self.progress_of("law of the yarns"))
            return replace(plate, law=found_law.with_shear(float(plate.membrane[2, 2])))
        if law == "linear":
            return plate
        if law == "curves":
            found = self._read_curves(float(plate.membrane[2, 2]))
            return replace(plate, membrane=found.stiffness_at_rest, law=found)
        assert isinstance(cloth, Cloth)
        made = cloth_law(cloth, yarns)
        return replace(plate, law=made.with_shear(float(plate.membrane[2, 2])))

    def _has(self, name: str) -> bool:
        return getattr(self, name) is not None

    def _read_curves(self, shear: float) -> CurveLaw:
        """Read the curves; without one of shear, it is linear with the given stiffness [N/m]."""
        warp = self._read_curve("warp_curve")
        weft = warp if self.weft_curve is None else self._read_curve("weft_curve")
        turned = np.array([[0.0, 0.0], [1.0, shear]])
        if self.shear_curve is not None:
            turned = self._read_curve("shear_curve")
            turned[:, 0] = np.radians(turned[:, 0])
        return CurveLaw(warp, weft, turned)

    def _read_curve(self, key: str) -> Floats:
        file = getattr(self, key)
        try:
            return np.transpose(registry.read(file, "table"))
        except InputError as error:
            error.key = key  # readers name their own parameter
            raise
