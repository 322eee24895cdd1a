"""Drape as by Cusick's drapemeter: a round cloth hangs over a round disc.

The cloth, 30 cm across, is held between two horizontal discs of 18 cm, and its ring outside of them
falls into folds. Its shadow, that of the discs included, has the area A_d, and

    DC = (A_d - A_18) / (A_30 - A_18)

is the drape coefficient. The folds are counted as nodes: maxima of the radius of the cloth's edge,
seen from above.

The lower disc carries the cloth and the upper one keeps it flat, so that the ring is clamped where
it leaves the discs: it is a sheet on a polar lattice. Cloth that only lies on one disc lifts off
behind its edge, and drapes otherwise. The discs are thin: folds may hang below them.

A cloth can drape in several ways, and does so in the laboratory. Here it starts flat, and with each
of some numbers of waves, in cells that are four times as wide as the last ones, then twice; the
state of least energy is then found in the last cells, and the three give an estimate of the error.
The membrane has the law of the yarns, if the cloth has one; from the flat start, Newton's method
needs the state of a linear membrane first. This one has the stiffness of strips with free sides, as
yarns of a hanging cloth exchange crimp.

Sources: G. E. Cusick, "The measurement of fabric drape", J. Textile Inst. 59 (1968) T253; ISO
9073-9.
"""

from __future__ import annotations

from functools import partial
from math import pi
from typing import NamedTuple

import numpy as np

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import SolverError
from spacemap_vtk.laboratory.fabric import Fabric
from spacemap_vtk.laboratory.records import (
    DEGREE,
    MILLIMETRE,
    PERCENT,
    PURE,
    Axis,
    Curve,
    Measurement,
    Reading,
    States,
)
from spacemap_vtk.mechanics.contact.resting import Resting, find_resting_state
from spacemap_vtk.mechanics.contact.surfaces import Surface, turned_surface
from spacemap_vtk.mechanics.elements.plates import Plate, strip_stiffness
from spacemap_vtk.mechanics.equilibrium.drape import drape_coefficient, shadow_area
from spacemap_vtk.mechanics.modal.convergence import estimate_error
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.ndarrays import Floats, Ints, Progress
from spacemap_vtk.units import GRAVITY

#: Radii of the cloth and of the disc [m].
CLOTH, DISC = 0.15, 0.09
#: Cells round the ring and outwards. In narrower ones Newton's method with the law of yarns may not
#: end.
CELLS = (128, 16)
#: Numbers of waves with which cloth starts; 0 is flat.
_WAVES = (0, 4, 5, 6, 7, 8, 9)
#: Slope of a start with waves, its amplitude, and the distance from the discs where it is complete.
_SLOPE, _WAVE, _RUN_IN = 0.45, 0.3, 0.015
#: Waves begin at this angle [rad], so that they have no symmetry of the yarns.
_FIRST_WAVE = 0.3
#: Drape coefficients of states that differ.
_DIFFERENT = 5e-3
#: Least height of a fold that is counted as a node [m].
_NODE = 1e-3
#: Shares of the weight in the states of a film; below the first one a cotton is nearly flat.
_SHARES = np.linspace(0.25, 1.0, 13) ** 3
#: Radius of the hole in the middle of the polar lattice, and height of a disc [m], in a film.
_HOLE, _HEIGHT = 1e-3, 4e-3
#: Parts of the side of a cell that are drawn.
_DRAWN = 4


class Ring(NamedTuple):
    """Polar lattice of one layer up to the edge of the cloth."""

    points: Floats
    """(V, 3), the lower, then the upper vertices; round the ring, then outwards [m]."""
    cells: Ints
    """(T, 4)."""
    around: int
    """Number of cells round the ring."""
    outwards: int
    """Number of cells from the inner to the outer edge."""

    def grid(self, values: Floats) -> Floats:
        """Arrange values of the vertices, (V, 3), as (2, outwards + 1, around, 3)."""
        return values.reshape(2, self.outwards + 1, self.around, 3)

    @property
    def triangles(self) -> Ints:
        """Triangles of the mid-surface, (n, 3)."""
        number = np.arange((self.outwards + 1) * self.around).reshape(-1, self.around)
        a, d = number[:-1], number[1:]
        b, c = np.roll(a, -1, axis=1), np.roll(d, -1, axis=1)
        return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


