"""Tensile tests of a cloth by its yarns: strips whose other direction is free, and both pulled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.fabric.interchange import Interchange

#: The tests, in the order of their curves.
TESTS = ("strip along the warp", "strip along the weft", "biaxial 1 : 1")
#: Halvings of the interval in which a free direction lies.
_HALVINGS = 24


class StretchMap(NamedTuple):
    """What a cloth does at a grid of stretches: values are (2, weft, warp) or (weft, warp)."""

    warp: NDArray[np.float64]
    weft: NDArray[np.float64]
    force: NDArray[np.float64]
    """Along warp and weft, in N/m; 0 of yarns that do not stretch."""
    strain: NDArray[np.float64]
    """Of warp and weft."""
    distance: NDArray[np.float64]
    """Least D over D at rest."""
    border: NDArray[np.float64]
    """(2, n) Where yarns jam."""


class Tensile(NamedTuple):
    """A tensile test of n steps."""

    name: str
    extension: NDArray[np.float64]
    """(2, n) Of the cloth along warp and weft, 0 at rest."""
    force: NDArray[np.float64]
    """(2, n) Per width of cloth at rest, along warp and weft, in N/m."""
    strain: NDArray[np.float64]
    """(2, n) Largest of the yarns' strains."""


def tensile_tests(crossings: Interchange, largest: float, steps: int = 51) -> list[Tensile]:
    """Pull a cloth along the warp, along the weft, and along both alike.

    Parameters
    ----------
    crossings : Interchange
        Those of the cloth, of yarns that stretch.
    largest : float
        Largest extension.
    steps : int
        How many extensions, from 0 on.

    Returns
    -------
    list of Tensile
        In the order of `TESTS`. In a strip the other direction is as wide as it is without force:
        the widest at which its yarns do not pull, or at
        which they jam.
    """
    pulled = 1.0 + np.linspace(0.0, largest, steps)
    threshold = 1e-9 * crossings.resultants([[1.01], [1.01]]).force.max()
    result = []
    for family, name in enumerate(TESTS):
        stretch = np.stack([pulled, pulled])
        if family < 2:
            # from where yarns jam to where both directions are pulled
            stretch[1 - family] = 0.1
            low = crossings.resultants(stretch).stretch[1 - family] * (1.0 + 1e-12)
            high = np.maximum(low, 1.0 + largest)
            for _ in range(_HALVINGS):
                stretch[1 - family] = 0.5 * (low + high)
                taut = crossings.resultants(stretch).force[1 - family] > threshold
                low = np.where(taut, low, stretch[1 - family])
                high = np.where(taut, stretch[1 - family], high)
            stretch[1 - family] = low
        force, strain, _, held = crossings.resultants(stretch)
        if family < 2:
            force[1 - family] = 0.0  # where it jams, that carries what the yarns pull
        result.append(Tensile(name, held - 1.0, force, strain))
    return result


def stretch_map(crossings: Interchange, low: float, high: float, side: int = 41) -> StretchMap:
    """Return what a cloth does at stretches along warp and weft.

    Parameters
    ----------
    crossings : Interchange
        Those of the cloth.
    low, high : float
        Least and largest stretch.
    side : int
        How many of them, in either direction.

    Returns
    -------
    StretchMap
        Past the border of what yarns leave room for, what they do at the border.
    """
    stretch = np.linspace(low, high, side)
    found = crossings.resultants(np.stack([a.ravel() for a in np.meshgrid(stretch, stretch)]))
    return StretchMap(
        stretch,
        stretch,
        found.force.reshape(2, side, side),
        found.strain.reshape(2, side, side),
        found.distance.reshape(side, side),
        crossings.jam_border(),
    )
