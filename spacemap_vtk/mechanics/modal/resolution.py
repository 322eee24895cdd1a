"""How well the cells of a sheet resolve its vibration modes, and its folds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from spacemap_vtk.cage.lattice import TETRAHEDRA_PER_CELL
from spacemap_vtk.mechanics.elements.elasticity import VOIGT
from spacemap_vtk.mechanics.modal.model import Model
from spacemap_vtk.mechanics.modal.sheet_cells import BENDING
from spacemap_vtk.ndarrays import Bools, Floats, Ints

#: As `BENDING`, for modes that stretch the sheet or that tension stiffens (bilinear elements).
STRETCHING = 1 / 24
#: Estimated error of a mode's frequency above which the mode is reported as unresolved.
UNRESOLVED = 0.1
#: A hanging sheet can fold if compression folds at least this share of its area.
_FOLDING = 0.05
#: A compression below this share of the sheet's forces (root mean square) folds nothing: a sheet
#: that hangs flat has it near the ends of its supports.
_SLIGHT = 0.02


def mode_errors(model: Model, eigenvalues: Floats, shapes: Floats) -> Iterator[float]:
    """Estimate by what share the frequencies of a sheet's modes are too high.

    Parameters
    ----------
    model : Model
        Model of a sheet; the modes of solids are not estimated.
    eigenvalues : ndarray of float64, shape (n,)
        Eigenvalues λ of the modes [1/s²].
    shapes : ndarray of float64, shape (n, 3V)
        Mass-normalised mode shapes [1/√kg].

    Yields
    ------
    float
        Error of each mode in turn; 0 for rigid modes, and for the modes of solids.

    Notes
    -----
    A wave with numbers kx and ky along the cells has an error of (kx⁴ cx² + ky⁴ cy²)/(kx² + ky²)
    times `BENDING` or `STRETCHING`, weighted by the share of bending in the mode's energy. k⁴ is
    the mean square of the sheet's curvature, or of second differences of the displacement; k² is
    that of first differences. Waves shorter than four cells have larger errors than estimated.
    """
    surface = model.pencil.surface
    if surface is None:
        yield from [0.0] * len(eigenvalues)
        return
    count = len(surface.pairs)
    rest = surface.to_nodes(model.points)[:count]
    lines = [_Lines(surface.quads, turn, rest) for turn in (0, 1)]
    sheet = model.pencil.elements[0]
    gradients = sheet.strains_and_gradients(model.pencil.nodes.positions)[1]
    places = math.prod(gradients.shape[:2]) / len(surface.quads)
    for eigenvalue, shape in zip(eigenvalues, shapes, strict=True):
        moved = surface.to_nodes(shape.reshape(-1, 3))
        slopes, waves = np.sum([line.differences(moved[:count]) for line in lines], axis=0)
        if not (eigenvalue > 0 and slopes > 0):
            yield 0.0
            continue
        strain = sheet.strain_changes(gradients, moved)
        bent = np.where(np.arange(strain.shape[2]) // 3 == 1, strain, 0.0)
        energy = model.modulus * float(np.vdot(bent, sheet.stresses(bent)))
        share = min(energy / eigenvalue, 1.0)
        curved = sum(
            float((strain[..., 3 + axis] ** 2).sum()) * line.width**2 / places
            for axis, line in enumerate(lines)
        )
        yield (share * BENDING * curved + (1 - share) * STRETCHING * float(waves)) / float(slopes)


def fold_error(model: Model, bending_length: float) -> float:
    """Estimate the relative error that the cells of a hanging sheet cause where it folds.

    Parameters
    ----------
    model : Model
        Model of a sheet in equilibrium.
    bending_length : float
        Smaller bending length c of the sheet under its load [m].

    Returns
    -------
    float
        `BENDING` (h/c)² for cells of width h across the folds, at most 1, as folds are about as
        wide as a wave of wave number 1/c; 0 if the sheet is not compressed so that it would fold.

    Notes
    -----
    Wide cells cannot show the narrow folds that cloth would have: two solutions without them may
    agree, and both be wrong. They are recognised by compression, which folds would have released: a
    force per width above D (π/2h)², where a wave of four cells buckles.
    """
    surface, plate = model.pencil.surface, model.plate
    if surface is None or plate is None or model.displacement is None:
        return 0.0
    stress = model.strain_and_stress(np.zeros_like(model.points))[1][::TETRAHEDRA_PER_CELL]
    force = stress * surface.thickness(model.points)[surface.quads].mean(axis=1)[:, None]
    one, two = (axis for axis in range(3) if axis != surface.normal)
    x, y, shear = force[:, one], force[:, two], force[:, VOIGT[one, two]]
    mean, radius = (x + y) / 2, np.hypot((x - y) / 2, shear)
    least, size = mean - radius, math.sqrt(2 * np.mean(mean**2 + radius**2))
    # Width of the cells along the direction of the least force.
    angle = np.arctan2(2 * shear, x - y) / 2 + math.pi / 2
    rest = surface.to_nodes(model.points)[: len(surface.pairs)]
    widths = {line.axis: line.width for line in (_Lines(surface.quads, k, rest) for k in (0, 1))}
    width = np.abs(np.cos(angle)) * widths[one] + np.abs(np.sin(angle)) * widths[two]
    rigidity = math.sqrt(plate.bending[0, 0] * plate.bending[1, 1])
    buckling = rigidity * (math.pi / (2 * width)) ** 2
    folds = least < -np.maximum(buckling, _SLIGHT * size)
    if folds.mean() < _FOLDING:
        return 0.0
    return min(BENDING * (float(width[folds].mean()) / bending_length) ** 2, 1.0)


def describe_unresolved_modes(errors: Sequence[float]) -> str:
    """Describe the unresolved modes in a clause; empty if all are resolved.

    Parameters
    ----------
    errors : sequence of float
        Error of each mode, as `mode_errors` estimates it.

    Returns
    -------
    str
        For example "modes 7 to 20 are not resolved by the cage's cells: …", without a full stop.
    """
    large = {number: error for number, error in enumerate(errors, 1) if error > UNRESOLVED}
    if not large:
        return ""
    first, last = min(large), max(large)
    which = f"mode {first} is" if first == last else f"modes {first} to {last} are"
    if len(large) <= last - first:
        which = f"{len(large)} of the modes {first} to {last} are"
    return (
        f"{which} not resolved by the cage's cells: frequencies are at least about "
        f"{min(large.values()):.0%} too high"
    )


class _Lines:
    """Lines along a sheet's cells in one of their two directions."""

    def __init__(self, quads: Ints, turn: int, rest: Floats) -> None:
        corners = np.roll(quads, -turn, axis=1)
        edges = np.concatenate([corners[:, [0, 1]], corners[:, [3, 2]]])
        #: (n, 2) Ends of each edge, along the line.
        self._edges = np.unique(edges, axis=0)
        first, last = self._edges.T
        #: Mean length of the edges [m].
        self.width = float(np.linalg.norm(rest[last] - rest[first], axis=1).mean())
        #: Axis along which the lines run.
        self.axis = int(np.abs(rest[last] - rest[first]).sum(axis=0).argmax())
        #: Whether each node has a neighbour on both sides.
        self._inner: Bools = np.bincount(self._edges.ravel(), minlength=len(rest)) == 2

    def differences(self, moved: Floats) -> tuple[float, float]:
        """Sum the squares of first differences, and of second ones, both over the width²."""
        first, last = self._edges.T
        step = moved[last] - moved[first]
        second = np.zeros_like(moved)
        np.add.at(second, first, step)
        np.subtract.at(second, last, step)
        square = self.width**2
        return float((step**2).sum()) / square, float((second[self._inner] ** 2).sum()) / square
