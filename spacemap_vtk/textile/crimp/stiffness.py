"""Stiffness of a cloth from the stiffness of its yarns and their geometry.

Nothing is fitted. The membrane stiffness is the second derivative of the energy of crimp
interchange (`spacemap_vtk.textile.crimp.interchange`) at the onset of tension in all yarns, with h1
and D free. For the rest, a yarn is a rod along its whole length l with one rigidity B about every
axis, including torsion, like a bundle of fibres that slide on each other:

- Bending: a moment M turns a yarn by M l / B over the spacings P that it crosses. So yarns p apart
  resist with B P / (p l). Friction at crossings, which adds to that, is neglected. It can at most
  hold the arcs of a yarn around those that it crosses, so that only the straight rest bends: B P /
  (p (l - sum of D theta)). The two are bounds (`bending_bounds`); `YarnMechanics.rigid_arcs`
  chooses the upper one.
- Twist: such a rod turns equally about any axis. So D66 is a quarter of the sum of both families'
  B P / (p l), and a square cloth bends equally in all directions.
- Shear: between two crossings that grip it, a yarn is a beam whose ends keep their directions. A
  transverse force V tilts it by V l^3 / (12 B P), and the angles of warp and weft add up. A yarn is
  gripped where it changes side, not within a float. The twist of the contacts acts in series with
  the beams: yarns that are pressed together by N resist it with k = 2 (1 - ν) N R = N D/2 (Hertz's
  contact of crossed cylinders of radius R = D/4, with ν = 0; the modulus cancels), and the cloth
  shears by p1 p2/k. N is the contact force of yarns that would be straight if free: 12 B h/l^3 for
  each change of side next to a crossing. A twill has half the changes of plain cloth, so half the
  grip.

Limits of shear: crossings do not slip. Yarns with set crimp press less than N, so their cloth is
softer. All values hold for an endless cloth of repeats, whatever part of it is drawn.

Sources: R. G. Livesey, J. D. Owen, "Cloth Stiffness and Hysteresis in Bending", J. Textile Inst. 55
(1964) T516, for bending without friction; G. A. V. Leaf, A. M. F. Sheta, "The Initial Shear Modulus
of Plain-woven Fabrics", J. Textile Inst. 75 (1984) 157, for the beams that shear bends; K. L.
Johnson, "Contact Mechanics" (Cambridge 1985), for a contact's size (Hertz) and its twist.
"""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.mechanics.elements.plates import Plate
from spacemap_vtk.textile.crimp.interchange import Interchange, YarnMechanics
from spacemap_vtk.textile.drafts import drawdown
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.peirce import solve

#: Least straight share of a yarn; with less, it is jammed up to rounding.
_JAMMED = 1e-6


def cloth_stiffness(cloth: Cloth, yarns: YarnMechanics) -> Plate:
    """Compute the stiffness of a cloth from its yarns.

    Parameters
    ----------
    cloth : Cloth
        At rest: any weave, diameters, spacings and sections.
    yarns : YarnMechanics
        EA [N] and B [N m²] of its yarns, and the stiffness of crossings.

    Returns
    -------
    Plate
        Along weft (1) and warp (2). If yarns or spacings differ, it is the mean over crossings with
        equal stretch. Bending in one direction causes no moment in the other (D12 = 0).

    Raises
    ------
    GeometryError
        There is no room for the yarns at rest.
    InputError
        The yarns do not stretch, or have no stiffness in bending or contact (a stable sheet needs
        all of them), or there is no second yarn to cross.

    Examples
    --------
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.25e-3, spacing=0.5e-3)
    >>> cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads)
    >>> plate = cloth_stiffness(cloth, YarnMechanics((90, 90), np.inf, (2e-9, 2e-9)))
    >>> round(float(plate.bending[0, 0] * 1e6), 3)  # 2e-9 N m² over 0.5 mm, less by the crimp
    3.498
    """
    if min(cloth.size) < 2:
        raise InputError(
            "the stiffness of a cloth of {} x {} yarns is not defined".format(*cloth.size),
            allowed="at least 2 ends and 2 picks",
        )
    for key, values, why, cure in (
        (
            "tension",
            yarns.tension,
            "inextensible yarns make a sheet infinitely stiff",
            "Let the yarns stretch (inextensible = false), and give a tension or a modulus",
        ),
        (
            "bending",
            yarns.bending,
            "the stiffness of a sheet depends on the bending of its yarns",
            "Give the bending rigidity of a yarn",
        ),
        (
            "contact",
            yarns.contact if yarns.flattest < 1.0 and isfinite(yarns.contact) else 1.0,
            "crossings without contact stiffness do not resist biaxial tension",
            "Give contact, or flattest = 1 for hard crossings",
        ),
    ):
        if not (np.isfinite(values) & (np.asarray(values) > 0.0)).all():
            raise InputError(why, key=key, allowed="more than 0 and finite", cure=cure)
    crossings = Interchange(cloth, yarns)
    rest = np.ones((2, *crossings.shape))
    membrane, bending = np.zeros((3, 3)), np.zeros(3)
    stretched = crossings.forces(rest).tangent.sum(axis=(2, 3)) / crossings.cell.sum()
    membrane[:2, :2] = stretched[::-1, ::-1]
    lean = pressed = 0.0
    for k, family in enumerate(cloth.families):
        rods = _mean_yarn(cloth, k)
        bent = _require_straight(rods.rigid, k) if yarns.rigid_arcs else rods.bending
        bending[1 - k] = bent * yarns.bending[k] / family.spacing
        lean += family.spacing / (rods.shear * yarns.bending[k])
        pressed += rods.pressure * yarns.bending[k] / 2.0
    if not pressed > 0.0:
        raise InputError(
            "the yarns do not interlace",
            key="drawdown",
            cure="Use a drawdown in which yarns change sides",
        )
    spacings = [family.spacing for family in cloth.families]
    lean += spacings[0] * spacings[1] / (pressed * cloth.diameter_sum / 2.0)
    membrane[2, 2] = 1.0 / lean
    bending[2] = bending[:2].sum() / 4.0
    return Plate(membrane, np.diag(bending))


