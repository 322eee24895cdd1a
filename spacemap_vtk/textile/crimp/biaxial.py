"""Tensile tests of a cloth from its yarns: strips with a free width, and equal biaxial tension."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spacemap_vtk.ndarrays import Bools, Floats
from spacemap_vtk.textile.crimp.interchange import Interchange, Resultants

#: The tests, in the order of their curves.
TESTS = ("strip along the warp", "strip along the weft", "biaxial 1 : 1")
#: Bisection steps that find the extension of a free direction.
_BISECTIONS = 24
#: How far the map goes beyond straight yarns: share of the crimp, and least and largest amount.
_RANGE_ABOVE = (0.25, 0.02, 0.05)
#: How far the map goes below rest, as a multiple of its range above rest, unless yarns jam earlier
#: or later.
_RANGE_BELOW = 1.5
#: Largest number of solutions in a map.
_SOLUTIONS = 60_000
#: Least and largest number of points along one side of a map.
_SIDE = (15, 61)


class StretchMap(NamedTuple):
    """Response of a cloth at m x m stretches; values are (2, weft, warp) or (weft, warp)."""

    warp: Floats
    weft: Floats
    force: Floats
    """Along warp and weft, in N/m; 0 for yarns that do not stretch."""
    strain: Floats
    """Strains of warp and weft."""
    slack: Bools
    """Whether yarns are longer than their room."""
    exchange: Floats
    """(2, n) Stretches along warp and weft at which yarns become taut: there they exchange
    crimp."""
    jam: Floats
    """(2, m) Least stretch of the warp for each weft stretch, and of the weft for each warp
    stretch."""


class TensileTest(NamedTuple):
    """A tensile test of n steps."""

    name: str
    extension: Floats
    """(2, n) Extension of the cloth along warp and weft, 0 at rest."""
    force: Floats
    """(2, n) Force per width of cloth at rest, along warp and weft, in N/m."""
    strain: Floats
    """(2, n) Largest strain of any yarn."""


def simulate_tensile_tests(
    crossings: Interchange, largest: float, steps: int = 51
) -> list[TensileTest]:
    """Simulate tensile tests along the warp, along the weft, and along both.

    Parameters
    ----------
    crossings : Interchange
        Crossings of the cloth; its yarns must stretch.
    largest : float
        Largest extension.
    steps : int
        Number of extensions, from 0 to `largest`.

    Returns
    -------
    list of TensileTest
        In the order of `TESTS`. In a strip test the other direction is as wide as it is without
        force: the largest width at which its yarns do not pull, or the width at which they jam.
    """
    pulled = 1.0 + np.linspace(0.0, largest, steps)
    threshold = 1e-9 * crossings.resultants([[1.01], [1.01]]).force.max()
    result = []
    for family, name in enumerate(TESTS):
        stretch = np.stack([pulled, pulled])
        if family < 2:
            # Search between the stretch at which yarns jam and that at which both directions pull.
            stretch[1 - family] = 0.1
            low = crossings.resultants(stretch).stretch[1 - family] * (1.0 + 1e-12)
            high = np.maximum(low, 1.0 + largest)
            for _ in range(_BISECTIONS):
                stretch[1 - family] = 0.5 * (low + high)
                taut = crossings.resultants(stretch).force[1 - family] > threshold
                low = np.where(taut, low, stretch[1 - family])
                high = np.where(taut, stretch[1 - family], high)
            stretch[1 - family] = low
        force, strain, _, _, reached = crossings.resultants(stretch)
        if family < 2:
            force[1 - family] = 0.0  # if it is jammed, the jam balances the pull of the yarns
        result.append(TensileTest(name, reached - 1.0, force, strain))
    return result


def compute_stretch_map(crossings: Interchange) -> StretchMap:
    """Compute the response to stretches of warp and weft, from jammed to beyond straight yarns.

    Parameters
    ----------
    crossings : Interchange
        Crossings of the cloth.

    Returns
    -------
    StretchMap
        It is coarser if the cloth has many kinds of crossings. Beyond a jam it holds the values at
        the jam.
    """
    state = crossings.solve(np.ones((2, *crossings.shape)))
    crimp = state.crimp.max(axis=(1, 2))
    share, least, most = _RANGE_ABOVE
    high = 1.0 + crimp + np.clip(share * crimp, least, most)
    side = int(np.clip(np.sqrt(_SOLUTIONS / crossings.kind_count), *_SIDE))
    low = np.empty(2)
    for family in (0, 1):
        jam = (
            _jam_stretch(crossings, family, np.linspace(0.5, high[1 - family], side)) - 0.5 * least
        )
        low[family] = max(jam.min(), min(jam.max(), 1.0 - _RANGE_BELOW * (high[family] - 1.0)))
    axes = np.linspace(low, high, side, axis=1)
    found = crossings.resultants(np.stack(np.meshgrid(*axes)).reshape(2, -1))
    # On a line along which both stretches grow, slack yarns become taut exactly once.
    span, aside = (high - low)[:, None], np.linspace(-1.0, 1.0, side)
    start = 1.0 + span * np.array([[1.0], [-1.0]]) * aside
    below, above = -np.ones(side), np.ones(side)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (below + above)
        loose = _is_slack(crossings.resultants(np.maximum(start + span * middle, 0.1)))
        below, above = np.where(loose, middle, below), np.where(loose, above, middle)
    return StretchMap(
        axes[0],
        axes[1],
        found.force.reshape(2, side, side),
        found.strain.reshape(2, side, side),
        _is_slack(found).reshape(side, side),
        start + span * above,
        np.stack([_jam_stretch(crossings, family, axes[1 - family]) for family in (0, 1)]),
    )


def _is_slack(found: Resultants) -> Bools:
    """Check where yarns are longer than their room by more than rounding."""
    return np.asarray((found.slack > 1e-9).any(axis=0))


def _jam_stretch(crossings: Interchange, family: int, other: Floats) -> Floats:
    """Compute the least stretch of a family for each stretch of the other family."""
    stretch = np.stack([other, other])
    stretch[family] = 0.1
    return crossings.resultants(stretch).stretch[family]
