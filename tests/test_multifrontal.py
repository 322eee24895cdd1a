"""Factors and inertia against numpy, and nested dissection with and without METIS."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import scipy.sparse as sp
from pencils import solve_matrices, stiffness_and_mass

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import SizeError, SolverError
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.linalg import multifrontal
from spacemap_vtk.mechanics.linalg.factors import SquarePattern, factorise_square
from spacemap_vtk.mechanics.linalg.fronts import Analysis, dissect_by_levels, nested_dissection
from spacemap_vtk.mechanics.linalg.multifrontal import Cholesky, count_negative_eigenvalues


@pytest.fixture(params=["metis", "levels"], autouse=True)
def order(request, monkeypatch):
    if request.param == "levels":
        monkeypatch.setitem(sys.modules, "pymetis", None)
    else:
        pytest.importorskip("pymetis")
    return request.param


def pencil(divisions, held=True):
    points, tetrahedra = build_lattice((0, 1, 0, 1, 0, 1), divisions)
    K, M = stiffness_and_mass(points, tetrahedra, isotropic(1e6, 0.3), 300.0)
    free = np.flatnonzero(np.repeat((points[:, 1] < 1) | (not held), 3))
    return K[free][:, free], M[free][:, free], free // 3


def square_pattern(matrix, analysis):
    parts = np.arange(matrix.nnz), matrix.indices, matrix.indptr
    return SquarePattern(sp.csr_matrix(parts, shape=matrix.shape), analysis)


@pytest.mark.parametrize("divisions", [(1, 1, 1), (9, 9, 9), (30, 20, 1), (100, 1, 1)])
def test_factors_solve_a_system(divisions):
    K, M, vertices = pencil(divisions)
    A = (K + 100 * M).tocsr()
    right = np.random.default_rng(0).standard_normal((A.shape[0], 5))
    solved = Cholesky(A, Analysis(A, vertices)).solve(right)
    assert abs(A @ solved - right).max() <= 1e-10 * abs(right).max()
    assert abs(right).max() > 1  # the right-hand sides are left as they were


@pytest.mark.parametrize("density", [0.005, 0.05, 0.5])
def test_factors_of_random_patterns_solve(density):
    rng = np.random.default_rng(int(1000 * density))
    for size in (1, 7, 60, 301):
        A = sp.random(size, size, density, random_state=rng, format="csr")
        A = (A + A.T + sp.identity(size) * (abs(A + A.T).sum(axis=1).max() + 1)).tocsr()
        analysis = Analysis(A, np.arange(size))
        right = rng.standard_normal((size, 2))
        np.testing.assert_allclose(
            Cholesky(A, analysis).solve(right), np.linalg.solve(A.toarray(), right), atol=1e-12
        )
        for shift in np.quantile(np.linalg.eigvalsh(A.toarray()), [0.0, 0.3, 0.9]) - 0.0123:
            B = (A - shift * sp.identity(size)).tocsr()
            exact = (np.linalg.eigvalsh(B.toarray()) < 0).sum()
            assert count_negative_eigenvalues(B, analysis) == exact


@pytest.mark.parametrize("compiled", ["always", "never"])
@pytest.mark.parametrize("density", [0.005, 0.05, 0.5])
def test_compiled_loops_and_numpy_both_solve(density, compiled, monkeypatch):
    monkeypatch.setenv("SPACEMAP_COMPILED", compiled)
    rng = np.random.default_rng(int(1000 * density))
    for size in (1, 7, 60, 301):
        A = sp.random(size, size, density, random_state=rng, format="csr")
        A = (A + A.T).tocsr()  # of a symmetric pattern
        A.data = rng.standard_normal(A.nnz)
        A = (A + sp.identity(size) * (abs(A).sum(axis=1).max() + 1)).tocsr()
        symmetric = (A + A.T).tocsr()
        right = rng.standard_normal(size)
        analysis = Analysis(symmetric, np.arange(size))
        solved = Cholesky(symmetric, analysis).solve(right[:, None])[:, 0]
        np.testing.assert_allclose(solved, np.linalg.solve(symmetric.toarray(), right), atol=1e-12)
        solve = factorise_square(A.data, square_pattern(A, analysis))
        assert solve is not None
        np.testing.assert_allclose(solve(right), np.linalg.solve(A.toarray(), right), atol=1e-12)
        twice = sp.bmat([[A, 0.5 * A], [0.2 * A, A.T]], format="csr")
        solve = factorise_square(twice.data, square_pattern(twice, analysis.repeat(2)))
        assert solve is not None
        right = rng.standard_normal(2 * size)
        np.testing.assert_allclose(
            solve(right), np.linalg.solve(twice.toarray(), right), atol=1e-12
        )


@pytest.mark.parametrize("compiled", ["always", "never"])
def test_singular_matrix_has_no_solver(compiled, monkeypatch):
    monkeypatch.setenv("SPACEMAP_COMPILED", compiled)
    singular = sp.csr_matrix(np.ones((3, 3)))
    pattern = square_pattern(singular, Analysis(singular, np.arange(3)))
    assert factorise_square(singular.data, pattern) is None


@pytest.mark.parametrize("held", [True, False])
def test_inertia_counts_the_modes_below_a_shift(held):
    K, M, vertices = pencil((6, 5, 4), held)
    everything = np.ones(K.shape[0], bool)
    eigenvalues = solve_matrices(K, M, everything, K.shape[0])[0]
    analysis = Analysis(K, vertices)
    for below in (0, 1, 7, 40, 200):
        if not held and below < 6:
            continue
        bounds = eigenvalues[max(below - 1, 0)], eigenvalues[below]
        shift = sum(bounds) / 2 if below else bounds[0] / 2
        assert count_negative_eigenvalues((K - shift * M).tocsr(), analysis) == below


@pytest.mark.parametrize("panel", [1, 5, 40])
def test_inertia_does_not_depend_on_panels(panel, monkeypatch):
    """However few columns are eliminated at once."""
    K, M, vertices = pencil((6, 5, 4))
    A = (K - 60000.0 * M).tocsr()
    expected = (np.linalg.eigvalsh(A.toarray()) < 0).sum()
    assert expected > 2
    analysis, reported = Analysis(K, vertices), []
    monkeypatch.setattr(multifrontal, "PANEL", panel)
    assert count_negative_eigenvalues(A, analysis, reported.append) == expected
    assert reported == sorted(reported)
    assert reported[-1] == pytest.approx(1.0)
    fronts = len(analysis.runs)
    assert len(reported) == sum(-(-(last - first) // panel) for first, last in analysis.runs)
    assert len(reported) > fronts


def test_elimination_order_is_a_permutation():
    K = pencil((8, 7, 3))[0]
    graph = sp.csr_matrix(abs(K[::3][:, ::3]) > 0, dtype=float)
    graph.setdiag(0)
    graph.eliminate_zeros()
    for find in (nested_dissection, dissect_by_levels):
        np.testing.assert_array_equal(np.sort(find(graph)), np.arange(graph.shape[0]))


def test_dissection_keeps_factors_sparse():
    K, _, vertices = pencil((12, 12, 12))
    assert Analysis(K, vertices).entries < K.shape[0] ** 2 / 6


def test_indefinite_matrix_is_refused():
    K, M, vertices = pencil((4, 4, 4))
    with pytest.raises(SolverError, match="not positive definite"):
        Cholesky((K - 1e5 * M).tocsr(), Analysis(K, vertices))


def test_too_large_factors_are_refused_first(monkeypatch):
    import spacemap_vtk.memory as memory

    K, _, vertices = pencil((4, 4, 4))
    analysis = Analysis(K, vertices)
    monkeypatch.setattr(memory, "NEVER_REFUSED", 0)
    monkeypatch.setattr(memory, "available_bytes", lambda: 1000)
    with pytest.raises(SizeError, match="factorising 300 degrees"):
        Cholesky(K, analysis)
    assert multifrontal.require_memory is memory.require_memory


def test_progress_can_cancel():
    K, _, vertices = pencil((8, 8, 8))
    analysis = Analysis(K, vertices)
    reported = []
    Cholesky(K, analysis, reported.append)
    assert reported[-1] == 1.0
    assert (np.diff(reported) >= 0).all()

    def stop(share):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        count_negative_eigenvalues(K, analysis, stop)
