"""The law of a woven sheet's membrane: the energy of its yarns when they exchange crimp.

    W(e) = W_c(lambda_warp, lambda_weft) + G gamma²/2 + psi(lambda, gamma)

**Tension.** W_c is the energy of crimp interchange per area
(`spacemap_vtk.textile.crimp.interchange`), the mean over the crossings at equal stretch. Yarns pull
as soon as they are taut; slack yarns have only their bending, whose resistance is smaller than that
of taut ones by a factor of a hundred to a thousand. It is what keeps the tangent of a slack sheet
positive, together with the sheet's bending stiffness. Where the yarns are jammed, the law
continues with a spring as stiff as taut yarns.

**Shear.** G is the stiffness of `spacemap_vtk.textile.crimp.stiffness`. The yarns of a family k, of
width w and spacing p, come nearer to each other as the cloth is sheared, and touch at cos gamma =
w/(p lambda). Beyond that angle they press on each other with

    psi = sum over k of l_k/(p1 p2) K x_k³/3,    x_k = max(0, w_k - p_k lambda cos gamma)/w_k,

where l_k is the length of yarn in a cell of p1 times p2, and K a yarn's stiffness EA: so hard that
yarns overlap by one or two percent of their width under the loads of cloth, and soft enough for
Newton's method.

**Table.** W_c has a kink in its tangent where the yarns become taut. This happens on a line in the
plane of the stretches, along which cloth exchanges crimp almost without force, so that it must not
be smeared. The table has one axis across this line, with knots that are closest to each other at
it: W_c is a bicubic spline of

    a = (lambda_warp - lambda_weft)/2,    b = (lambda_warp + lambda_weft)/2 - 1 - beta(a),

with beta(a) the line where yarns that do not stretch become taut. The spline is convex where the
energy is (`spacemap_vtk.textile.crimp.graded_spline`). It is C2, and its derivatives are exact.
The curvature of beta jumps where a yarn becomes straight, and with it that of W_c along a, by
dW/db times as much: there the forces of a satin of 8 are wrong by up to 3 % of the larger one.
What rounding off the kink adds to the stress at rest, of the order of 0.1 mN/m, is taken away.
Cloth with many kinds of crossings, as of unequal yarns or floats, is represented by twelve of them,
chosen by their forces; `YarnLaw.kinds_error` is what this changes.

Sources: the balance of tensions in W_c is that of S. Kawabata, M. Niwa, H.
Kawai, "The Finite-deformation Theory of Plain-weave Fabrics", J. Textile Inst. 64 (1973) 21; I. J.
Schoenberg, "On Spline Functions", in Inequalities (1967), for the table.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from spacemap_vtk.mechanics.elements.membrane_law import (
    StretchLaw,
    StretchResponse,
    shear_angle,
    shear_cosine,
)
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.crimp.graded_spline import GradedKnots
from spacemap_vtk.textile.crimp.interchange import Interchange, YarnMechanics
from spacemap_vtk.textile.crimp.stiffness import cloth_stiffness
from spacemap_vtk.textile.weave.cloth import Cloth

#: Knots of beta(a), which is smooth but for corners at jams and where a yarn is straight.
_LINE = GradedKnots(0.6, 0.05, 0.08, 0.015)
#: Knots of the energy along a and b. Cloth under its own weight is strained by some 1e-5.
_ALONG = GradedKnots(0.6, 1e-5, 0.1, 0.015)
_ACROSS = GradedKnots(0.6, 2e-8, 0.2, 0.015)
#: Bisection steps that find the line of taut yarns.
_BISECTIONS = 40
#: Overlap beyond a jam at which its stiffness is complete.
_JAM_TOE = 0.02
#: Overlap of neighbours beyond which their stiffness grows no more, as a share of their width.
_FIRM = 0.1

#: Number of kinds of crossings that are distinguished. Each takes 0.15 s, and a dobby crepe has 12.
_KINDS = 12
#: Tables of the last cloths, and their number.
_recent: dict[str, tuple[Floats, Floats]] = {}
_KEPT = 4


class Locking(NamedTuple):
    """Neighbours of one family that press on each other in shear."""

    width: float
    """Width of a yarn [m]."""
    spacing: float
    """Distance between yarns at rest [m]."""
    stiffness: float
    """K l/(p1 p2) [N/m]."""


class YarnLaw(StretchLaw):
    """Law of a membrane from its yarns: of crimp interchange, shear G [N/m], and locking."""

    kind = "yarns"
    #: Largest difference of the forces from those of all kinds of crossings, as a share of them.
    kinds_error = 0.0

    # `energy` and `line` make the table of tension; rows of `locking` are those of warp and weft.
    def __init__(self, energy: Floats, line: Floats, shear: Floats, locking: Floats) -> None:
        self._table = TensionTable(energy, line)
        self.arrays = {
            "energy": energy,
            "line": line,
            "shear": np.reshape(shear, 1),
            "locking": locking,
        }
        self._shear = float(np.reshape(shear, 1)[0])
        self._locking = [Locking(*row) for row in np.reshape(locking, (2, 3)).tolist()]

    def with_shear(self, stiffness: float) -> YarnLaw:
        """Return the law with another shear stiffness G.

        Parameters
        ----------
        stiffness : float
            G: force per width over the angle [N/m].

        Returns
        -------
        YarnLaw
            The law itself if it has this stiffness.
        """
        if stiffness == self._shear:
            return self
        changed = YarnLaw(**{**self.arrays, "shear": np.array([stiffness])})
        changed.kinds_error = self.kinds_error
        return changed

    def respond(self, first: Floats, second: Floats, sine: Floats) -> StretchResponse:
        """Compute the energy and its derivatives; axis 1 is the weft."""
        energy, (f2, f1), (h22, h11, h12) = self._table.evaluate(second, first)
        angle, slope, bend = shear_angle(sine)
        energy += 0.5 * self._shear * angle * angle
        f3 = self._shear * angle * slope
        h33 = self._shear * (slope * slope + angle * bend)
        zero = np.zeros_like(energy)
        forces, seconds = [f1, f2, f3], [h11, h22, h33, h12, zero, zero.copy()]
        cosine, fall, drop = shear_cosine(sine)
        # The warp's neighbours lie along axis 1.
        for axis, (lock, stretch) in enumerate(zip(self._locking, (first, second), strict=True)):
            share = lock.spacing / lock.width
            closed = 1.0 - share * stretch * cosine
            where = np.flatnonzero(closed > 0.0)
            if not len(where):
                continue
            x, c, dc, ddc = (each[where] for each in (closed, cosine, fall, drop))
            firm = np.minimum(x, _FIRM)
            push = lock.stiffness * firm * (2.0 * x - firm)
            steep = 2.0 * lock.stiffness * firm
            by = -share * c
            turn = -share * stretch[where] * dc
            energy[where] += lock.stiffness * firm * ((x - firm) * x + firm * firm / 3.0)
            forces[axis][where] += push * by
            forces[2][where] += push * turn
            seconds[axis][where] += steep * by * by
            seconds[2][where] += steep * turn * turn - push * share * stretch[where] * ddc
            seconds[4 + axis][where] += steep * by * turn - push * share * dc
        return StretchResponse(energy, np.stack(forces), np.stack(seconds))


def cloth_law(cloth: Cloth, yarns: YarnMechanics) -> YarnLaw:
    """Compute the law of a cloth's membrane from its yarns.

    Parameters
    ----------
    cloth : Cloth
        At rest: any weave, diameters, spacings and sections.
    yarns : YarnMechanics
        EA [N] and B [N m²] of its yarns, and the stiffness of crossings.

    Returns
    -------
    YarnLaw
        Axis 1 is the weft, axis 2 the warp.

    Raises
    ------
    GeometryError
        There is no room for the yarns at rest.
    InputError
        For the same reasons as `spacemap_vtk.textile.crimp.stiffness.cloth_stiffness`.

    Examples
    --------
    A cloth is held at its width and pulled by one percent along the warp:

    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.167e-3, spacing=0.4e-3)
    >>> cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads)
    >>> law = cloth_law(cloth, YarnMechanics((60.0, 60.0), 9.0, (1e-9, 1e-9)))
    >>> round(float(law.stress(np.array([0.0, 0.5 * (1.01**2 - 1.0), 0.0]))[1] * 1.01), -1)
    350.0
    """
    plate = cloth_stiffness(cloth, yarns)
    taut = float(np.diag(plate.membrane)[:2].max())
    crossings = Interchange(cloth, yarns).with_fewer_kinds(_KINDS)
    if crossings.digest not in _recent:
        line = _LINE.interpolate(
            _taut_line(Interchange(cloth).with_kinds_of(crossings), _LINE.places)
        )
        if len(_recent) == _KEPT:
            _recent.pop(next(iter(_recent)))
        _recent[crossings.digest] = _tabulate_energy(crossings, line, taut), line
    energy, line = _recent[crossings.digest]
    area = cloth.families[0].spacing * cloth.families[1].spacing
    locking = []
    for number, family in enumerate(cloth.families):
        stiffness = float(np.mean(np.asarray(yarns.tension)[number]))
        length = float(family.crossed * (1.0 + family.crimp.crimp))
        width = min(family.width, family.spacing)
        locking.append(Locking(width, family.spacing, stiffness * length / area))
    law = YarnLaw(energy, line, plate.membrane[2:, 2], np.array(locking))
    law.kinds_error = crossings.kinds_error
    return law


class TensionTable:
    """Energy of crimp interchange over the stretches, as a spline."""

    # `energy`, (m, n), are its coefficients along a and b [J/m²]; `line`, (k,), those of beta.
    def __init__(self, energy: Floats, line: Floats) -> None:
        rows = _ACROSS.cubics(_ALONG.cubics(energy), axis=2)
        #: (4 of a, 4 of b, cells).
        self._table = np.moveaxis(rows, 0, 1).reshape(4, 4, -1)
        self._columns = rows.shape[-1]
        self._line = _LINE.cubics(line)
        #: Energy and stress at rest, which are rounded off the kink and taken away.
        self._at_rest, self._energy_at_rest = np.zeros(2), 0.0
        value, force, _ = self.evaluate(np.ones(1), np.ones(1))
        self._at_rest, self._energy_at_rest = force[:, 0], float(value[0])

    def evaluate(self, warp: Floats, weft: Floats) -> tuple[Floats, Floats, Floats]:
        """Compute energy (n,), its derivatives by warp and weft (2, n), and second ones (3, n)."""
        # The second derivatives are by warp twice, weft twice, and both.
        a, s = 0.5 * (warp - weft), 0.5 * (warp + weft) - 1.0
        k, z = _LINE.find_cells(a)
        line, slope, bend = _cubic(self._line.take(k, axis=1), z)
        i, x = _ALONG.find_cells(a)
        j, y = _ACROSS.find_cells(s - line)
        cell = i * self._columns + j
        # Values and two derivatives by b of the four coefficients in a.
        parts = [_cubic([each.take(cell) for each in row], y) for row in self._table]
        value, by_a, by_aa = _cubic([part[0] for part in parts], x)
        by_b, by_ab, _ = _cubic([part[1] for part in parts], x)
        by_bb = _cubic([part[2] for part in parts], x)[0]
        f_a = by_a - by_b * slope
        h_ab = by_ab - slope * by_bb
        h_aa = by_aa - slope * (by_ab + h_ab) - by_b * bend
        rest = self._at_rest
        value = value - rest[0] * (warp - 1.0) - rest[1] * (weft - 1.0) - self._energy_at_rest
        force = 0.5 * np.stack([by_b + f_a, by_b - f_a]) - rest[:, None]
        mean = by_bb + h_aa
        curve = 0.25 * np.stack([mean + 2.0 * h_ab, mean - 2.0 * h_ab, by_bb - h_aa])
        return value, force, curve


def _tabulate_energy(crossings: Interchange, line: Floats, taut: float) -> Floats:
    """Compute the coefficients of the energy; `taut` is the stiffness of jams [N/m]."""
    a = _ALONG.places
    k, z = _LINE.find_cells(a)
    along = _cubic(_LINE.cubics(line).take(k, axis=1), z)[0][:, None]
    along = along + _ACROSS.places
    stretch = 1.0 + np.stack([along + a[:, None], along - a[:, None]])
    energy = _energy_beyond_jams(crossings, stretch.reshape(2, -1), taut).reshape(along.shape)
    return _ACROSS.coefficients(_ALONG.coefficients(energy), axis=1)


def _cubic(powers: Floats | list[Floats], x: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute cubics and their two derivatives from four coefficients, lowest power first."""
    c0, c1, c2, c3 = powers
    three = 3.0 * c3 * x
    return ((c3 * x + c2) * x + c1) * x + c0, (three + 2.0 * c2) * x + c1, 2.0 * (three + c2)


