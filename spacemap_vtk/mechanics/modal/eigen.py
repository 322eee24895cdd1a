"""Vibration modes: K s = λ M s, equations (14) and (15) of Furukawa et al., for the lowest λ.

Small problems are solved densely, large ones by `spacemap_vtk.mechanics.linalg.lanczos`. Components
of a mesh that no element connects vibrate independently and are solved separately: any number of
equal components then gives as many equal eigenvalues.
"""

from __future__ import annotations

import importlib.util
import math
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy import linalg as la

from spacemap_vtk import cancel
from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.mechanics.linalg import blas_threads
from spacemap_vtk.mechanics.linalg.lanczos import lowest_modes
from spacemap_vtk.mechanics.linalg.multifrontal import count_negative_eigenvalues
from spacemap_vtk.mechanics.modal.pencil import Pencil
from spacemap_vtk.ndarrays import Bools, Floats, Progress

#: Up to this size the dense solver is not slower.
DENSE = 600

#: Number of modes that are solved for beyond those requested, so that the last requested mode is
#: followed by a gap: if one mode of a free body is requested, five more are rigid.
SPARE = 7

#: Positions within the gap at which modes are counted. If a mode is missing, the modes are computed
#: again from another start, and counted at another position, as pivots may have been poor at the
#: last one.
_SHARES = (0.5, 0.3, 0.6)

#: Largest residual ‖Kφ - λMφ‖ / ‖Kφ‖ of a mode.
RESIDUAL = 1e-6

#: Rounding error of Kφ, as a share of ‖|K| |φ|‖.
NOISE = 1e-13

#: Rounding error of φᵀKφ, as a share of |φ|ᵀ |K| |φ|. A mode with less energy is rigid, if only K
#: is known.
RIGID = 1e-14

#: Below this share, φᵀKφ has lost too many digits, and strains are used instead if they are known.
DOUBTFUL = 1e-10

#: Share that rounding of the displacements leaves in the strain energy of a motion without strain,
#: such as that of a part that hangs by a vertex. A clamped sheet of up to a million thicknesses
#: bends with more energy.
STRAINLESS = 1e-27

#: Relative error of float64.
_ROUNDING = 2.0**-53


class Modes(NamedTuple):
    """Lowest modes of a supported mesh."""

    eigenvalues: Floats
    """λ = ω² [1/s²], ascending, (n,); exactly 0.0 for a rigid mode."""
    shapes: Floats
    """Mode shapes [1/√kg], (n, V, 3)."""
    rounding: Floats
    """Upper estimate of the share of each λ that is rounding, (n,): 0 to 1."""


def solve_modes(pencil: Pencil, count: int, progress: Progress | None = None) -> Modes:
    """Compute the lowest vibration modes of a pencil, and the rounding of their eigenvalues."""
    # If the pencil has vertices and strains, exactly those modes are rigid that the supports allow.
    # A thin sheet bends so much more easily than it stretches that K contains only rounding of its
    # lowest modes. Within the space of all computed modes, of which the higher ones are accurate,
    # strains determine them (Rayleigh and Ritz). What is still lost is the share of modes outside
    # that space.
    if count < 1:
        raise InputError("the number of modes must be at least 1", key="count", value=count)
    report: Progress = progress or (lambda _: None)
    report(0.0)
    with blas_threads.use_one_thread():
        eigenvalues, modes, rounding = _solve_components(pencil, count, report)
        # K of a rigid body is that of its springs, and has no correct digit for its free motions.
        if pencil.size > 6:
            _verify(pencil.stiffness, pencil.mass, eigenvalues, modes)
    shapes = (pencil.basis @ (modes * _signs(modes))).T
    report(1.0)
    return Modes(eigenvalues, shapes.reshape(len(eigenvalues), -1, 3), rounding)


