"""The cloth that the instruments measure: an endless sheet, with its yarns where they are known."""

from __future__ import annotations

from dataclasses import dataclass

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.crimp.interchange import YarnMechanics
from spacemap_vtk.textile.weave.cloth import Cloth

#: Names of the directions of a specimen, in the order in which they are printed, and the axis of a
#: `Plate` along each.
DIRECTIONS = (("warp", 1), ("weft", 0))


@dataclass(frozen=True, eq=False)
class Fabric:
    """A cloth before it is cut."""

    #: Stiffness; axis 1 along the weft, axis 2 along the warp.
    plate: Plate
    #: Thickness of the cloth without pressure [m].
    thickness: float
    #: Mass per area [kg/m²]; None if it is not known.
    areal_mass: float | None = None
    #: Where the stiffness comes from, in words.
    origin: str = ""
    #: Geometry and stiffness of its yarns, where they are known.
    cloth: Cloth | None = None
    yarns: YarnMechanics | None = None
    #: Coefficient of friction of yarns on each other; None if it is not known.
    friction: float | None = None
    #: Whether its yarns are loops, as of a knit, which lie neither along the warp nor the weft. Its
    #: warp is along the wales, its weft along the courses.
    loops: bool = False

    def stress(self, strain: Floats) -> Floats:
        """Compute the membrane stress.

        Parameters
        ----------
        strain : ndarray of float64, shape (…, 3)
            Green's strain 11, 22, 2·12 along weft and warp.

        Returns
        -------
        ndarray of float64, shape (…, 3)
            Second Piola-Kirchhoff stress per width [N/m].
        """
        law = self.plate.law
        return strain @ self.plate.membrane if law is None else law.stress(strain)

    def require_areal_mass(self) -> float:
        """Return the mass per area [kg/m²].

        Returns
        -------
        float
            Mass per area.

        Raises
        ------
        InputError
            It is not known.
        """
        if self.areal_mass is None:
            raise InputError(
                "the mass of the cloth is not known, and its weight bends it",
                key="areal_mass",
                cure='Give the counts of the yarns, for example --set "weave.warp_count=30 tex" '
                '--set "weave.weft_count=30 tex", or modal.areal_mass',
            )
        return self.areal_mass
