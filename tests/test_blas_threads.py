"""Dense algebra takes one thread, but for large blocks: asked of OpenBLAS itself."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from pencils import solve_matrices, stiffness_and_mass

from spacemap_vtk.cage.lattice import build_lattice
from spacemap_vtk.mechanics.elements.materials import isotropic
from spacemap_vtk.mechanics.linalg import blas_threads

threadpoolctl = pytest.importorskip("threadpoolctl")


@pytest.fixture(autouse=True)
def two():
    """Let every library have two threads, whatever the machine and its environment say."""
    with threadpoolctl.threadpool_limits(2):
        blas_threads.find_thread_pools.cache_clear()
        blas_threads._initial_threads.clear()
        yield
    blas_threads.find_thread_pools.cache_clear()
    blas_threads._initial_threads.clear()


def taken() -> dict[str, set[int]]:
    found: dict[str, set[int]] = {"numpy": set(), "scipy": set()}
    for library in threadpoolctl.threadpool_info():
        if library["internal_api"] == "openblas":
            whose = "numpy" if "numpy.libs" in library["filepath"] else "scipy"
            found[whose].add(library["num_threads"])
    if not found["numpy"]:
        pytest.skip("NumPy and SciPy share a library here")
    return found


def test_only_large_blocks_use_several_threads():
    with blas_threads.use_one_thread():
        assert taken() == {"numpy": {1}, "scipy": {1}}
        with blas_threads.use_threads_for(1e6):
            assert taken() == {"numpy": {1}, "scipy": {1}}
        with blas_threads.use_threads_for(1e10):
            assert taken() == {"numpy": {1}, "scipy": {2}}
        assert taken() == {"numpy": {1}, "scipy": {1}}
    assert taken() == {"numpy": {2}, "scipy": {2}}


@pytest.mark.nightly
def test_a_large_problem_is_solved_by_one_thread_between_large_blocks():
    """Two threads of each library took half as long again as one for 95,000 unknowns."""
    points, tetrahedra = build_lattice((0, 1, 0, 1, 0, 0.05), (92, 92, 1))
    matrices = stiffness_and_mass(points, tetrahedra, isotropic(1e6, 0.3), 300.0)
    free = np.repeat(points[:, 1] < 1, 3)
    assert free.sum() > 50_000

    def stop(done: float) -> None:
        if done > 0.0:
            raise InterruptedError(taken())

    with pytest.raises(InterruptedError) as interrupted:
        solve_matrices(*matrices, free, 4, stop)
    assert interrupted.value.args == ({"numpy": {1}, "scipy": {1}},)
    assert taken() == {"numpy": {2}, "scipy": {2}}


_LATE = """
from spacemap_vtk.mechanics.linalg import blas_threads
with blas_threads.use_one_thread():
    pass
import scipy.linalg
from threadpoolctl import threadpool_info
with blas_threads.use_one_thread():
    print({library["num_threads"] for library in threadpool_info()})
"""


def test_library_loaded_later_is_limited_too():
    """Modes from disk need no SciPy; a drag's first solution came upon its two threads."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "2"}
    made = subprocess.run(
        [sys.executable, "-c", _LATE], env=environment, capture_output=True, text=True, check=True
    )
    assert made.stdout == "{1}\n"
