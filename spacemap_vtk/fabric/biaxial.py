"""Tensile tests of a cloth by its yarns: strips whose other direction is free, and both pulled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spacemap_vtk.fabric.interchange import Interchange, Resultants
from spacemap_vtk.ndarrays import Bools, Floats

#: The tests, in the order of their curves.
TESTS = ("strip along the warp", "strip along the weft", "biaxial 1 : 1")
#: Halvings of the interval in which a free direction lies.
_HALVINGS = 24
#: How far past straight yarns a map goes, over their crimp, and its least and most.
_PAST = (0.25, 0.02, 0.05)
#: How far a map goes below rest, over how far it goes above, if no jam is nearer or further off.
_BELOW = 1.5
#: Solutions that a map is made of at most, and its least and largest number of points a side.
_SOLUTIONS = 60_000
_SIDE = (15, 61)


class StretchMap(NamedTuple):
    """What a cloth does at m x m stretches: values are (2, weft, warp) or (weft, warp)."""

    warp: Floats
    weft: Floats
    force: Floats
    """Along warp and weft, in N/m; 0 of yarns that do not stretch."""
    strain: Floats
    """Of warp and weft."""
    slack: Bools
    """Whether yarns are longer than their room."""
    exchange: Floats
    """(2, n) Stretches along warp and weft at which they begin to be pulled: there they trade
    crimp."""
    jam: Floats
    """(2, m) Least stretch of the warp at each one of the weft, and of the weft at each of the
    warp."""


class Tensile(NamedTuple):
    """A tensile test of n steps."""

    name: str
    extension: Floats
    """(2, n) Of the cloth along warp and weft, 0 at rest."""
    force: Floats
    """(2, n) Per width of cloth at rest, along warp and weft, in N/m."""
    strain: Floats
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
        force, strain, _, _, held = crossings.resultants(stretch)
        if family < 2:
            force[1 - family] = 0.0  # where it jams, that carries what the yarns pull
        result.append(Tensile(name, held - 1.0, force, strain))
    return result


def stretch_map(crossings: Interchange) -> StretchMap:
    """Stretch a cloth along warp and weft, from where it jams to past straight yarns.

    Parameters
    ----------
    crossings : Interchange
        Those of the cloth.

    Returns
    -------
    StretchMap
        Coarser where there are many kinds of crossings. Past a jam, what they do at its border.
    """
    state = crossings.solve(np.ones((2, *crossings.shape)))
    crimp = state.crimp.max(axis=(1, 2))
    share, some, most = _PAST
    high = 1.0 + crimp + np.clip(share * crimp, some, most)
    side = int(np.clip(np.sqrt(_SOLUTIONS / crossings.kinds), *_SIDE))
    low = np.empty(2)
    for family in (0, 1):
        jam = _jam(crossings, family, np.linspace(0.5, high[1 - family], side)) - 0.5 * some
        low[family] = max(jam.min(), min(jam.max(), 1.0 - _BELOW * (high[family] - 1.0)))
    axes = np.linspace(low, high, side, axis=1)
    found = crossings.resultants(np.stack(np.meshgrid(*axes)).reshape(2, -1))
    # along lines on which both stretches grow, slack yarns are pulled once
    span, aside = (high - low)[:, None], np.linspace(-1.0, 1.0, side)
    start = 1.0 + span * np.array([[1.0], [-1.0]]) * aside
    below, above = -np.ones(side), np.ones(side)
    for _ in range(_HALVINGS):
        middle = 0.5 * (below + above)
        loose = _slack(crossings.resultants(np.maximum(start + span * middle, 0.1)))
        below, above = np.where(loose, middle, below), np.where(loose, above, middle)
    return StretchMap(
        axes[0],
        axes[1],
        found.force.reshape(2, side, side),
        found.strain.reshape(2, side, side),
        _slack(found).reshape(side, side),
        start + span * above,
        np.stack([_jam(crossings, family, axes[1 - family]) for family in (0, 1)]),
    )


def _slack(found: Resultants) -> Bools:
    """Return where yarns are longer than their room by more than rounding."""
    return np.asarray((found.slack > 1e-9).any(axis=0))


def _jam(crossings: Interchange, family: int, other: Floats) -> Floats:
    """Return the least stretch that a family's yarns reach at each stretch along the other's."""
    stretch = np.stack([other, other])
    stretch[family] = 0.1
    return crossings.resultants(stretch).stretch[family]
