"""The law of a knit's membrane: the energy of its cell as it is strained step by step.

The cell is stretched by 1 + r cos φ along x and by 1 + r sin φ along y, in rays of equal φ from
rest outwards; each state is relaxed from the last one. A ray ends where the yarns pull or push each
other hard, and goes on as a spring from there. Between the states the energy per area is

    W = w (exp(t² q(t, φ)) - 1),    t = asinh(r/f)/asinh(1/f),

with a table of q: a cubic spline in φ and in the graded radius t. So the energy is smooth at rest,
its tangent there is the Schur complement (`CellStiffness`), and the logarithm keeps the steep end
of the curve, where loops are straight, from spoiling its soft beginning. Derivatives are exact.
Shear is linear in the angle and apart from the stretch.

Yarns that are set have no force at rest, not even where they touch. Where a strain presses them on
each other, the energy begins with the stiffness at rest. Where it parts them, which the linear
stiffness does not allow for, they hardly resist, and the energy begins as that of the first state.
Between such directions a cubic spline would swing, so that Akima's replaces it in φ. A strip is
stretched along y alone, and its energy across is taken to be the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import SolverError
from spacemap_vtk.mechanics.elements.membrane_law import (
    StretchLaw,
    StretchResponse,
    shear_angle,
)
from spacemap_vtk.ndarrays import Floats, Progress
from spacemap_vtk.textile.rods.energy import RodMechanics
from spacemap_vtk.textile.rods.relax import Relaxed, Stage, relax_yarns
from spacemap_vtk.textile.rods.yarns import Yarn

#: Directions of strain, and radii of the table up to `_REACH`; near zero their distance is that of
#: `_FINE` over the number of radii.
RAYS, _RADII, _REACH, _FINE = 24, 31, 1.0, 0.02
_SPAN = float(np.arcsinh(1.0 / _FINE))
#: Set yarns that exchange crimp, which makes the square of C12 nearly C11 C22, have a narrow valley
#: of little energy between being pulled and pressed: above this share they get twice the rays.
_VALLEY = 0.8
#: Rays on each side of one on which its Akima spline depends.
_ROUND = 3
#: Share of `_FINE` below which series replace quotients.
_SERIES = 1e-2
#: First step of a ray, growth of steps, and largest step.
_FIRST, _GROWTH, _WIDEST = 0.01, 0.5, 0.06
#: First step of yarns that are set, and their least stretch: they part at once if the cell is
#: pressed, and only bend.
_FIRST_SET, _LEAST_SET = 0.003, 0.7
#: Share of the linear stiffness below which yarns that are set have parted in the first step.
_PARTED = 0.5
#: Radius up to which the energy is that of the stiffness at rest.
_LINEAR = 1e-3
#: Strain of a yarn at which a ray ends; spun yarns break at a few percent.
_LARGEST_STRAIN = 0.03
#: Strain at which the energy of the stiffness at rest is the w of the logarithm.
_KNEE = 0.04
#: Yarns have snapped if the energy of a step is below this share of what the smaller pull says.
_SNAP = 0.9
#: Stage of the search of each state.
_STAGE = Stage(1.0, 1.0, 1e-6)


class CellTable(NamedTuple):
    """Energy of a strained cell."""

    values: Floats
    """(radii, rays) q."""
    scale: float
    """w [J/m²]."""
    beyond: float
    """Stiffness beyond a radius of 1 [N/m]."""


def tabulate_cell(
    yarns: Sequence[Yarn],
    cell: Floats,
    mechanics: RodMechanics,
    stiffness: Floats,
    progress: Progress | None = None,
) -> CellTable:
    """Strain a cell along rays, and tabulate its energy.

    Parameters
    ----------
    yarns : sequence of Yarn
        Yarns at rest.
    cell : ndarray of float64, shape (2, 3)
        Period vectors, along x and y [m].
    mechanics : RodMechanics
        Stiffness of the yarns.
    stiffness : ndarray of float64, shape (3, 3)
        Stiffness of the membrane at rest [N/m].
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.

    Returns
    -------
    CellTable
        Table of the law.

    Raises
    ------
    SolverError
        If the yarns of a cell that is hardly strained do not come to rest.
    """
    taut = _taut_stiffness(yarns, min(float(np.linalg.norm(side)) for side in cell), mechanics)
    area = float(np.linalg.norm(np.cross(*cell)))
    rest = relax_yarns(yarns, cell, mechanics, np.zeros((2, 3), dtype=bool), stages=[_STAGE])
    linear = stiffness[:2, :2]
    scale = float(np.trace(linear)) / 4 * _KNEE**2
    radii = _radius(np.linspace(0.0, 1.0, _RADII))
    rays = RAYS
    if mechanics.set_in is not None and linear[0, 1] ** 2 > _VALLEY * linear[0, 0] * linear[1, 1]:
        rays = 2 * RAYS
    values = np.empty((_RADII, rays))
    for ray in range(rays):
        angle = 2 * np.pi * ray / rays
        way = np.array([np.cos(angle), np.sin(angle)])
        limit = _LARGEST_STRAIN * taut
        states = _march(rest.yarns, cell, mechanics, way, area, limit, rest.state.energy)
        along = float(way @ linear @ way)
        if mechanics.set_in is not None:
            along = _stiffness_at_rest(states, along)
        values[:, ray] = _fit_ray(radii, states, along, scale)
        if progress is not None:
            progress((ray + 1) / rays)
    return CellTable(values, scale, taut)


def tabulate_strip(
    yarns: Sequence[Yarn],
    cell: Floats,
    mechanics: RodMechanics,
    width: float,
    stiffness: float,
    progress: Progress | None = None,
) -> CellTable:
    """Strain a strip of set yarns along y, and tabulate its energy as that of a sheet.

    Parameters
    ----------
    yarns : sequence of Yarn
        Yarns in the shape in which they are set.
    cell : ndarray of float64, shape (2, 3)
        Period vectors, 0 and along y [m].
    mechanics : RodMechanics
        Stiffness of the yarns.
    width : float
        Width of the strip [m].
    stiffness : float
        Stiffness along it at rest [N/m].
    progress : callable, optional
        Called with the share that is done, 0 to 1; may raise to stop.

    Returns
    -------
    CellTable
        The energy of the strip along y, and the same along x: the sum of both.

    Raises
    ------
    SolverError
        If the yarns of a strip that is hardly strained do not come to rest.
    """
    taut = _taut_stiffness(yarns, width, mechanics)
    area = width * float(np.linalg.norm(cell))
    curves, stiff = [], []
    for number, sign in enumerate((1.0, -1.0)):
        way = np.array([0.0, sign])
        states = _march(yarns, cell, mechanics, way, area, _LARGEST_STRAIN * taut, 0.0)
        curves.append(_continue(states))
        stiff.append(_stiffness_at_rest(states, stiffness))
        if progress is not None:
            progress((number + 1) / 2)
    radii = _radius(np.linspace(0.0, 1.0, _RADII))
    scale, values = stiff[0] / 2 * _KNEE**2, np.empty((_RADII, RAYS))
    for ray in range(RAYS):
        angle = 2 * np.pi * ray / RAYS
        along, at_rest = np.stack([radii, 0 * radii, 0 * radii]), 0.0
        for part in (np.cos(angle), np.sin(angle)):
            energy, force = curves[int(part < 0.0)](abs(part) * radii)
            along[1:] += energy, abs(part) * force
            at_rest += part**2 * stiff[int(part < 0.0)]
        values[:, ray] = _fit_ray(radii, along[:, 1:], at_rest, scale)
    return CellTable(values, scale, taut)


def _stiffness_at_rest(states: Floats, linear: float) -> float:
    """Return the stiffness of set yarns at rest: the linear one if they are pressed together."""
    radius, energy, _ = states[:, 0]
    secant = 2.0 * float(energy / radius**2)
    return linear if secant > _PARTED * linear else secant


def _continue(states: Floats) -> Callable[[Floats], tuple[Floats, Floats]]:
    """Return energy and force as functions of a strain, continued by a spring."""
    from scipy.interpolate import CubicHermiteSpline

    curve = CubicHermiteSpline(*np.concatenate([np.zeros((3, 1)), states], axis=1))
    last, _, force = states[:, -1]
    slope = max(float(curve(last, 2)), 0.0)

    def evaluate(strain: Floats) -> tuple[Floats, Floats]:
        near = np.minimum(strain, last)
        d = strain - near
        return curve(near) + (force + slope / 2 * d) * d, curve(near, 1) + slope * d

    return evaluate


def _taut_stiffness(yarns: Sequence[Yarn], width: float, mechanics: RodMechanics) -> float:
    """Compute the stiffness of all yarns side by side on a width [N/m]."""
    return float(mechanics.tension.max()) * len(yarns) / width


class CellLaw(StretchLaw):
    """Law of a membrane from a strained cell of yarns."""

    kind = "cell"

    # `values` are those of a `CellTable`; `constants` its scale and stiffness beyond, and the shear
    # stiffness G [N/m].
    def __init__(self, values: Floats, constants: Floats) -> None:
        from scipy.interpolate import CubicSpline

        self.arrays = {"values": values, "constants": constants}
        self._scale, self._beyond, self._shear = np.ravel(constants).tolist()
        rows, rays = values.shape
        along = CubicSpline(np.linspace(0.0, 1.0, rows), values).c[::-1]
        both = self._round(along)
        #: (4 of φ, 4 of t, cells), lowest power first.
        self._table = np.moveaxis(both, 1, 3).reshape(4, 4, -1)
        self._rows, self._rays = rows - 1, rays

    @staticmethod
    def _round(along: Floats) -> Floats:
        """Compute coefficients of φ for those of t, (4, rows, rays), lowest power first."""
        from scipy.interpolate import CubicSpline

        closed = np.concatenate([along, along[..., :1]], axis=2)
        angles = np.linspace(0.0, 2 * np.pi, closed.shape[2])
        return np.asarray(CubicSpline(angles, closed, axis=2, bc_type="periodic").c[::-1])

    def with_shear(self, stiffness: float) -> CellLaw:
        """Return the law with another shear stiffness G.

        Parameters
        ----------
        stiffness : float
            G: force per width over the angle [N/m].

        Returns
        -------
        CellLaw
            The law itself if it has this stiffness.
        """
        if stiffness == self._shear:
            return self
        return type(self)(
            self.arrays["values"], np.array([self._scale, self._beyond, stiffness], np.float64)
        )

    def respond(self, first: Floats, second: Floats, sine: Floats) -> StretchResponse:
        """Compute the energy and its derivatives."""
        x, y = first - 1.0, second - 1.0
        radius, angle = np.hypot(x, y), np.arctan2(y, x) % (2 * np.pi)
        cosine, rise = np.cos(angle), np.sin(angle)
        inside = np.minimum(radius, _REACH)
        p, p_r, p_rr, p_f, p_ff, p_rf, p_rff = self._evaluate(inside, angle)
        # g = r² p, and its derivatives over powers of r, without a division by r
        r = inside
        g_r = r * (2 * p + r * p_r)
        grown = self._scale * np.exp(r * r * p)
        energy = grown - self._scale
        out = radius - inside
        by_r, by_f = grown * g_r, grown * r * p_f
        rr = grown * (g_r * g_r + 2 * p + r * (4 * p_r + r * p_rr))
        ff = grown * (r * r * p_f * p_f + 2 * p + r * p_r + p_ff)
        rf = grown * (g_r * r * p_f + p_f + r * p_rf)
        if (far := np.flatnonzero(out > 0.0)).size:
            # a spring goes on along the ray: F = W + W_r d + K d²/2 at the reach r = 1
            d, size = out[far], radius[far]
            p, p_r, p_f, p_ff, p_rf, p_rff = (
                each[far] for each in (p, p_r, p_f, p_ff, p_rf, p_rff)
            )
            w, slope = grown[far], 2 * p + p_r
            turn, bend = 2 * p_f + p_rf, 2 * p_ff + p_rff
            a_f, a_ff = w * p_f, w * (p_f * p_f + p_ff)
            b, b_f = w * slope, w * (p_f * slope + turn)
            b_ff = w * (p_f * p_f * slope + 2 * p_f * turn + p_ff * slope + bend)
            energy[far] += (b + 0.5 * self._beyond * d) * d
            by_r[far] = b + self._beyond * d
            by_f[far] = (a_f + b_f * d) / size
            rr[far] = self._beyond
            ff[far] = (a_ff + b_ff * d) / size**2 + by_r[far] / size
            rf[far] = b_f / size - (a_f + b_f * d) / size**2
        turned, slope, bend = shear_angle(sine)
        energy += 0.5 * self._shear * turned * turned
        zero = np.zeros_like(energy)
        c, s = cosine, rise
        return StretchResponse(
            energy,
            np.stack([by_r * c - by_f * s, by_r * s + by_f * c, self._shear * turned * slope]),
            np.stack(
                [
                    rr * c * c - 2 * rf * c * s + ff * s * s,
                    rr * s * s + 2 * rf * c * s + ff * c * c,
                    self._shear * (slope * slope + turned * bend),
                    (rr - ff) * c * s + rf * (c * c - s * s),
                    zero,
                    zero.copy(),
                ]
            ),
        )

    def _evaluate(self, r: Floats, angle: Floats) -> list[Floats]:
        """Compute p = q t²/r² and its derivatives by r, rr, φ, φφ, rφ and rφφ."""
        width, height = 2 * np.pi / self._rays, 1.0 / self._rows
        column = np.minimum((angle / width).astype(np.int64), self._rays - 1)
        t = _graded(r)
        row = np.minimum((t / height).astype(np.int64), self._rows - 1)
        cell = row * self._rays + column
        x, y = angle - column * width, t - row * height
        by_angle = [_cubic([self._table[k, m].take(cell) for k in range(4)], x) for m in range(4)]
        value, turned, bent = (_cubic([part[n] for part in by_angle], y) for n in range(3))
        # dt/dr, and its own derivative
        slope = 1.0 / (_SPAN * np.hypot(r, _FINE))
        bend = -slope * r / (r * r + _FINE**2)
        ratio, ratio_r, ratio_rr = _squared_ratio(r)
        q, q_r = value[0], value[1] * slope
        q_rr = value[2] * slope**2 + value[1] * bend
        return [
            q * ratio,
            q_r * ratio + q * ratio_r,
            q_rr * ratio + 2 * q_r * ratio_r + q * ratio_rr,
            turned[0] * ratio,
            bent[0] * ratio,
            turned[1] * slope * ratio + turned[0] * ratio_r,
            bent[1] * slope * ratio + bent[0] * ratio_r,
        ]


class SetCellLaw(CellLaw):
    """Law of a membrane from a strained cell of set yarns."""

    kind = "set cell"

    @staticmethod
    def _round(along: Floats) -> Floats:
        """Compute coefficients of φ by Akima's spline, which does not swing."""
        from scipy.interpolate import Akima1DInterpolator

        closed = np.concatenate([along[..., -_ROUND:], along, along[..., : _ROUND + 1]], axis=2)
        angles = 2 * np.pi / along.shape[2] * np.arange(-_ROUND, along.shape[2] + _ROUND + 1)
        return np.asarray(Akima1DInterpolator(angles, closed, axis=2).c[::-1, _ROUND:-_ROUND])