def _taut_line(crossings: Interchange, a: Floats) -> Floats:
    """Find beta(a), where the yarns become taut."""
    low, high = np.full(len(a), -2.0), np.full(len(a), 2.0)
    straight = np.array(crossings.straight_stretch)
    side = np.stack([a, -a])
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        stretch = 1.0 + middle + side
        slack = (crossings.resultants(np.maximum(stretch, 0.1)).slack > 1e-9).any(axis=0)
        loose = slack & (stretch < straight[:, None]).all(axis=0)
        low, high = np.where(loose, middle, low), np.where(loose, high, middle)
    return high


def _energy_beyond_jams(crossings: Interchange, stretch: Floats, taut: float) -> Floats:
    """Compute energies, continued beyond jams with a spring of a given stiffness."""
    least = np.ones(2)
    for _ in range(20):  # the stretches at which both yarns are jammed
        found = crossings.reach_stretch([[0.1, least[0]], [least[1], 0.1]])
        least = np.array([found[0, 0], found[1, 1]])
    reached = np.maximum(stretch, least[:, None])
    jam = np.stack(
        [
            crossings.reach_stretch([np.full_like(reached[0], 0.1), reached[1]])[0],
            crossings.reach_stretch([reached[0], np.full_like(reached[0], 0.1)])[1],
        ]
    )
    kept = np.maximum(stretch, jam)
    energy = crossings.energy(kept)
    beyond = kept - stretch
    where = np.flatnonzero((beyond > 0.0).any(axis=0))
    force = crossings.resultants(kept[:, where]).force
    x = beyond[:, where]
    spring = np.where(
        x < _JAM_TOE,
        x**3 / (6.0 * _JAM_TOE),
        0.5 * x * (x - _JAM_TOE) + _JAM_TOE**2 / 6.0,
    )
    energy[where] += (taut * spring - force * x).sum(axis=0)
    return energy