def estimate_bytes(dof: int, count: int, layers: float | None = None, sheet: bool = False) -> int:
    """Estimate the memory that `solve_modes` needs, so that too large a problem can be refused.

    Parameters
    ----------
    dof : int
        Number of free components.
    count : int
        Number of modes.
    layers : float, optional
        Cells through the thickness of a slab. If missing or infinite, the mesh is assumed to be a
        cube, which needs most memory.
    sheet : bool, optional
        Whether the mesh is a sheet, which also needs memory for strains.

    Returns
    -------
    int
        Bytes, including matrices and results.
    """
    count = min(count, dof)
    if _is_dense(dof, count):
        # For a sheet, motions in its plane and motions across it are solved separately.
        return int(50 * dof**2 * (4 / 9 if sheet else 1))
    # Number of entries of the factors. For a cube it grows as the power 4/3. For a sheet it grows
    # as A log A, with a dense block for each of the A columns of vertices across it.
    entries = 13.1 * dof ** (4 / 3)
    if layers is not None:
        column = 3 * (layers + 1)
        entries = min(entries, 1.45 * dof * column * math.log2(max(2.0, dof / column)))
    if importlib.util.find_spec("pymetis") is None:
        entries *= 2.4
    # 8 bytes per entry, and as much for updates that wait on the fronts' borders.
    return int(17 * entries + dof * (210 + 62 * count + 6000 * sheet))


def _is_dense(dof: int, count: int) -> bool:
    return dof <= DENSE or 4 * count >= dof


def _solve_components(
    pencil: Pencil, count: int, report: Progress
) -> tuple[Floats, Floats, Floats]:
    """Compute λ of the lowest modes of all components, the modes, (N, n), and their rounding."""
    total = pencil.size
    rows, solved, done, top = [], [], 0, math.inf
    for component in sorted(pencil.components, key=lambda each: -each.size):

        def part(share: float, done: int = done, size: int = component.size) -> None:
            report((done + share * size) / total)

        # The thickness of a sheet is its smallest component. It has thousands of modes close
        # together, which are slow to separate, and all of which are above the requested ones.
        few = min(count, component.size)
        if math.isfinite(top) and not _is_dense(component.size, few):
            beyond = component.stiffness - 1.01 * top * component.mass
            few = min(few, count_negative_eigenvalues(beyond, component.analysis))
        done += component.size
        if not few:
            continue
        modes = _solve_component(component, few, part)
        rows.append(component.rows)
        solved.append([found[..., :count] for found in _evaluate_modes(component, modes)])
        found = np.sort(np.concatenate([values for values, *_ in solved]))
        top = found[count - 1] if len(found) >= count else math.inf
    eigenvalues, rounding = (np.concatenate([each[k] for each in solved]) for k in (0, 2))
    lowest = np.argsort(eigenvalues, kind="stable")[:count]
    if len(pencil.components) == 1:
        return eigenvalues[lowest], solved[0][1], rounding[lowest]
    modes = np.zeros((total, len(lowest)))
    first = 0
    for mine, (values, vectors, _) in zip(rows, solved, strict=True):
        chosen = np.flatnonzero((lowest >= first) & (lowest < first + len(values)))
        modes[np.ix_(mine, chosen)] = vectors[:, lowest[chosen] - first]
        first += len(values)
    return eigenvalues[lowest], modes, rounding[lowest]


def _solve_component(component: Pencil, count: int, report: Progress) -> Floats:
    """Compute at least the lowest modes of a component."""
    size = component.size
    if size <= 6 and component.nodes is not None and component.rigid_motions.shape[1] == size:
        report(1.0)
        return component.rigid_motions  # of a rigid body that nothing holds, whose K is zero
    if not _is_dense(size, count):
        return _solve_and_count(component, count, report)
    # LAPACK finds all modes in half the time of many modes: "gvd" uses divide and conquer.
    few = 4 * count < size
    try:
        modes = la.eigh(
            component.stiffness.toarray(order="F"),
            component.mass.toarray(order="F"),
            driver="gvx" if few else "gvd",
            subset_by_index=[0, min(count + SPARE, size) - 1] if few else None,
            overwrite_a=True,
            overwrite_b=True,
        )[1]
    except la.LinAlgError as error:
        raise SolverError(
            f"the dense eigenvalue problem has no solution: {error}",
            cure="Look for badly shaped tetrahedra in the cage",
        ) from error
    report(1.0)
    return _refine_lowest(component, modes)


