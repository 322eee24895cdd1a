"""Residual vectors: the part of a static response that a few modes leave out.

A load causes a static displacement K⁻¹f. The kept modes represent Σ φ φᵀf/λ of it. The rest, made
M-orthogonal to the modes, is one more shape: the residual vector of the load. With it the static
response is exact for any number of modes. Source: Abaqus Theory Manual 2.5.5 and Benchmarks
Manual 1.4.14; the method is also known as modal truncation augmentation.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from spacemap_vtk import cancel
from spacemap_vtk.ndarrays import Bools, Floats

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

    from spacemap_vtk.mechanics.elements.elasticity import Assembly


#: A residual below this share of the static response, in the energy norm, is rounding.
NEGLIGIBLE = 1e-11


def residual_modes(
    shapes: Floats,
    eigenvalues: Floats,
    stiffness: csr_matrix,
    mass: csr_matrix,
    loads: Floats,
    statics: Floats,
) -> tuple[Floats, Floats]:
    """Compute shapes that make the static response to the loads exact."""
    from scipy import linalg as la  # this import costs a tenth of a second

    elastic = eigenvalues > 0.0
    kept, values = shapes[elastic], eigenvalues[elastic]
    inertia, springs = (mass @ shapes.T).T, (stiffness @ kept.T).T / values[:, None]
    found: list[Floats] = []
    forces: list[Floats] = []
    for load, static in zip(loads.T, statics.T, strict=True):
        cancel.check()
        size = float(np.sqrt(max(static @ load, 0.0)))
        rest = static - ((kept @ load) / values) @ kept
        # Twice, because once leaves rounding if little of the response is new. For exact modes M-
        # and K-orthogonality are equivalent; for computed ones only K-orthogonality makes the
        # static response exact.
        for _ in range(2):
            rest = rest - (inertia @ rest) @ shapes
            rest = rest - (springs @ rest) @ kept
            for vector, force in zip(found, forces, strict=True):
                rest = rest - (force @ rest) * vector
        force = stiffness @ rest
        left = float(np.sqrt(max(rest @ force, 0.0)))
        if left > NEGLIGIBLE * size:
            found.append(rest / left)
            forces.append(force / left)
    if not found:
        return np.empty(0), np.empty((0, shapes.shape[1]))
    basis = np.stack(found)
    # K is the unit matrix in this basis, so the eigenvalues of M are 1 / λ.
    inverse, turn = la.eigh(basis @ (mass @ basis.T))
    order = np.argsort(-inverse)
    scale = 1.0 / np.sqrt(inverse[order])
    return scale**2, (turn[:, order] * scale).T @ basis


def movable_mass(assembly: Assembly, density: float, lumped: bool, free: Bools) -> Floats:
    """Compute the mass that a uniform acceleration along each axis can set in motion."""
    # It is the sum of the effective masses of all modes: bᵀ M⁻¹ b over the free components, where
    # b = M r are the inertia forces. With a consistent mass matrix it is less than the total mass
    # by the part that the supports carry.
    # M is the same along each axis and does not couple them, so one row per vertex is enough, and
    # its products need no scipy.
    count = len(assembly.lumps)
    rows = np.repeat(np.arange(count), np.diff(assembly.indptr))
    own = rows == assembly.indices
    consistent = np.bincount(rows[own], assembly.products[own], count)
    diagonal = np.asarray(assembly.lumps if lumped else consistent, np.float64)

    def inertia(moves: Floats, x: Floats) -> Floats:
        if lumped:
            return diagonal * x
        return np.bincount(rows, assembly.products * x[assembly.indices], count) * moves

    found = []
    for axis in range(3):
        moves = free[axis::3].astype(np.float64)
        load = inertia(moves, np.ones(count)) * moves
        found.append(inverse_mass_products(partial(inertia, moves), diagonal, load[:, None])[0])
    return density * np.array(found)


def inverse_mass_products(
    inertia: Callable[[Floats], Floats], diagonal: Floats, loads: Floats
) -> Floats:
    """Compute bᵀ M⁻¹ b for each column b of (N, m) loads, from products with M and its diagonal."""
    result = np.zeros(loads.shape[1])
    for column, right in enumerate(loads.T):
        cancel.check()
        # Conjugate gradients, preconditioned with M's diagonal, need a few dozen steps on any mesh:
        # the condition of a consistent mass matrix scaled like this does not grow with its size.
        x, r = np.zeros_like(right), right.copy()
        z = r / diagonal
        p, rho = z.copy(), float(r @ z)
        enough = 1e-28 * rho
        for _ in range(200):
            if rho <= enough:
                break
            q = inertia(p)
            step = rho / float(p @ q)
            x += step * p
            r -= step * q
            z = r / diagonal
            rho, before = float(r @ z), rho
            p = z + (rho / before) * p
        result[column] = float(right @ x)
    return result


def participation(shapes: Floats, nodal_mass: Floats) -> Floats:
    """Compute the participation of each mode in a uniform acceleration along each axis."""
    modes = shapes.reshape(len(shapes), -1, 3)
    return np.einsum("nvc,v->nc", modes, nodal_mass)
