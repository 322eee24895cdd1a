"""Slow flow of a fluid through a periodic cell between solid yarns.

Velocities lie on the faces of the voxels and pressures in their middles (Harlow and Welch 1965).
Where the wall lies between two velocities, the outer one feels the resistance with which a linear
profile vanishes at the wall (Gibou et al., J. Comput. Phys. 176 (2002) 205). The unknowns are the
forces at the walls; velocities follow from them by Fourier transforms.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from spacemap_vtk.errors import SolverError
from spacemap_vtk.ndarrays import Floats

#: Share of solid at a wall.
_WALL = 0.5
#: Least distance of a velocity from the wall, in voxels.
_NEAREST = 1e-4
_MOST_STEPS = 2000


def permeability(
    solid: Floats,
    spacing: Floats,
    tolerance: float = 1e-4,
    report_progress: Callable[[float], object] | None = None,
) -> Floats:
    """Compute the permeability of a periodic cell.

    Parameters
    ----------
    solid : ndarray, shape (nz, ny, nx)
        Share of solid of each voxel, which is impermeable.
    spacing : ndarray, shape (3,)
        Size of a voxel [m].
    tolerance : float
        Residual of the velocity at the walls over the mean velocity.
    report_progress : callable, optional
        Called with the share of directions that are solved.

    Returns
    -------
    ndarray, shape (3, 3)
        Permeability K [m²]: the mean velocity is −K ∇p over the viscosity.

    Raises
    ------
    SolverError
        If a direction does not converge.
    """
    axes = (2, 1, 0)
    shape = solid.shape
    shares = [(solid + np.roll(solid, 1, axis=axis)) / 2 for axis in axes]
    outside = np.stack(shares) < _WALL
    slip = np.stack([_slip(share, spacing) for share in shares])
    walls = np.flatnonzero(np.isfinite(slip.ravel()))
    give = slip.ravel()[walls]
    # Symbols of the differences between neighbours, and of minus the Laplacian.
    symbols = []
    for axis, size in zip(axes, spacing, strict=True):
        count = shape[axis]
        waves = scipy.fft.rfftfreq(count) if axis == 2 else scipy.fft.fftfreq(count)
        symbol = (1 - np.exp(-2j * np.pi * waves)) / size
        symbols.append(symbol.reshape([-1 if k == axis else 1 for k in range(3)]))
    laplacian = sum(abs(symbol) ** 2 for symbol in symbols)
    laplacian.ravel()[0] = 1.0
    inverse = 1 / laplacian
    inverse.ravel()[0] = 0.0

    def flow(force: Floats) -> Floats:
        """Return the velocities from the forces at walls, without their mean."""
        field = np.zeros((3, *shape))
        field.reshape(-1)[walls] = force
        spectrum = [scipy.fft.rfftn(part) for part in field]
        pressure = inverse * sum(
            np.conj(symbol) * part for symbol, part in zip(symbols, spectrum, strict=True)
        )
        moved = [
            scipy.fft.irfftn(inverse * (part - symbol * pressure), shape)
            for symbol, part in zip(symbols, spectrum, strict=True)
        ]
        return np.stack(moved)

    def respond(force: Floats) -> Floats:
        velocity: Floats = flow(force).ravel()[walls] + give * force
        return velocity

    # Mean velocities outside the yarns, and pressure gradients, of three loads. Nothing holds the
    # fluid inside the walls of a yarn, where it flows by itself.
    fluxes, gradients = np.empty((3, 3)), np.empty((3, 3))
    owner = walls // solid.size
    # Velocity at a wall from the force there, which preconditions the equations.
    own = give + 2 / 3 * float(inverse.mean())
    for way in range(3):
        target = (owner == way).astype(np.float64)
        force = _conjugate_gradients(respond, own, target, tolerance)
        gradients[:, way] = np.bincount(owner, force, 3) / solid.size
        velocity = -flow(force)
        velocity[way] += 1.0
        fluxes[:, way] = (velocity * outside).mean(axis=(1, 2, 3))
        if report_progress is not None:
            report_progress((way + 1) / 3)
    found = fluxes @ np.linalg.inv(gradients)
    return (found + found.T) / 2


def _slip(share: NDArray[Any], spacing: Floats) -> Floats:
    """Velocity over force at walls [m²]: almost 0 in the solid, infinite in the fluid."""
    inside = share >= _WALL
    resistance = np.zeros(share.shape)
    surface = np.zeros(share.shape, bool)
    for axis, size in zip((2, 1, 0), spacing, strict=True):
        for step in (1, -1):
            other = np.roll(share, step, axis=axis)
            wall = ~inside & (other >= _WALL)
            surface |= inside & (other < _WALL)
            distance = (_WALL - share[wall]) / (other[wall] - share[wall])
            resistance[wall] += (1 / np.maximum(distance, _NEAREST) - 1) / size**2
    slip = np.full(share.shape, np.inf)
    slip[resistance > 0] = 1 / resistance[resistance > 0]
    # A wall that lets nothing through would leave pressures inside yarns undetermined.
    slip[surface] = _NEAREST * spacing.min() ** 2
    return slip


def _conjugate_gradients(
    respond: Callable[[Floats], Floats], own: Floats, target: Floats, tolerance: float
) -> Floats:
    """Solve for the forces that give target velocities."""
    force = np.zeros_like(target)
    residual, end = target.copy(), tolerance**2 * (target @ (target / own))
    along = residual / own
    square = residual @ along
    for _ in range(_MOST_STEPS):
        moved = respond(along)
        step = square / (along @ moved)
        force += step * along
        residual -= step * moved
        scaled = residual / own
        before, square = square, residual @ scaled
        if square < end:
            return force
        along = scaled + square / before * along
    raise SolverError(
        f"the flow did not converge in {_MOST_STEPS} steps", cure="Use another number of voxels."
    )
