"""Vibration modes: K s = λ M s, equations (14) and (15) of Furukawa et al., for the lowest λ.

Small problems are solved densely, large ones by `spacemap_vtk.modal.lanczos`. Pieces of a mesh that
no element joins vibrate apart from each other and are solved apart: any number of equal pieces
then gives as many equal eigenvalues.
"""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy import linalg as la

from spacemap_vtk.errors import InputError, SolverError
from spacemap_vtk.modal import threads
from spacemap_vtk.modal.lanczos import BLOCK, lowest_modes
from spacemap_vtk.modal.multifrontal import negative_eigenvalues
from spacemap_vtk.modal.pencil import Pencil, Piece

FloatArray = NDArray[np.float64]
Progress = Callable[[float], object]

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

#: Share of |φ|ᵀ |K| |φ| that rounding may leave in φᵀKφ: below it a mode is rigid.
RIGID = 1e-14


def solve_modes(
    stiffness: sp.csr_matrix,
    mass: sp.csr_matrix,
    free: ArrayLike,
    count: int,
    progress: Progress | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the lowest vibration modes of K s = λ M s.

    Parameters
    ----------
    stiffness, mass : scipy.sparse.csr_matrix of float64, shape (3V, 3V)
        K [N/m], positive semidefinite, and M [kg], positive definite on what is free; component
        c of vertex v is row 3 v + c.
    free : array_like of bool, shape (3V,)
        Which components can move.
    count : int
        Number of modes n; all there are, if more are asked for.
    progress : callable, optional
        Called now and then with a fraction from 0 to 1; an exception it raises ends the solution.

    Returns
    -------
    eigenvalues : ndarray of float64, shape (n,)
        λ = ω² [1/s²], ascending; exactly 0.0 for a rigid mode.
    shapes : ndarray of float64, shape (n, V, 3)
        Mode shapes [1/√kg], mass-normalised (SᵀMS = I), zero where fixed; the first of the
        components of largest size is positive. The modes of a multiple eigenvalue are one basis
        of their space, as good as any other.

    Raises
    ------
    InputError
        If nothing is free, `count` is not positive, or a free component has no mass.
    SizeError
        If a factorisation does not fit into memory.
    SolverError
        If a mode leaves a residual ‖Kφ - λMφ‖ above 1e-6 ‖Kφ‖ (and above rounding in Kφ), a
        mode is missing, or K is not positive semidefinite.
    """
    _check_count(count)
    return lowest(Pencil(stiffness, mass, free), count, progress)


def lowest(
    pencil: Pencil, count: int, progress: Progress | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return the lowest vibration modes of a pencil, as `solve_modes` does.

    Parameters
    ----------
    pencil : Pencil
        K and M on what is free; its factors are used, and kept by it.
    count : int
        Number of modes n; all there are, if more are asked for.
    progress : callable, optional
        As for `solve_modes`.

    Returns
    -------
    eigenvalues : ndarray of float64, shape (n,)
        As for `solve_modes`.
    shapes : ndarray of float64, shape (n, V, 3)
        As for `solve_modes`.
    """
    _check_count(count)
    report: Progress = progress or _ignore
    report(0.0)
    with threads.one():
        modes = _of_pieces(pencil, count, report)
        eigenvalues = _verified(pencil.stiffness, pencil.mass, modes)
    order = np.argsort(eigenvalues, kind="stable")
    shapes = np.zeros((len(order), pencil.size))
    shapes[:, pencil.where] = (modes * _signs(modes)).T[order]
    report(1.0)
    return eigenvalues[order], shapes.reshape(len(order), -1, 3)


def estimate_bytes(dof: int, count: int, layers: float | None = None) -> int:
    """Estimate the memory that `solve_modes` takes, to refuse in time.

    Parameters
    ----------
    dof : int
        Number of free components.
    count : int
        Number of modes.
    layers : float, optional
        Cells through the thickness of a slab. Without it, or infinite, the mesh is taken for a
        cube, which needs most.

    Returns
    -------
    int
        Bytes, matrices and results included. Measured with 30 modes, above the matrices: 0.8 GB
        for a cube of 89,280 dof (estimate 1.4), 0.5 GB for a slab of 99,630 in four layers
        (estimate 1.3).
    """
    count = min(count, dof)
    if _is_dense(dof, count):
        return 8 * (4 * dof**2 + 4 * dof * count)
    # Entries of the factors: those of a cube grow as the power 4/3, those of a sheet as A log A
    # with a dense block for each of the A columns of vertices across it.
    entries = 13.1 * dof ** (4 / 3)
    if layers is not None:
        column = 3 * (layers + 1)
        entries = min(entries, 2.3 * dof * column * math.log2(max(2.0, dof / column)))
    if importlib.util.find_spec("pymetis") is None:
        entries *= 2.4
    vectors = 8 * dof * (7 * count + 20 * BLOCK)
    # 8 bytes an entry, and as much for what waits on the fronts' borders.
    return int(16 * entries + 12 * 240 * dof + vectors)


def _is_dense(dof: int, count: int) -> bool:
    return dof <= DENSE or 4 * count >= dof


def _ignore(_: float) -> None:
    pass


def _check_count(count: int) -> None:
    if count < 1:
        raise InputError("no mode is asked for", key="count", value=count, allowed="1 and more")


def _of_pieces(pencil: Pencil, count: int, report: Progress) -> FloatArray:
    """Return the lowest modes of all pieces together, (N, n)."""
    total = len(pencil.where)
    solved, done = [], 0
    for piece in pencil.pieces:

        def part(share: float, done: int = done, size: int = len(piece.rows)) -> None:
            report((done + share * size) / total)

        solved.append((piece.rows, *_of_piece(piece, min(count, len(piece.rows)), part)))
        done += len(piece.rows)
    if len(solved) == 1:
        return solved[0][2]
    eigenvalues = np.concatenate([values for _, values, _ in solved])
    lowest = np.argsort(eigenvalues, kind="stable")[:count]
    modes = np.zeros((total, len(lowest)))
    first = 0
    for rows, values, vectors in solved:
        mine = np.flatnonzero((lowest >= first) & (lowest < first + len(values)))
        modes[np.ix_(rows, mine)] = vectors[:, lowest[mine] - first]
        first += len(values)
    return modes


def _of_piece(piece: Piece, count: int, report: Progress) -> tuple[FloatArray, FloatArray]:
    if not _is_dense(len(piece.rows), count):
        values, vectors = _counted(piece, count, report)
        return values[:count], vectors[:, :count]
    # LAPACK finds all modes in half the time of many of them: "gvd" divides and conquers.
    few = 4 * count < len(piece.rows)
    try:
        eigenvalues, modes = la.eigh(
            piece.stiffness.toarray(order="F"),
            piece.mass.toarray(order="F"),
            driver="gvx" if few else "gvd",
            subset_by_index=[0, count - 1] if few else None,
            overwrite_a=True,
            overwrite_b=True,
        )
    except la.LinAlgError as error:
        raise SolverError(
            f"the dense eigenvalue problem has no solution: {error}",
            cure="Look for badly shaped tetrahedra in the cage",
        ) from error
    report(1.0)
    return eigenvalues[:count], modes[:, :count]


def _counted(piece: Piece, count: int, report: Progress) -> tuple[FloatArray, FloatArray]:
    """Return a few more than the lowest modes, none of them missed.

    A Krylov space can lack a mode and never notice. The inertia of K - μM can not: it has as many
    negative eigenvalues as the pencil has below μ. μ lies in the widest gap behind the last mode
    that is wanted, and so a few more are solved for.
    """
    for attempt, share in enumerate(_SHARES):

        def solve(seed: int = attempt) -> tuple[FloatArray, FloatArray]:
            return lowest_modes(
                piece.factorised(lambda part: report(0.3 * part)).solve,
                piece.stiffness,
                piece.mass,
                min(count + SPARE, len(piece.rows)),
                lambda part: report(0.3 + 0.3 * part),
                seed=seed,
            )

        try:
            values, vectors = solve()
        except SolverError:
            if not piece.lower_shift():
                raise
            values, vectors = solve()
        tail = values[count - 1 :]
        # Against λ + σ, or rounding would tell rigid modes apart.
        below = count + int(np.argmax(np.diff(tail) / (tail[1:] + piece.shift)))
        between = (1 - share) * values[below - 1] + share * values[below]
        found = negative_eigenvalues(
            piece.stiffness - between * piece.mass,
            piece.analysis,
            lambda part: report(0.6 + 0.4 * part),
        )
        if found == below:
            return values, vectors
    raise SolverError(
        f"{found} modes lie below {math.sqrt(between) / (2 * math.pi):.6g} Hz, and {below} of "
        "them were found",
        cure="Look for badly shaped tetrahedra in the cage, or ask for more modes",
    )


def _verified(stiffness: sp.csr_matrix, mass: sp.csr_matrix, modes: FloatArray) -> FloatArray:
    """Return φᵀKφ / φᵀMφ of each mode, zero for rigid ones, or say which mode is wrong.

    The quotient is exact to the square of the mode's error, and makes the eigenvalues of both
    solvers equal down to rounding in K itself.
    """
    force, inertia = stiffness @ modes, mass @ modes
    noise = abs(stiffness) @ abs(modes)
    energy = np.einsum("nk,nk->k", modes, force)
    eigenvalues = energy / np.einsum("nk,nk->k", modes, inertia)
    eigenvalues[abs(energy) <= RIGID * np.einsum("nk,nk->k", abs(modes), noise)] = 0.0
    if eigenvalues.min() < 0:
        raise SolverError(
            f"the stiffness matrix is not positive semidefinite: λ = {eigenvalues.min():.3g}",
            cure="Check the material, and look for badly shaped tetrahedra in the cage",
        )
    residual = np.linalg.norm(force - inertia * eigenvalues, axis=0)
    size, rounding = np.linalg.norm(force, axis=0), np.linalg.norm(noise, axis=0)
    wrong = ~(residual <= np.maximum(RESIDUAL * size, NOISE * rounding))
    if wrong.any():
        worst = int(np.argmax(wrong))
        raise SolverError(
            f"mode {worst} leaves a residual of {residual[worst] / size[worst]:.2g}, above "
            f"{RESIDUAL:g}",
            cure="Look for badly shaped tetrahedra in the cage and for moduli many powers of ten "
            "apart, or ask for fewer modes",
        )
    return eigenvalues


def _signs(modes: FloatArray) -> FloatArray:
    """Return the signs that make the first of the largest components of each mode positive.

    Components within 1e-6 of the largest count as equal to it: on a symmetric cage two opposite
    ones often are, and rounding would choose between them.
    """
    size = abs(modes)
    first = (size >= (1 - 1e-6) * size.max(axis=0)).argmax(axis=0)
    return np.sign(modes[first, np.arange(modes.shape[1])])
