"""The libraries that factorise in place of our own, where they are installed, against it."""

from __future__ import annotations

import gc

import numpy as np
import psutil
import pytest
import scipy.sparse as sp
from pencils import solve_matrices, stiffness_and_mass

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.errors import SizeError, SolverError
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.linalg import factors
from spacemap_vtk.mechanics.linalg.factors import factorise
from spacemap_vtk.mechanics.linalg.fronts import Analysis

#: Package of each library, and the function that uses it.
LIBRARIES = {"cholmod": "sksparse", "pardiso": "pypardiso", "multifrontal": "numpy"}


def absent(matrix):
    raise ImportError


@pytest.fixture(params=LIBRARIES)
def library(request, monkeypatch):
    """Let one library alone be installed."""
    pytest.importorskip(LIBRARIES[request.param], reason=f"{request.param} is not installed")
    for name in ("cholmod", "pardiso"):
        if name != request.param:
            monkeypatch.setattr(factors, name, absent)
    return request.param


def pencil(divisions):
    points, tetrahedra = build_lattice((0, 1, 0, 1, 0, 1), divisions)
    K, M = stiffness_and_mass(points, tetrahedra, isotropic(1e6, 0.3), 300.0)
    return K, M, np.repeat(points[:, 1] < 1, 3)


@pytest.mark.parametrize("columns", [1, 8])
def test_each_library_solves_the_system(library, columns):
    K, M, free = pencil((7, 6, 5))
    A = (K + 100 * M).tocsr()[free][:, free]
    vertices = np.flatnonzero(free) // 3
    right = np.random.default_rng(0).standard_normal((A.shape[0], columns))
    made = factorise(A, lambda: Analysis(A, vertices))
    assert made.library == library
    for _ in range(2):
        solved = made.solve(right.copy())
        assert solved.shape == right.shape
        assert abs(A @ solved - right).max() <= 1e-9 * abs(right).max()


def test_each_library_gives_the_same_modes(library, monkeypatch):
    K, M, free = pencil((8, 8, 8))
    found, shapes = solve_matrices(K, M, free, 10)
    monkeypatch.setattr(factors, "cholmod", absent)
    monkeypatch.setattr(factors, "pardiso", absent)
    np.testing.assert_allclose(found, solve_matrices(K, M, free, 10)[0], rtol=1e-9)
    flat = shapes.reshape(10, -1)
    np.testing.assert_allclose(flat @ (M @ flat.T), np.eye(10), atol=1e-10)


def test_indefinite_matrix_is_refused(library):
    bad = sp.csr_matrix(np.diag([1.0, -1.0, 2.0]))
    with pytest.raises(SolverError):
        factorise(bad, lambda: Analysis(bad, np.arange(3)))


def test_lack_of_memory_is_a_size_error(monkeypatch):
    class CholmodTooLargeError(Exception):
        """As scikit-sparse 0.4 has it."""

    def full(matrix):
        raise CholmodTooLargeError

    monkeypatch.setattr(factors, "cholmod", full)
    with pytest.raises(SizeError, match="2 degrees of freedom do not fit"):
        factorise(sp.identity(2, format="csr"), lambda: None)


def test_memory_of_factors_is_released(library):
    """Five factorisations of some 30 MB each leave no two behind."""
    if library == "multifrontal":
        pytest.skip("its memory is numpy's")
    K, M, free = pencil((16, 16, 16))
    A = (K + 100 * M).tocsr()[free][:, free]
    analysis = Analysis(A, np.flatnonzero(free) // 3)
    factorise(A, lambda: analysis)
    gc.collect()
    before = psutil.Process().memory_info().rss
    for _ in range(5):
        factorise(A, lambda: analysis)
    gc.collect()
    assert psutil.Process().memory_info().rss - before < 60e6