def _squared_ratio(r: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute (t/r)² and its two derivatives, smooth at zero."""
    x = r / _FINE
    safe = np.maximum(x, _SERIES)
    s = np.arcsinh(safe) / safe
    d = (1.0 / np.hypot(1.0, safe) - s) / safe
    dd = (-safe / np.hypot(1.0, safe) ** 3 - 2.0 * d) / safe
    near, x2 = x < _SERIES, x * x
    s = np.where(near, 1.0 - x2 / 6.0, s)
    d = np.where(near, -x / 3.0 + 0.3 * x * x2, d)
    dd = np.where(near, -1.0 / 3.0 + 0.9 * x2, dd)
    unit = (_SPAN * _FINE) ** 2
    return s * s / unit, 2 * s * d / (unit * _FINE), 2 * (d * d + s * dd) / (unit * _FINE**2)


def _graded(radius: Floats) -> Floats:
    return np.asarray(np.arcsinh(radius / _FINE) / _SPAN)


def _radius(graded: Floats) -> Floats:
    return np.asarray(_FINE * np.sinh(graded * _SPAN))


def _cubic(powers: list[Floats], x: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute cubics and their two derivatives from four coefficients, lowest power first."""
    c0, c1, c2, c3 = powers
    three = 3.0 * c3 * x
    return ((c3 * x + c2) * x + c1) * x + c0, (three + 2.0 * c2) * x + c1, 2.0 * (three + c2)


def _march(
    yarns: Sequence[Yarn],
    cell: Floats,
    mechanics: RodMechanics,
    way: Floats,
    area: float,
    limit: float,
    rest: float,
) -> Floats:
    """Strain a cell step by step, and return radius, energy and force per area, (3, n)."""
    first, least = (_FIRST, 0.0) if mechanics.set_in is None else (_FIRST_SET, _LEAST_SET)
    change = np.append(way, 0.0)
    radii, states = [0.0], [_strain_cell(yarns, cell, mechanics, change, 0.0, 0.0)]
    while radii[-1] < _REACH - 1e-9:
        radius = radii[-1]
        radius += min(max(first, _GROWTH * radius), _WIDEST, _REACH - radius)
        ratio = (1.0 + radius * change) / (1.0 + radii[-1] * change)
        if ratio.min() < 0.5 or (1.0 + radius * change).min() < least:
            break
        try:
            state = _strain_cell(states[-1].yarns, cell, mechanics, change, radii[-1], radius)
        except SolverError:
            if len(states) < 5:
                raise
            break
        radii.append(radius)
        states.append(state)
        if _pull(state, cell, change) > limit * area:
            break
    _go_back(radii, states, cell, mechanics, change)
    energies = np.array([state.state.energy for state in states]) - rest
    pulls = np.array([_pull(state, cell, change) for state in states])
    found = np.stack([radii, energies / area, pulls / area])[:, 1:]
    return found[:, found[2] > 0.0]  # others are in the middle of a snap


def _strain_cell(
    yarns: Sequence[Yarn],
    cell: Floats,
    mechanics: RodMechanics,
    change: Floats,
    before: float,
    after: float,
) -> Relaxed:
    """Relax yarns of a cell that was strained by one radius at another one."""
    ratio = (1.0 + after * change) / (1.0 + before * change)
    moved = [yarn._replace(points=yarn.points * ratio) for yarn in yarns]
    held = np.zeros((2, 3), dtype=bool)
    return relax_yarns(moved, cell * (1.0 + after * change), mechanics, held, stages=[_STAGE])


def _pull(state: Relaxed, cell: Floats, change: Floats) -> float:
    """Compute the derivative of the energy of a strained cell by the radius."""
    return float((state.state.gradient[-2:] * cell * change).sum())


def _go_back(
    radii: Sequence[float],
    states: list[Relaxed],
    cell: Floats,
    mechanics: RodMechanics,
    change: Floats,
) -> None:
    """Replace states before a snap by those that its end leads back to, if their energy is less."""

    # Yarns that are pressed snap into another shape later than it has less energy. Then the energy
    # grows by less than either of the pulls says, or a pull is negative.
    def relax_back(k: int) -> Relaxed:
        return _strain_cell(states[k + 1].yarns, cell, mechanics, change, radii[k + 1], radii[k])

    def has_snapped(k: int) -> bool:
        grown = states[k + 1].state.energy - states[k].state.energy
        pull = min(_pull(state, cell, change) for state in states[k : k + 2])
        return pull < 0.0 or grown < _SNAP * pull * (radii[k + 1] - radii[k])

    for k in range(len(states) - 2, 0, -1):
        if has_snapped(k):
            with suppress(SolverError):
                back = relax_back(k)
                if back.state.energy < states[k].state.energy:
                    states[k] = back


def _fit_ray(radii: Floats, states: Floats, stiffness: float, scale: float) -> Floats:
    """Compute q at radii from the states of a ray; `stiffness` is that at rest along it."""
    from scipy.interpolate import CubicHermiteSpline

    radius, energy, force = states
    start = [_LINEAR, 0.5 * stiffness * _LINEAR**2, stiffness * _LINEAR]
    radius, energy, force = np.concatenate([[[0.0], [0.0], [0.0]], np.c_[start], states], axis=1)
    energy = np.maximum(energy, 0.0)
    grown = np.log1p(energy / scale)
    curve = CubicHermiteSpline(radius, grown, force / (energy + scale))
    last = float(radius[-1])
    values = curve(np.minimum(radii, last))
    beyond = radii > last
    steep = max(float(np.diff(force)[-1] / np.diff(radius)[-1]), stiffness)
    d = radii[beyond] - last
    values[beyond] = np.log1p((energy[-1] + (force[-1] + 0.5 * steep * d) * d) / scale)
    values[1:] /= _graded(radii[1:]) ** 2
    values[0] = 0.5 * stiffness / scale * (_SPAN * _FINE) ** 2
    return np.asarray(values)
