"""Yarns given by points on their centre lines: splines through them, and relaxation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import GeometryError
from spacemap_vtk.ndarrays import Floats, Progress
from spacemap_vtk.textile.rods.energy import RodMechanics
from spacemap_vtk.textile.rods.overlap import drawn_points
from spacemap_vtk.textile.rods.relax import Relaxed, relax_yarns
from spacemap_vtk.textile.rods.yarns import Yarn, basis_functions, sample_yarns, unknowns

#: Length of a span of yarns that are relaxed, in diameters.
SPAN = 0.65
#: Stiffness in tension and contact for a bending stiffness and a diameter of 1: yarns overlap by
#: less than 0.5 %.
_TENSION, _CONTACT = 1e3, 1.2e4
#: Largest deviation of resampled yarns from the curve through their points, in diameters.
_DEVIATION = 0.01
#: Most spans between two points of a file.
_MOST_SPANS = 64


class Curve(NamedTuple):
    """A yarn as points on its centre line."""

    nodes: Floats
    """(n, 3) Points in order [m]; of a loop, or of a yarn that repeats itself, without the one
    at which it comes back."""
    periods: tuple[int, int] | None = None
    """Periods of the cell after which it repeats itself, as in `Yarn`: None for two ends."""
    diameter: float = 0.0
    """Diameter, or height of a flat section [m]; 0 if unknown."""
    aspect: float = 1.0
    """Width of the section over its height."""
    color: tuple[int, int, int] | None = None
    """Red, green and blue, 0 to 255."""


class CurveSet(NamedTuple):
    """Yarns of a textile."""

    curves: list[Curve]
    cell: Floats
    """(2, 3) Period vectors [m]; zero where the textile does not repeat itself."""
    uniform: bool = False
    """Whether the parameter grows by 1 from point to point; else by the root of their distance."""
    unit: float | None = None
    """Length of 1 in the file [m]; None if the file does not define it."""
    notes: tuple[str, ...] = ()
    """Sentences on what is read in another way than the file means it."""

    def scaled(self, factor: float) -> CurveSet:
        """Multiply all lengths.

        Parameters
        ----------
        factor : float
            Factor on all lengths, above 0.

        Returns
        -------
        CurveSet
            The same yarns in another size.
        """
        curves = [
            each._replace(nodes=factor * each.nodes, diameter=factor * each.diameter)
            for each in self.curves
        ]
        return self._replace(curves=curves, cell=factor * self.cell)


class Fit(NamedTuple):
    """Yarns as uniform cubic B-splines."""

    yarns: list[Yarn]
    deviation: float
    """Largest distance from the curves through the points [m]."""


def fit_yarns(given: CurveSet, span: float | None = None) -> Fit:
    """Lay uniform cubic B-splines through the points of yarns.

    Parameters
    ----------
    given : CurveSet
        The yarns, with their diameters.
    span : float, optional
        Length of a span in diameters, for spans of equal length; by default, splines keep their
        parameter and pass exactly through all points where `CurveSet.uniform` is true.

    Returns
    -------
    Fit
        The yarns. Those with ends are not bent there (natural splines).

    Raises
    ------
    GeometryError
        If a yarn has less than two different points.

    Notes
    -----
    A uniform spline with knots at equal steps is a uniform B-spline, whose control points c solve
    (c_{i-1} + 4 c_i + c_{i+1}) / 6 = q_i: C. de Boor, "A Practical Guide to Splines" (1978), ch. 4.
    """
    made = [
        _fit_curve(curve, given.cell, given.uniform, span, number)
        for number, curve in enumerate(given.curves)
    ]
    return Fit([yarn for yarn, _ in made], max((far for _, far in made), default=0.0))


def _fit_curve(
    curve: Curve, cell: Floats, uniform: bool, span: float | None, number: int
) -> tuple[Yarn, float]:
    from scipy.interpolate import CubicSpline

    move = None if curve.periods is None else np.asarray(curve.periods) @ cell
    nodes = curve.nodes if move is None else np.vstack([curve.nodes, curve.nodes[0] + move])
    apart = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    keep = np.append(True, apart > 1e-9 * apart.max(initial=0.0))
    nodes, apart = nodes[keep], apart[keep[1:]]
    if len(nodes) < 2 or (move is not None and not move.any() and len(nodes) < 4):
        raise GeometryError(
            f"yarn {number} has too few different points",
            value=len(nodes) - (move is not None),
            allowed="2 or more; 3 or more for a loop",
        )
    if move is not None and len(nodes) == 2:  # a straight yarn that repeats itself
        nodes = np.array([nodes[0], nodes.mean(axis=0), nodes[1]])
        apart = np.full(2, apart[0] / 2)
    knots = np.append(0.0, np.cumsum(np.ones(len(apart)) if uniform else np.sqrt(apart)))
    drift = np.zeros(3) if move is None else move / knots[-1]
    shape = nodes - knots[:, None] * drift
    if move is not None:
        shape[-1] = shape[0]
    spline = CubicSpline(knots, shape, bc_type="natural" if move is None else "periodic")

    def place(at: Floats) -> Floats:
        return np.asarray(spline(at) + at[:, None] * drift)

    fine = np.interp(np.arange(16 * len(apart) + 1) / 16, np.arange(len(knots)), knots)
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(place(fine), axis=0), axis=1)))
    diameter = curve.diameter or float(along[-1]) / len(apart)
    exact = uniform and span is None
    if exact:
        lengths = np.diff(along[::16])
        factor = min(max(int(np.ceil(lengths.max() / diameter)), -(-4 // len(apart))), _MOST_SPANS)
        count = factor * len(apart)
    else:
        longest = min(diameter, float(apart.mean())) if span is None else span * diameter
        count = max(int(np.ceil(along[-1] / longest)), 4)
    most = _MOST_SPANS * len(apart)
    while True:
        steps = np.arange(count + 1) / count
        at = knots[-1] * steps if exact else np.interp(along[-1] * steps, along, fine)
        yarn = Yarn(_control_points(place(at), move), curve.periods, diameter)
        if exact:
            return yarn, 0.0
        far = _deviation(yarn, move, place, at)
        if far <= _DEVIATION * diameter or span is not None or 2 * count > most:
            return yarn, far
        count *= 2


def _control_points(nodes: Floats, move: Floats | None) -> Floats:
    """Solve for the control points of the uniform cubic B-spline through points at its knots."""
    from scipy.linalg import solveh_banded

    count = len(nodes) - 1
    if move is not None:
        trend = np.arange(count)[:, None] / count * move
        turned = np.fft.rfft(nodes[:-1] - trend, axis=0)
        factors = (2.0 + np.cos(2 * np.pi * np.arange(len(turned)) / count)) / 3.0
        middle = np.fft.irfft(turned / factors[:, None], count, axis=0) + trend
        return np.vstack([middle[-1:] - move, middle[:-1]])
    middle = nodes.copy()  # without bend at its ends, the spline's control points there are on it
    if count > 1:
        right = 6.0 * nodes[1:-1]
        right[0] -= nodes[0]
        right[-1] -= nodes[-1]
        bands = np.vstack([np.full(count - 1, 1.0), np.full(count - 1, 4.0)])
        middle[1:-1] = solveh_banded(bands, right)
    return np.vstack([2 * middle[0] - middle[1], middle, 2 * middle[-1] - middle[-2]])


def _deviation(yarn: Yarn, move: Floats | None, place: object, at: Floats) -> float:
    """Compute the largest distance, across the yarn, between a spline and what it replaces."""
    assert callable(place)
    line = drawn_points(yarn, move)
    parts = np.arange(1, 8) / 8
    value, slope, _ = basis_functions(parts)
    corners = line[np.arange(len(line) - 3)[:, None] + np.arange(4)]
    found, along = (np.einsum("gk,skc->sgc", n, corners) for n in (value, slope))
    there = at[:-1, None] + parts * np.diff(at)[:, None]
    gap = place(there.ravel()).reshape(found.shape) - found
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    gap -= along * (gap * along).sum(axis=2, keepdims=True)
    return float(np.linalg.norm(gap, axis=2).max())


def relax_curves(
    given: CurveSet, keep_cell: bool = False, progress: Progress | None = None
) -> tuple[Relaxed, float]:
    """Relax yarns of a file as round elastic rods of the length that they have in it.

    Parameters
    ----------
    given : CurveSet
        The yarns, with their diameters. Yarns with two ends are held there.
    keep_cell : bool, optional
        Whether the period vectors keep their lengths; by default they follow the yarns.
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.

    Returns
    -------
    relaxed : Relaxed
        Yarns at rest [m]; energies are those of a bending stiffness of 1 and a diameter of 1.
    deviation : float
        Largest distance of the splines from the curves in the file, before relaxation [m].

    Raises
    ------
    GeometryError
        If two centre lines are too near to know which is above.
    SolverError
        If the yarns do not come to rest.
    """
    size = float(np.mean([curve.diameter for curve in given.curves]))
    scaled = given.scaled(1.0 / size)
    yarns, deviation = fit_yarns(scaled, SPAN)
    samples = sample_yarns(yarns)
    speed = np.linalg.norm(samples.slopes(unknowns(yarns, scaled.cell)), axis=1)
    lengths = np.bincount(samples.yarn, speed * samples.weight) / samples.spans
    own = samples.diameter
    mechanics = RodMechanics(_TENSION * own**2, own**4, _CONTACT, lengths)
    held = np.concatenate(
        [
            np.minimum(np.arange(len(each.points)), np.arange(len(each.points))[::-1]) < 3
            if each.periods is None
            else np.zeros(len(each.points), dtype=bool)
            for each in yarns
        ]
    )
    free = (scaled.cell != 0.0) & (not keep_cell)
    found = relax_yarns(yarns, scaled.cell, mechanics, free, held=held, progress=progress)
    return (
        found._replace(
            yarns=[
                each._replace(points=size * each.points, diameter=size * each.diameter)
                for each in found.yarns
            ],
            cell=size * found.cell,
            lengths=size * found.lengths,
        ),
        size * deviation,
    )


def repeat_yarns(
    yarns: Sequence[Yarn], cell: Floats, repeats: tuple[int, int]
) -> list[tuple[int, Floats]]:
    """Repeat the yarns of a cell over a piece.

    Parameters
    ----------
    yarns : sequence of Yarn
        Yarns of a cell.
    cell : ndarray of float64, shape (2, 3)
        Period vectors [m]; where one is zero, yarns are not repeated along it.
    repeats : tuple of int
        Number of cells along both.

    Returns
    -------
    list of tuple
        Number of the yarn, and control points (n, 3) of a line; a yarn that repeats itself is one
        line as far as it stays within the piece.
    """
    size = [count if vector.any() else 1 for count, vector in zip(repeats, cell, strict=True)]
    lines = []
    for number, yarn in enumerate(yarns):
        step = yarn.periods or (0, 0)
        for m in range(size[0]):
            for n in range(size[1]):
                if any(step) and _is_within((m - step[0], n - step[1]), size):
                    continue  # a part of the line that begins there
                turns = 1
                while any(step) and _is_within((m + turns * step[0], n + turns * step[1]), size):
                    turns += 1
                move = None if yarn.periods is None else np.asarray(step) @ cell
                parts = [yarn.points + (k * move if move is not None else 0) for k in range(turns)]
                last = [] if move is None else [yarn.points[:3] + turns * move]
                lines.append((number, np.vstack([*parts, *last]) + np.array([m, n]) @ cell))
    return lines


def _is_within(place: tuple[int, int], size: Sequence[int]) -> bool:
    return 0 <= place[0] < size[0] and 0 <= place[1] < size[1]