class Drape(NamedTuple):
    """A state of equilibrium."""

    ring: Ring
    moved: Floats
    """(V, 3), displacement [m]."""
    energy: float
    """Of strain and weight [J]."""

    @property
    def coefficient(self) -> float:
        """Drape coefficient."""
        return find_coefficient(self.ring, self.moved)

    @property
    def nodes(self) -> int:
        """Number of folds."""
        return count_nodes(outline(self.ring, self.moved)[:-1, 1])


def measure(fabric: Fabric, progress: Progress) -> Measurement:
    """Let a round cloth hang over a round disc."""
    fabric.require_areal_mass()
    around, outwards = CELLS
    rings = [build_ring(fabric.thickness, around // n, outwards // n) for n in (4, 2)]
    found = find_drapes(fabric, rings, partial(_report_part, progress, 0.0, 0.7))
    first, second = min(found, key=lambda states: states[-1].energy)
    guess = refine_ring(second.ring, second.moved)
    report = partial(_report_part, progress, 0.7, 1.0)
    last = hang(fabric, build_ring(fabric.thickness, *CELLS), guess, report)
    error = estimate_error(
        last.coefficient,
        second.coefficient,
        2.0,
        coarsest=first.coefficient,
        same_state=last.nodes == second.nodes,
    )
    readings = [
        Reading("DC", "drape coefficient", "", last.coefficient, PERCENT, error.error),
        Reading("nodes", "folds", "", float(last.nodes), PURE),
    ]
    angle, radius = outline(last.ring, last.moved).T
    return Measurement(
        readings,
        [Curve("edge of the cloth", angle, radius)],
        Axis("angle from the weft", DEGREE),
        Axis("radius of the shadow", MILLIMETRE),
        [
            _describe_others([states[-1] for states in found], second),
            *(["the membrane is linear"] if fabric.plate.law is None else []),
            *([] if error.converged else ["the drape coefficient still depends on the cells"]),
        ],
        find_states=partial(descend, fabric, second),
    )


def _describe_others(found: list[Drape], chosen: Drape) -> str:
    """Describe the states in which the cloth could drape, too."""
    nodes, values = zip(*((state.nodes, state.coefficient) for state in found), strict=True)
    if max(abs(np.subtract(values, chosen.coefficient))) < _DIFFERENT:
        return "all starts led to the same drape coefficient"
    return (
        f"this is the state of least energy that was found; others have {min(nodes)} to "
        f"{max(nodes)} nodes, and drape coefficients of {min(values):.1%} to {max(values):.1%}"
    )


def find_drapes(fabric: Fabric, rings: list[Ring], progress: Progress) -> list[list[Drape]]:
    """Find states from a flat start and from waves; each in all rings, the widest cells first."""
    found: list[list[Drape]] = []
    for number, waves in enumerate(_WAVES):
        report = partial(_report_part, progress, number / len(_WAVES), (number + 1) / len(_WAVES))
        guess = wave(rings[0], waves) if waves else None
        states = []
        try:
            for ring in rings:
                states.append(hang(fabric, ring, guess, report))
                guess = refine_ring(ring, states[-1].moved)
        except SolverError:
            if not found:  # from the flat start at least
                raise
            continue
        found.append(states)
    return found


def wave(ring: Ring, count: int) -> Floats:
    """Guess a displacement with a number of folds."""
    beyond = np.linalg.norm(ring.points[:, :2], axis=1) - DISC
    angle = np.arctan2(ring.points[:, 1], ring.points[:, 0])
    guess = np.zeros_like(ring.points)
    guess[:, 2] = -beyond * (_SLOPE + _WAVE * np.cos(count * angle + _FIRST_WAVE))
    guess[:, 2] *= np.minimum(beyond / _RUN_IN, 1.0)
    return guess


def build_ring(thickness: float, around: int, outwards: int, inside: int = 0) -> Ring:
    """Build a ring from the discs outwards, and some cells inside; `around` must be even."""
    count = inside + outwards
    flat, cells = build_lattice((0, 1, 0, count, -0.5, 0.5), (around, count, 1))
    # The last column of vertices is the first one.
    number = np.arange(2 * (count + 1) * around).reshape(2, count + 1, around)
    wrapped = np.concatenate([number, number[..., :1]], axis=2).ravel()
    share = flat.reshape(2, count + 1, around + 1, 3)[:, :, :-1].reshape(-1, 3)
    radii = np.linspace(DISC, CLOTH, outwards + 1)
    if inside:
        radii = np.concatenate([np.linspace(_HOLE, DISC, inside + 1)[:-1], radii])
    angle, radius = 2 * pi * share[:, 0], radii[np.round(share[:, 1]).astype(int)]
    # Angles run clockwise, so that the cells are oriented as those of the lattice.
    places = [radius * np.sin(angle), radius * np.cos(angle), thickness * share[:, 2]]
    return Ring(np.stack(places, axis=1), wrapped[cells], around, count)


def refine_ring(ring: Ring, moved: Floats) -> Floats:
    """Interpolate a displacement for a ring of cells half as wide, by cubic splines."""
    from scipy.interpolate import make_interp_spline

    grid = ring.grid(moved)
    grid = np.concatenate([grid, grid[:, :, :1]], axis=2)
    places = np.arange(ring.around + 1.0)
    around = make_interp_spline(places, grid, k=3, axis=2, bc_type="periodic")
    grid = around(np.arange(0, ring.around, 0.5))
    outwards = make_interp_spline(np.arange(ring.outwards + 1.0), grid, k=3, axis=1)
    found: Floats = outwards(np.arange(2 * ring.outwards + 1) / 2).reshape(-1, 3)
    return found


def count_nodes(radius: Floats) -> int:
    """Count the maxima of a radius round the disc [m]."""
    from scipy.signal import find_peaks

    count = len(radius)
    peaks, _ = find_peaks(np.tile(radius, 3), prominence=_NODE)
    return int(((peaks >= count) & (peaks < 2 * count)).sum())


def hang(
    fabric: Fabric, ring: Ring, guess: Floats | None, progress: Progress, share: float = 1.0
) -> Drape:
    """Find the state of a ring under a share of its weight; by default from a flat start."""
    if fabric.plate.law is not None and guess is not None:
        try:
            return _hang_plate(fabric, fabric.plate, ring, guess, progress, share)
        except SolverError:
            pass  # the guess is too far away
    warp, weft = strip_stiffness(fabric.plate.membrane)
    shear = float(fabric.plate.membrane[2, 2])
    linear = Plate(np.diag([weft, warp, shear]), fabric.plate.bending)
    found = _hang_plate(fabric, linear, ring, guess, progress, share)
    if fabric.plate.law is None:
        return found
    return _hang_plate(fabric, fabric.plate, ring, found.moved, progress, share)


def _hang_plate(
    fabric: Fabric,
    plate: Plate,
    ring: Ring,
    guess: Floats | None,
    progress: Progress,
    share: float,
) -> Drape:
    """Find the state of a ring with a given stiffness."""
    held = np.zeros(ring.points.shape, dtype=bool)
    ring.grid(held)[:, 0] = True
    density = fabric.require_areal_mass() / fabric.thickness
    model = Model(ring.points, ring.cells, plate, density, held)
    weight = np.zeros_like(ring.points)
    weight[:, 2] = -share * GRAVITY * model.nodal_mass

    start = None if guess is None else Resting(guess, np.empty((0, 3)))
    moved = find_resting_state(model, weight.ravel(), progress, start).displacement
    surface = model.pencil.surface
    assert surface is not None
    nodal = surface.to_nodes(ring.points + moved)
    strain = model.modulus * sum(term.energy(nodal) for term in model.pencil.terms)
    return Drape(ring, moved, strain - float(np.vdot(weight, moved)))


def _report_part(progress: Progress, before: float, after: float, share: float) -> None:
    """Report the progress of a part of the work."""
    progress(before + share * (after - before))


def outline(ring: Ring, moved: Floats) -> Floats:
    """Compute angle and radius of the edge, seen from above, (around + 1, 2); it is closed."""
    edge = ring.grid(ring.points + moved)[:, -1, :, :2].mean(axis=0)
    angle = np.arctan2(*edge.T[::-1]) % (2 * pi)
    line = np.stack([angle, np.linalg.norm(edge, axis=1)], axis=1)[angle.argsort()]
    return np.concatenate([line, line[:1] + np.array([2 * pi, 0.0])])


def find_coefficient(ring: Ring, moved: Floats) -> float:
    """Compute the drape coefficient, with the discs and the flat cloth as in the lattice."""
    middle = ring.grid(ring.points + moved).mean(axis=0).reshape(-1, 3)
    # Folds may reach below the discs, whose shadow counts once: triangles join the held row.
    fan = np.arange(1, ring.around - 1)
    disc = np.stack([np.zeros_like(fan), fan, fan + 1], axis=1)
    cast = shadow_area(middle, np.concatenate([ring.triangles, disc]), [0, 0, -1])
    # Areas of polygons with as many corners as the lattice.
    polygon = ring.around / 2 * np.sin(2 * pi / ring.around)
    return drape_coefficient(cast, polygon * CLOTH**2, polygon * DISC**2)


def descend(fabric: Fabric, last: Drape, progress: Progress) -> States:
    """Find the states of a ring as its weight grows, the last of which is given."""
    # From the last state back, so that they are those of its folds.
    ring, found, shares = last.ring, [last.moved], [1.0]
    for number, share in enumerate(_SHARES[-2::-1]):
        try:
            found.append(hang(fabric, ring, found[-1], lambda _: None, share).moved)
        except SolverError:
            break  # folds do not open steadily: the film begins with what is left of them
        shares.append(float(share))
        progress((number + 1) / len(_SHARES))
    found.append(np.zeros_like(last.moved))
    shares.append(0.0)
    found, shares = found[::-1], shares[::-1]
    inside = ring.outwards
    whole = build_ring(fabric.thickness, ring.around, ring.outwards, inside)
    displacements = np.zeros((len(found), *whole.points.shape))
    for each, state in zip(displacements, found, strict=True):
        whole.grid(each)[:, inside:] = ring.grid(state)
    return States(
        whole.points,
        whole.cells,
        displacements,
        np.zeros((len(found), 2)),
        surface=_draw_flat(whole),
        fixtures=_discs(fabric.thickness),
        lines=np.array([outline(ring, state) for state in found]),
        captions=[f"{share:.0%} of the weight" for share in shares],
    )


def _draw_flat(ring: Ring) -> Surface:
    """Make the surface of the flat cloth, with several points in each cell."""
    grid = ring.grid(ring.points).mean(axis=0)
    grid = _subdivide(_subdivide(np.concatenate([grid, grid[:, :1]], axis=1)).swapaxes(0, 1))
    number = np.arange(grid[..., 0].size).reshape(grid.shape[:2])
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    triangles = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    points = grid.reshape(-1, 3)
    return Surface(points, np.tile([0.0, 0.0, 1.0], (len(points), 1)), triangles)


def _subdivide(grid: Floats) -> Floats:
    """Interpolate between the rows of a grid."""
    places = np.arange((len(grid) - 1) * _DRAWN + 1) / _DRAWN
    before = np.minimum(places.astype(int), len(grid) - 2)
    share = (places - before)[:, None, None]
    return np.asarray((1.0 - share) * grid[before] + share * grid[before + 1])


def _discs(thickness: float) -> list[Surface]:
    """Make the surfaces of both discs."""
    disc = turned_surface(DISC, _HEIGHT, _HEIGHT / 4)
    rise = np.array([0.0, 0.0, (thickness + _HEIGHT) / 2])
    return [disc._replace(points=disc.points + side * rise) for side in (-1.0, 1.0)]
