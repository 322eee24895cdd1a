"""From yarns to cloth: what a cloth resists, of the rigidities of its yarns and their geometry.

Nothing is fitted. Stretch in the plane is the second derivative of the energy of crimp interchange
(`spacemap_vtk.fabric.interchange`), h1 and D following freely, where all yarns begin to be pulled.
For the rest a yarn is a rod along all of its length l, of one rigidity B about every axis, torsion
too, as a bundle of fibres is that slide on each other:

- bending: a moment M turns a yarn by M l / B over the spacings P that it crosses, so that yarns p
  apart resist with B P / (p l). Friction at crossings, which adds to that, is left out;
- twist: such a rod turns as much about any axis, so that D66 is a quarter of the sum of both
  families' B P / (p l), and a square cloth bends alike in all directions;
- shear: crossings that are gripped turn as one. Between two of them a yarn is a beam whose ends
  keep their directions: it leans by V l^3 / (12 B P) under a force V across it, and the angles of
  warp and weft add up. A yarn is gripped where it changes side, not within a float.

Sources: R. G. Livesey, J. D. Owen, "Cloth Stiffness and Hysteresis in Bending", J. Textile Inst. 55
(1964) T516, for bending without friction; G. A. V. Leaf, A. M. F. Sheta, "The Initial Shear Modulus
of Plain-woven Fabrics", J. Textile Inst. 75 (1984) 157, for the beams that shear bends.
"""

from __future__ import annotations

from math import isfinite

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.fabric.interchange import Interchange, YarnMechanics
from spacemap_vtk.fabric.peirce import solve
from spacemap_vtk.mechanics.plates import Plate, stiff_across


def cloth_stiffness(cloth: Cloth, yarns: YarnMechanics) -> Plate:
    """Return what a cloth resists, by its yarns alone.

    Parameters
    ----------
    cloth : Cloth
        At rest: any weave, diameters, spacings and sections.
    yarns : YarnMechanics
        EA [N] of its yarns, B [N m²], and what crossings resist.

    Returns
    -------
    Plate
        Along weft (1) and warp (2). Of yarns or spacings that differ it is the mean over crossings
        that are all stretched alike; bending one way does nothing along the other (D12 = 0).

    Raises
    ------
    GeometryError
        There is no room for the yarns at rest.
    InputError
        The yarns do not stretch, or resist no bending or contact: a sheet needs all to be stable;
        or there is no second yarn to cross.

    Examples
    --------
    >>> from spacemap_vtk.fabric.threads import Threads
    >>> threads = Threads(diameter=0.25e-3, spacing=0.5e-3)
    >>> cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads)
    >>> plate = cloth_stiffness(cloth, YarnMechanics((90, 90), np.inf, (2e-9, 2e-9)))
    >>> round(float(plate.bending[0, 0] * 1e6), 3)  # 2e-9 N m² over 0.5 mm, less by the crimp
    3.498
    """
    if min(cloth.size) < 2:
        raise InputError(
            "a cloth of {} x {} yarns has no stiffness of its own".format(*cloth.size),
            allowed="at least two ends and two picks",
        )
    for key, values, why, cure in (
        (
            "tension",
            yarns.tension,
            "yarns that do not stretch resist a pull both ways without end",
            "Let the yarns stretch (inextensible = false), and give a tension or a modulus",
        ),
        (
            "bending",
            yarns.bending,
            "cloth that exchanges crimp resists by the bending of its yarns",
            "Give the bending rigidity of a yarn",
        ),
        (
            "contact",
            yarns.contact if yarns.flattest < 1.0 and isfinite(yarns.contact) else 1.0,
            "crossings that flatten for nothing resist no pull both ways",
            "Give it, or flattest = 1 for hard crossings",
        ),
    ):
        if not (np.isfinite(values) & (np.asarray(values) > 0.0)).all():
            raise InputError(
                f"no sheet without it: {why}", key=key, allowed="more than 0, and finite", cure=cure
            )
    crossings = Interchange(cloth, yarns)
    rest = np.ones((2, *crossings.shape))
    membrane, bending = np.zeros((3, 3)), np.zeros(3)
    stretched = crossings.forces(rest).tangent.sum(axis=(2, 3)) / crossings.cell.sum()
    membrane[:2, :2] = stretched[::-1, ::-1]
    lean = 0.0
    for k, family in enumerate(cloth.families):
        bent, sheared = np.array(_rods(cloth, k)) * yarns.bending[k] / family.spacing
        bending[1 - k] = bent
        lean += 1.0 / sheared
    membrane[2, 2] = 1.0 / lean
    bending[2] = bending[:2].sum() / 4.0
    return stiff_across(Plate(membrane, np.diag(bending), np.eye(2), 1.0))


def _rods(cloth: Cloth, number: int) -> tuple[float, float]:
    """Return what a family's mean yarn resists where B is 1: that its cloth bends, and leans."""
    crossed = cloth.yarns[1 - number]
    spacing = crossed.spacing
    across = float(spacing.sum())
    flats = 0.5 * (crossed.flat[1:] + crossed.flat[:-1])
    bending = sheared = 0.0
    count = cloth.size[number]
    for some in cloth.in_blocks(number, count):
        upper = cloth.upper(number, some)
        arc, height, _ = cloth.passing(number, some)
        rise = np.abs(np.diff(height, axis=1))
        length = solve(spacing - flats, rise, arc[:, 1:] + arc[:, :-1]).length + flats
        # A crossing within a float grips nothing: what lies between two that do is one beam.
        changes = upper[:, 1:] != upper[:, :-1]
        gripped = np.zeros(upper.shape, dtype=bool)
        gripped[:, 0] = True
        gripped[:, 1:] |= changes
        gripped[:, 1:-1] |= changes[:, 1:]
        beam = np.cumsum(gripped[:, :-1].ravel()) - 1
        beams = np.bincount(beam, length.ravel())
        yarn = np.arange(len(length)).repeat(length.shape[1])[np.flatnonzero(gripped[:, :-1])]
        cubes = np.bincount(yarn, beams**3)
        bending += float((across / length.sum(axis=1)).sum())
        sheared += float((12.0 * across / cubes).sum())
    return bending / count, sheared / count
