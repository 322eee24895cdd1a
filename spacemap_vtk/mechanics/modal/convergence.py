"""How far figures depend on the cells: estimates from solutions in wider cells.

P. J. Roache, "Perspective: A Method for Uniform Reporting of Grid Refinement Studies", J. Fluids
Eng. 116 (1994) 405: if a figure's error falls as h^p, its difference between cells of width h and
r h, over r^p - 1, is the error in the finer cells. A safety factor makes a bound of this estimate.
A third solution shows p; where it shows none, the factor is larger.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.ndarrays import Floats

#: Orders p in which frequencies and deflections of sheets, and of tetrahedra, converge. Measured
#: with clamped plates and blocks: sheets 2.0, linear tetrahedra 1.5 to 1.7, quadratic ones 1.5 to
#: 2.6, since the stress at a clamped edge is singular.
SHEET_ORDER, SOLID_ORDER = 2.0, 1.5
#: The order if a support ends between vertices: what it holds is wrong by a share of a cell.
EDGE_ORDER = 1.0
#: Safety factors of the estimate, Roache's values: for an order that three solutions show, and for
#: one that is assumed.
SAFETY, UNKNOWN_SAFETY = 1.25, 3.0
#: Least order that three solutions can show; a figure that differs nearly as much between narrow
#: cells as between wide ones does not converge yet.
LEAST_ORDER = 0.5
#: Where three solutions show no order, least share of the difference of the wider two in the error.
SWING = 0.5
#: Largest relative difference between both solutions that is still taken to fall as h^p. For
#: plates of 5 to 20 cells the estimate is then a bound, and it is one up to twice this difference.
ASYMPTOTIC = 0.3
#: Relative error up to which a figure counts as converged.
TOLERANCE = 0.05
#: Least share of a mode's shape that must be found in the modes of the wider cells.
SAME_SHAPE = 0.8
#: Least share of a mode's shape in one mode of the wider cells; less is noise.
_NOISE = 0.1
#: Largest relative difference of two states of equilibrium that count as the same state.
SAME_STATE = 0.1


class Estimate(NamedTuple):
    """Error of a figure that is due to the width of the cells."""

    error: float
    """Half the width of the interval in which the figure is expected, in its unit."""
    converged: bool
    """Whether the error is small, and both solutions are alike enough to tell."""


def estimate_error(
    fine: ArrayLike,
    coarse: ArrayLike,
    ratio: float,
    *,
    coarsest: ArrayLike | None = None,
    coarsest_ratio: float | None = None,
    order: float = SHEET_ORDER,
    same_state: bool = True,
    least: float = 0.0,
) -> Estimate:
    """Estimate the error of a figure from its values in cells of two or three widths.

    Parameters
    ----------
    fine, coarse : float or array_like, shape (n,)
        The figure, a number or a vector, in the cells of interest, and in wider ones.
    ratio : float
        Width of the wider cells over that of the others, above 1.
    coarsest : float or array_like, shape (n,), optional
        The figure in still wider cells.
    coarsest_ratio : float, optional
        Their width over that of `coarse`; by default `ratio`.
    order : float, optional
        Power of the width with which the error falls where cells are narrow enough.
    same_state : bool, optional
        Whether the first two solutions show the same mode or state of equilibrium.
    least : float, optional
        Relative error that is known from elsewhere; the result is no smaller.

    Returns
    -------
    Estimate
        ``SAFETY |coarse - fine| / (ratio^p - 1)``, where p is the order that three solutions show,
        but at most `order`. If they show none (there are two only, or the differences have opposite
        directions or grow), ``UNKNOWN_SAFETY |coarse - fine| / (ratio^order - 1)``, and no less
        than `SWING` of the difference of the wider two. If the first two solutions are not alike,
        no less than their difference, and not converged.

    Examples
    --------
    >>> error, converged = estimate_error(10.1, 10.4, 2.0, coarsest=11.6)
    >>> round(error, 9), converged
    (0.125, True)
    >>> error, converged = estimate_error(10.1, 10.4, 2.0)
    >>> round(error, 9), converged
    (0.3, True)
    >>> estimate_error(0.5, 1.0, 2.0)
    Estimate(error=0.5, converged=False)
    """
    size = float(np.linalg.norm(fine))
    step = np.subtract(coarse, fine)
    difference = float(np.linalg.norm(step))
    error = UNKNOWN_SAFETY * difference / (ratio**order - 1)
    if coarsest is not None:
        next_step = np.subtract(coarsest, coarse)
        next_difference, seen = float(np.linalg.norm(next_step)), 0.0
        if np.vdot(step, next_step) > 0.0:
            ratios = ratio, coarsest_ratio or ratio
            seen = _observe_order(next_difference / difference, ratios, order)
        if seen > 0.0:
            # An order that is larger than the known one may be chance.
            expected = next_difference / _growth(ratios, order)
            error = SAFETY * max(difference, expected) / (ratio**seen - 1)
        else:
            error = max(error, SWING * next_difference)
    alike = same_state and difference <= ASYMPTOTIC * size
    if not alike:
        error = max(error, difference)
    error = max(error, least * size)
    return Estimate(error, alike and error <= TOLERANCE * size)


def _growth(ratios: tuple[float, float], order: float) -> float:
    """Compute how much larger the difference of the wider two of three solutions is."""
    finer, wider = (ratio**order - 1 for ratio in ratios)
    return ratios[0] ** order * wider / finer


def _observe_order(growth: float, ratios: tuple[float, float], most: float) -> float:
    """Find the order at which differences of solutions grow; 0 if it is below `LEAST_ORDER`."""
    if growth >= _growth(ratios, most):
        return most
    if growth <= _growth(ratios, LEAST_ORDER):
        return 0.0
    from scipy.optimize import brentq

    return float(brentq(lambda p: _growth(ratios, p) - growth, LEAST_ORDER, most))


def match_modes(
    fine: Floats, coarse: Floats, masses: Floats, eigenvalues: Floats
) -> tuple[Floats, Floats]:
    """Find each mode of a cage among the modes in wider cells, by its shape.

    Parameters
    ----------
    fine : ndarray of float64, shape (n, V, 3)
        Mode shapes of the cage, interpolated to the vertices of the wider cells.
    coarse : ndarray of float64, shape (m, V, 3)
        Mode shapes in the wider cells.
    masses : ndarray of float64, shape (V,)
        Masses of these vertices [kg].
    eigenvalues : ndarray of float64, shape (m,)
        Eigenvalues in the wider cells [1/s²].

    Returns
    -------
    shares : ndarray of float64, shape (n,)
        Share of each shape that is found in the modes of the wider cells, near 1 for the same mode.
    eigenvalues : ndarray of float64, shape (n,)
        Their mean eigenvalue, weighted by these shares; NaN if nothing is found.

    Notes
    -----
    The share of one shape in another is the modal assurance criterion (R. J. Allemang and
    D. L. Brown 1982) with the masses as weights. Modes of equal frequency may be mixed differently
    in both solutions; as the shares of all of them count, this does not matter.
    """
    weight = np.sqrt(masses)[:, None]
    parts = []
    for shapes in (fine, coarse):
        rows = (shapes * weight).reshape(len(shapes), -1)
        size = np.linalg.norm(rows, axis=1)[:, None]
        parts.append(np.divide(rows, size, out=np.zeros_like(rows), where=size > 0))
    shares = (parts[0] @ parts[1].T) ** 2
    shares[shares < _NOISE] = 0.0
    found = shares.sum(axis=1)
    with np.errstate(invalid="ignore"):
        return found, shares @ eigenvalues / found


def relative_difference(fine: Floats, coarse: Floats) -> float:
    """Compute the size of a difference of displacements over that of the displacement.

    Parameters
    ----------
    fine, coarse : ndarray of float64, shape (V, 3)
        Displacements of the same points [m].

    Returns
    -------
    float
        0 if nothing is displaced.
    """
    size = float(np.linalg.norm(fine))
    return float(np.linalg.norm(coarse - fine)) / size if size else 0.0