def _refine_lowest(component: Pencil, modes: Floats) -> Floats:
    """Remove from modes of a dense solver what rounding has mixed into the lowest ones."""
    # The error is a share of the highest eigenvalue, which for a sheet belongs to its thickness.
    # The lowest modes of the inverse are free of it, as factors are accurate relative to each row.
    stiffness, mass = component.stiffness, component.mass
    force, inertia = stiffness @ modes, mass @ modes
    values = np.einsum("nk,nk->k", modes, force)
    residual = np.linalg.norm(force - inertia * values, axis=0)
    allowed = np.linalg.norm(abs(stiffness) @ abs(modes), axis=0) * NOISE
    allowed = np.maximum(0.01 * RESIDUAL * np.linalg.norm(force, axis=0), allowed)
    if (residual <= allowed).all() or component.size <= 6:
        return modes
    few = modes.shape[1]
    if few == component.size:
        few = int((values < math.sqrt(component.shift * values.max())).sum())
    solve, dense = component.factors.solve, mass.toarray()
    low = la.eigh(mass @ solve(dense), dense)[1][:, ::-1][:, :few]
    low = solve(mass @ low)
    low = low @ la.eigh(low.T @ (stiffness @ low), low.T @ (mass @ low))[1]
    high = modes[:, few:]
    return np.concatenate([low, high - low @ (low.T @ (mass @ high))], axis=1)


def _evaluate_modes(component: Pencil, modes: Floats) -> tuple[Floats, Floats, Floats]:
    """Compute λ of a component's modes, ascending, the modes in this order, and their rounding."""
    # The error of the quotient φᵀKφ / φᵀMφ is the square of the mode's error, so the eigenvalues of
    # both solvers are equal up to rounding in K.
    energy, noise = _energies(component, modes)
    rigid = energy <= RIGID * noise
    rounding = _ROUNDING * np.divide(noise, energy, out=np.ones_like(noise), where=energy > 0)
    if component.strain_products is not None and (doubtful := energy <= DOUBTFUL * noise).any():
        motions = component.rigid_motions
        left = motions.shape[1]
        rigid = np.zeros(len(energy), dtype=bool)
        rigid[np.argsort(energy, kind="stable")[:left]] = True
        if doubtful.sum() > left:
            low = energy <= energy[doubtful].max()  # the lowest, as modes are mass-normalised
            modes = _separate_by_strains(component, modes, low, motions)
            noise = _energies(component, modes)[1]
            energy = np.diag(component.strain_products(_to_fields(component, modes)))
            rigid = (np.arange(len(energy)) < left) | (energy <= STRAINLESS * noise)
            # The error is of second order, and comes from modes beyond the highest one.
            share = np.divide(noise, energy, out=np.full_like(noise, np.inf), where=energy > 0)
            rounding = _ROUNDING**2 * share * noise / energy.max()
    rounding = np.where(rigid, 0.0, np.minimum(rounding, 1.0))
    eigenvalues = energy / np.einsum("nk,nk->k", modes, component.mass @ modes)
    eigenvalues[rigid] = 0.0
    order = np.argsort(eigenvalues, kind="stable")
    return eigenvalues[order], modes[:, order], rounding[order]


def _energies(component: Pencil, modes: Floats) -> tuple[Floats, Floats]:
    """Compute φᵀKφ of modes, and |φ|ᵀ |K| |φ|, to which the rounding is proportional."""
    cancel.check()
    size = abs(modes)
    energy = np.einsum("nk,nk->k", modes, component.stiffness @ modes)
    return energy, np.einsum("nk,nk->k", size, abs(component.stiffness) @ size)


def _to_fields(component: Pencil, modes: Floats) -> Floats:
    """Convert modes of a component to displacements of all nodes, (n, V, 3)."""
    return (component.basis @ modes).T.reshape(modes.shape[1], -1, 3)


