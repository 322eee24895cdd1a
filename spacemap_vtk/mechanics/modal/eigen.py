"""Vibration modes: K s = λ M s, equations (14) and (15) of Furukawa et al., for the lowest λ.

Small problems are solved densely, large ones by `spacemap_vtk.mechanics.linalg.lanczos`.
Components of a mesh, which no element joins, vibrate apart from each other and are solved apart:
any number of equal ones then gives as many equal eigenvalues.
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
from spacemap_vtk.mechanics.linalg.multifrontal import negative_eigenvalues
from spacemap_vtk.mechanics.modal.pencil import Pencil
from spacemap_vtk.ndarrays import Bools, Floats, Progress

#: Up to here the dense solver is no slower.
DENSE = 600

#: Modes solved for beyond those that are asked for, so that a gap follows the last of these: with
#: one asked for of a free body, five more are rigid.
SPARE = 7

#: Where in the gap modes are counted. When one is missing another solution is tried, from another
#: start, and counted at another place: pivots may have been poor at the last one.
_SHARES = (0.5, 0.3, 0.6)

#: Largest ‖Kφ - λMφ‖ / ‖Kφ‖ of a mode.
RESIDUAL = 1e-6

#: Share of ‖|K| |φ|‖ that rounding may leave in Kφ.
NOISE = 1e-13

#: Share of |φ|ᵀ |K| |φ| that rounding may leave in φᵀKφ: below it a mode is rigid, where only K is
#: known.
RIGID = 1e-14

#: Below this share, too many digits are lost in φᵀKφ: strains tell, where they are known.
DOUBTFUL = 1e-10

#: Share that rounding of the displacements leaves in the strain energy of a motion without strain:
#: of a part that hangs by a vertex. A clamped sheet bends with more up to a million thicknesses.
STRAINLESS = 1e-27

#: Relative error of float64.
_ROUNDING = 2.0**-53


class Modes(NamedTuple):
    """The lowest modes of a supported mesh."""

    eigenvalues: Floats
    """λ = ω² [1/s²], ascending, (n,); exactly 0.0 for a rigid mode."""
    shapes: Floats
    """Mode shapes [1/√kg], (n, V, 3)."""
    rounding: Floats
    """An estimate, from above, of the share of each λ that is rounding, (n,): 0 to 1."""


def lowest(pencil: Pencil, count: int, progress: Progress | None = None) -> Modes:
    """Return the lowest vibration modes of a pencil, and how many of their digits are rounding."""
    # Of a pencil that knows vertices and strains, exactly those modes are rigid that the supports
    # leave. A thin sheet bends by so much more easily than it stretches that K holds nothing of its
    # lowest modes but rounding; in the space of the modes that are found, whose higher ones are
    # right, strains tell them (Rayleigh and Ritz). What is then lost still is the share that modes
    # outside of that space have.
    if count < 1:
        raise InputError("no mode is asked for", key="count", value=count, allowed="1 and more")
    report: Progress = progress or (lambda _: None)
    report(0.0)
    with blas_threads.one():
        eigenvalues, modes, rounding = _of_components(pencil, count, report)
        if (
            pencil.size > 6
        ):  # a rigid piece's K is its springs', in which what is free has no digits
            _verify(pencil.stiffness, pencil.mass, eigenvalues, modes)
    shapes = (pencil.basis @ (modes * _signs(modes))).T
    report(1.0)
    return Modes(eigenvalues, shapes.reshape(len(eigenvalues), -1, 3), rounding)


def estimate_bytes(dof: int, count: int, layers: float | None = None, sheet: bool = False) -> int:
    """Estimate the memory that `lowest` takes, to refuse in time.

    Parameters
    ----------
    dof : int
        Number of free components.
    count : int
        Number of modes.
    layers : float, optional
        Cells through the thickness of a slab. Without it, or infinite, the mesh is taken for a
        cube, which needs most.
    sheet : bool, optional
        Whether it is a sheet, whose strains are made, too.

    Returns
    -------
    int
        Bytes, matrices and results included.
    """
    count = min(count, dof)
    if _is_dense(dof, count):
        # Of a sheet, motions in its plane are solved apart from those across it.
        return int(50 * dof**2 * (4 / 9 if sheet else 1))
    # Entries of the factors: those of a cube grow as the power 4/3, those of a sheet as A log A
    # with a dense block for each of the A columns of vertices across it.
    entries = 13.1 * dof ** (4 / 3)
    if layers is not None:
        column = 3 * (layers + 1)
        entries = min(entries, 1.45 * dof * column * math.log2(max(2.0, dof / column)))
    if importlib.util.find_spec("pymetis") is None:
        entries *= 2.4
    # 8 bytes an entry, and as much for what waits on the fronts' borders.
    return int(17 * entries + dof * (210 + 62 * count + 6000 * sheet))


def _is_dense(dof: int, count: int) -> bool:
    return dof <= DENSE or 4 * count >= dof


def _of_components(pencil: Pencil, count: int, report: Progress) -> tuple[Floats, Floats, Floats]:
    """Return λ of the lowest modes of all components, these, (N, n), and their rounding."""
    total = pencil.size
    rows, solved, done, top = [], [], 0, math.inf
    for component in sorted(pencil.components, key=lambda each: -each.size):

        def part(share: float, done: int = done, size: int = component.size) -> None:
            report((done + share * size) / total)

        # A sheet's thickness, its smallest part, has thousands of modes close together, which take
        # long to tell apart, above all that are wanted.
        few = min(count, component.size)
        if math.isfinite(top) and not _is_dense(component.size, few):
            beyond = component.stiffness - 1.01 * top * component.mass
            few = min(few, negative_eigenvalues(beyond, component.analysis))
        done += component.size
        if not few:
            continue
        modes = _of_component(component, few, part)
        rows.append(component.rows)
        solved.append([found[..., :count] for found in _evaluated(component, modes)])
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


def _of_component(component: Pencil, count: int, report: Progress) -> Floats:
    """Return at least the lowest modes of a component."""
    size = component.size
    if size <= 6 and component.nodes is not None and component.motions.shape[1] == size:
        report(1.0)
        return component.motions  # a rigid piece that nothing holds, whose K is zero
    if not _is_dense(size, count):
        return _counted(component, count, report)
    # LAPACK finds all modes in half the time of many of them: "gvd" divides and conquers.
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
    return _refined(component, modes)


def _refined(component: Pencil, modes: Floats) -> Floats:
    """Return modes of a dense solver without what rounding has mixed into the lowest."""
    # It mixes in a share of the highest eigenvalue, which of a sheet is its thickness's. The
    # inverse's lowest modes have none of it, as the factors are good to each row's own size.
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


def _evaluated(component: Pencil, modes: Floats) -> tuple[Floats, Floats, Floats]:
    """Return λ of the modes of a component, ascending, these modes, and their rounding."""
    # The quotient φᵀKφ / φᵀMφ is exact to the square of the mode's error, and makes the eigenvalues
    # of both solvers equal down to rounding in K itself.
    energy, noise = _energies(component, modes)
    rigid = energy <= RIGID * noise
    rounding = _ROUNDING * np.divide(noise, energy, out=np.ones_like(noise), where=energy > 0)
    if component.strain_products is not None and (doubtful := energy <= DOUBTFUL * noise).any():
        motions = component.motions
        left = motions.shape[1]
        rigid = np.zeros(len(energy), dtype=bool)
        rigid[np.argsort(energy, kind="stable")[:left]] = True
        if doubtful.sum() > left:
            low = energy <= energy[doubtful].max()  # modes are mass-normalised: these are lowest
            modes = _told_by_strains(component, modes, low, motions)
            noise = _energies(component, modes)[1]
            energy = np.diag(component.strain_products(_fields(component, modes)))
            rigid = (np.arange(len(energy)) < left) | (energy <= STRAINLESS * noise)
            # Of second order, and left by the modes beyond the highest.
            share = np.divide(noise, energy, out=np.full_like(noise, np.inf), where=energy > 0)
            rounding = _ROUNDING**2 * share * noise / energy.max()
    rounding = np.where(rigid, 0.0, np.minimum(rounding, 1.0))
    eigenvalues = energy / np.einsum("nk,nk->k", modes, component.mass @ modes)
    eigenvalues[rigid] = 0.0
    order = np.argsort(eigenvalues, kind="stable")
    return eigenvalues[order], modes[:, order], rounding[order]


def _energies(component: Pencil, modes: Floats) -> tuple[Floats, Floats]:
    """Return φᵀKφ of modes, and |φ|ᵀ |K| |φ|, of which rounding is a share."""
    cancel.check()
    size = abs(modes)
    energy = np.einsum("nk,nk->k", modes, component.stiffness @ modes)
    return energy, np.einsum("nk,nk->k", size, abs(component.stiffness) @ size)


def _fields(component: Pencil, modes: Floats) -> Floats:
    """Return the modes of a component as displacements of all vertices, (n, V, 3)."""
    return (component.basis @ modes).T.reshape(modes.shape[1], -1, 3)


def _told_by_strains(component: Pencil, modes: Floats, lowest: Bools, motions: Floats) -> Floats:
    """Return the rigid modes, the other lowest ones, which K cannot tell apart, and all others."""
    # Each is freed of those before it alone, which have less energy: what is left of them in it
    # does no harm, where a trace of a high mode in a low one would.
    assert component.strain_products is not None
    mass, low = component.mass, modes[:, lowest]
    if motions.shape[1]:
        # What of them is no rigid motion.
        low = low @ la.null_space(motions.T @ (mass @ low))
        low -= motions @ (motions.T @ (mass @ low))
    others = modes[:, ~lowest]
    both = np.concatenate([low, others], axis=1)
    springs = component.strain_products(_fields(component, both))
    if (np.diag(springs) <= 0.0).any():
        return np.concatenate([motions, both], axis=1)  # strains that no digit holds
    size = np.diag(springs) ** -0.5
    inertia = both.T @ (mass @ both)
    scale = np.outer(size, size)
    # Of 1/λ the largest are exact, and with them the lowest modes.
    try:
        turn = la.eigh(inertia * scale, springs * scale)[1][:, ::-1][:, : low.shape[1]]
    except la.LinAlgError:
        return np.concatenate([motions, both], axis=1)  # components that hang by a vertex
    low = (both * size) @ turn
    low /= np.sqrt(np.einsum("nk,nk->k", low, mass @ low))
    both = np.concatenate([motions, low, others], axis=1)
    factor = np.linalg.cholesky(both.T @ (mass @ both))
    return la.solve_triangular(factor, both.T, lower=True).T


def _counted(component: Pencil, count: int, report: Progress) -> Floats:
    """Return a few more than the lowest modes, none of them missed."""
    # A Krylov space can lack a mode and never notice. The inertia of K - μM can not: it has as many
    # negative eigenvalues as the pencil has below μ. μ lies in the widest gap behind the last mode
    # that is wanted, and so a few more are solved for.
    for attempt, share in enumerate(_SHARES):

        def solve(seed: int = attempt) -> tuple[Floats, Floats]:
            return lowest_modes(
                component.factorised(lambda part: report(0.3 * part)).solve,
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
        # Against λ + σ, or rounding would tell rigid modes apart.
        below = count + int(np.argmax(np.diff(tail) / (tail[1:] + component.shift)))
        between = (1 - share) * values[below - 1] + share * values[below]
        found = negative_eigenvalues(
            component.stiffness - between * component.mass,
            component.analysis,
            lambda part: report(0.6 + 0.4 * part),
        )
        if found == below:
            return vectors
    raise SolverError(
        f"{found} modes lie below {math.sqrt(between) / (2 * math.pi):.6g} Hz, and {below} of "
        "them were found",
        cure="Look for badly shaped tetrahedra in the cage, or ask for more modes",
    )


def _verify(
    stiffness: sp.csr_matrix, mass: sp.csr_matrix, eigenvalues: Floats, modes: Floats
) -> None:
    """Say which mode is wrong."""
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
            cure="Look for badly shaped tetrahedra in the cage and for moduli many powers of ten "
            "apart, or ask for fewer modes",
        )


def _signs(modes: Floats) -> Floats:
    """Return the signs that make the first of the largest components of each mode positive."""
    # Components within 1e-6 of the largest count as equal to it: on a symmetric cage two opposite
    # ones often are, and rounding would choose between them.
    size = abs(modes)
    first = (size >= (1 - 1e-6) * size.max(axis=0)).argmax(axis=0)
    return np.sign(modes[first, np.arange(modes.shape[1])])