class BendingBounds(NamedTuple):
    """Bounds of a cloth's bending rigidity along warp and weft [N m]."""

    free: tuple[float, float]
    """Yarns bend along their whole length."""
    rigid: tuple[float, float]
    """The arcs around crossed yarns do not bend; infinite for yarns without a straight part."""


def bending_bounds(cloth: Cloth, yarns: YarnMechanics) -> BendingBounds:
    """Compute the bounds of a cloth's bending rigidity without friction and with sticking arcs.

    Parameters
    ----------
    cloth : Cloth
        At rest.
    yarns : YarnMechanics
        B [N m²] of its yarns.

    Returns
    -------
    BendingBounds
        The rigidity of cloth whose yarns are not set lies between them.

    Examples
    --------
    >>> from spacemap_vtk.textile.weave.threads import Threads
    >>> threads = Threads(diameter=0.25e-3, spacing=0.5e-3)
    >>> cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads)
    >>> found = bending_bounds(cloth, YarnMechanics(bending=(2e-9, 2e-9)))
    >>> round(found.free[0] * 1e6, 2), round(found.rigid[0] * 1e6, 2)
    (3.5, 8.0)
    """
    free, rigid = np.empty(2), np.empty(2)
    for k, family in enumerate(cloth.families):
        rods = _mean_yarn(cloth, k)
        free[k], rigid[k] = np.array([rods.bending, rods.rigid]) * yarns.bending[k] / family.spacing
    return BendingBounds((float(free[0]), float(free[1])), (float(rigid[0]), float(rigid[1])))


def _require_straight(rigid: float, number: int) -> float:
    if isfinite(rigid):
        return rigid
    raise InputError(
        f"the {('warp', 'weft')[number]} has no straight part between its arcs, which are rigid",
        key="bending_arcs",
        value="rigid",
        cure='Set bending_arcs = "free", or give bending_rigidity in [modal]',
    )


class _MeanYarn(NamedTuple):
    """Stiffness of a family's mean yarn for a bending rigidity B of 1."""

    bending: float
    """Contribution to the bending stiffness of the cloth."""
    rigid: float
    """The same if arcs do not bend; infinite without straight parts."""
    shear: float
    """Shear stiffness as beams between crossings that grip it [1/m²]."""
    pressure: float
    """Mean pressure on a crossing [1/m²]."""


def _mean_yarn(cloth: Cloth, number: int) -> _MeanYarn:
    """Compute the response of a family's mean yarn along whole repeats, continued periodically."""
    crossed, repeats = cloth.yarns[1 - number], drawdown.repeat_size(cloth.drawdown)
    count, width = (
        size - size % each
        for size, each in (
            (cloth.size[number], repeats[number]),
            (cloth.size[1 - number], repeats[1 - number]),
        )
    )
    # After the last crossing comes the first one again.
    spacing = np.append(crossed.spacing[: width - 1], crossed.spacing.mean())
    flat = crossed.flat[:width]
    across = float(spacing.sum())
    flats = 0.5 * (flat + np.roll(flat, -1))
    bending = rigid = sheared = pressure = 0.0
    for some in cloth.yarn_blocks(number, count):
        upper = cloth.is_over(number, some)[:, :width]
        arc, height, _ = cloth.crossing_profile(number, some)
        arc, height = arc[:, :width], height[:, :width]
        rise = np.abs(np.roll(height, -1, axis=1) - height)
        arcs = arc + np.roll(arc, -1, axis=1)
        gap = solve(spacing - flats, rise, arcs)
        length = gap.length + flats
        changes = upper != np.roll(upper, -1, axis=1)
        # A crossing within a float does not grip, so one beam lies between two that do. Gaps before
        # the first gripping crossing belong to the last beam.
        gripped = changes | np.roll(changes, 1, axis=1)
        beam = np.cumsum(gripped, axis=1)
        beam = np.where(beam == 0, beam[:, -1:], beam)
        beam += (width + 1) * np.arange(len(beam))[:, None]
        beams = np.bincount(beam.ravel(), length.ravel(), len(beam) * (width + 1))
        cubes = (beams.reshape(len(beam), -1) ** 3).sum(axis=1)
        bending += float((across / length.sum(axis=1)).sum())
        straight = (length - arcs * gap.theta).sum(axis=1)
        jammed = straight <= _JAMMED * length.sum(axis=1)
        rigid += float(np.where(jammed, np.inf, across / np.where(jammed, 1.0, straight)).sum())
        sheared += float((12.0 * across / cubes).sum())
        # Each change of side presses the crossings at both of its ends.
        pressure += float((2.0 * changes * 12.0 * rise / length**3).mean(axis=1).sum())
    return _MeanYarn(bending / count, rigid / count, sheared / count, pressure / count)