def _separate_by_strains(
    component: Pencil, modes: Floats, lowest: Bools, motions: Floats
) -> Floats:
    """Separate the lowest modes, which K cannot resolve, by strains; rigid modes come first."""
    # Each mode is made orthogonal only to those before it, which have less energy. A remainder of
    # low modes in a high one is harmless; a trace of a high mode in a low one is not.
    assert component.strain_products is not None
    mass, low = component.mass, modes[:, lowest]
    if motions.shape[1]:
        # Keep the part of these modes that is not a rigid motion.
        low = low @ la.null_space(motions.T @ (mass @ low))
        low -= motions @ (motions.T @ (mass @ low))
    others = modes[:, ~lowest]
    both = np.concatenate([low, others], axis=1)
    springs = component.strain_products(_to_fields(component, both))
    if (np.diag(springs) <= 0.0).any():
        return np.concatenate([motions, both], axis=1)  # no digit of the strains is correct
    size = np.diag(springs) ** -0.5
    inertia = both.T @ (mass @ both)
    scale = np.outer(size, size)
    # The largest values of 1/λ are accurate, and so are the lowest modes, which belong to them.
    try:
        turn = la.eigh(inertia * scale, springs * scale)[1][:, ::-1][:, : low.shape[1]]
    except la.LinAlgError:
        return np.concatenate([motions, both], axis=1)  # components that hang by a vertex
    low = (both * size) @ turn
    low /= np.sqrt(np.einsum("nk,nk->k", low, mass @ low))
    both = np.concatenate([motions, low, others], axis=1)
    factor = np.linalg.cholesky(both.T @ (mass @ both))
    return la.solve_triangular(factor, both.T, lower=True).T


def _solve_and_count(component: Pencil, count: int, report: Progress) -> Floats:
    """Compute slightly more than the lowest modes, and make sure that none is missing."""
    # A Krylov space can miss a mode without any sign. The inertia of K - μM cannot: the number of
    # its negative eigenvalues is the number of modes below μ. μ is placed in the widest gap after
    # the last requested mode, so a few more modes are solved for.
    for attempt, share in enumerate(_SHARES):

        def solve(seed: int = attempt) -> tuple[Floats, Floats]:
            return lowest_modes(
                component.factorise(lambda part: report(0.3 * part)).solve,
                component.stiffness,
                component.mass,
                min(count + SPARE, component.size),
                lambda part: report(0.3 + 0.3 * part),
                seed=seed,
            )

        try:
            values, vectors = solve()
        except SolverError:
            if not component.lower_shift():
                raise
            values, vectors = solve()
        tail = values[count - 1 :]
        # Gaps are relative to λ + σ; relative to λ, rounding would separate rigid modes.
        below = count + int(np.argmax(np.diff(tail) / (tail[1:] + component.shift)))
        between = (1 - share) * values[below - 1] + share * values[below]
        found = count_negative_eigenvalues(
            component.stiffness - between * component.mass,
            component.analysis,
            lambda part: report(0.6 + 0.4 * part),
        )
        if found == below:
            return vectors
    raise SolverError(
        f"{found} modes lie below {math.sqrt(between) / (2 * math.pi):.6g} Hz, but {below} were "
        "found",
        cure="Look for badly shaped tetrahedra in the cage, or request more modes",
    )


def _verify(
    stiffness: sp.csr_matrix, mass: sp.csr_matrix, eigenvalues: Floats, modes: Floats
) -> None:
    """Raise an error that names the first wrong mode."""
    if eigenvalues.min() < 0:
        raise SolverError(
            f"the stiffness matrix is not positive semidefinite: λ = {eigenvalues.min():.3g}",
            cure="Check the material, and look for badly shaped tetrahedra in the cage",
        )
    cancel.check()
    force, inertia = stiffness @ modes, mass @ modes
    noise = abs(stiffness) @ abs(modes)
    residual = np.linalg.norm(force - inertia * eigenvalues, axis=0)
    size, rounding = np.linalg.norm(force, axis=0), np.linalg.norm(noise, axis=0)
    wrong = ~(residual <= np.maximum(RESIDUAL * size, NOISE * rounding))
    if wrong.any():
        worst = int(np.argmax(wrong))
        raise SolverError(
            f"mode {worst + 1} leaves a residual of {residual[worst] / size[worst]:.2g}, above "
            f"{RESIDUAL:g}",
            cure="Look for badly shaped tetrahedra in the cage and for moduli that differ by many "
            "powers of ten, or request fewer modes",
        )


def _signs(modes: Floats) -> Floats:
    """Compute signs that make the first of the largest components of each mode positive."""
    # Components within 1e-6 of the largest count as equal to it. On a symmetric cage two opposite
    # components are often equal, and rounding would choose between them.
    size = abs(modes)
    first = (size >= (1 - 1e-6) * size.max(axis=0)).argmax(axis=0)
    return np.sign(modes[first, np.arange(modes.shape[1])])
