"""Limit the threads of dense algebra to one, except for the largest blocks.

The wheels of NumPy and SciPy each contain an OpenBLAS whose threads occupy their cores while they
wait for the next call. If short calls alternate between the two, the threads hinder each other: a
cube of 95,000 degrees of freedom needed 58 s with two threads each, and 39 s with one.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import cache
from typing import Any

#: Number of multiplications from which several threads are faster than one.
_MIN_WORK = 1e9
#: Threads of each library when it was found; later calls may see an already limited number.
_initial_threads: dict[str, int] = {}


def use_one_thread() -> AbstractContextManager[Any]:
    """Return a context in which the calling thread alone does dense algebra.

    Returns
    -------
    context manager
        Results in it do not depend on the number of cores, except within `use_threads_for`.
    """
    pools = find_thread_pools(_has_scipy_blas())
    return nullcontext() if pools is None else pools[0].limit(limits=1)


def use_threads_for(work: float) -> AbstractContextManager[Any]:
    """Return a context, inside that of `use_one_thread`, that shares a large block by threads."""
    pools = find_thread_pools(_has_scipy_blas()) if work > _MIN_WORK else None
    return nullcontext() if pools is None else _lift_limit(pools[1])


@contextmanager
def _lift_limit(pool: dict[Any, int]) -> Iterator[None]:
    for library, most in pool.items():
        library.set_num_threads(most)
    try:
        yield
    finally:
        for library in pool:
            library.set_num_threads(1)


def _has_scipy_blas() -> bool:
    """Check whether SciPy's dense algebra is loaded; cached modes and figures do not need it."""
    return "scipy.linalg" in sys.modules


@cache
def find_thread_pools(with_scipys: bool) -> tuple[Any, dict[Any, int]] | None:
    """Return the controls of every OpenBLAS loaded, and the first thread counts of SciPy's."""
    try:
        from threadpoolctl import ThreadpoolController
    except ImportError:  # ParaView's Python has no threadpoolctl
        return None
    # OpenBLAS only: the threads of MKL, which Pardiso brings, wait without occupying a core.
    found = ThreadpoolController().select(internal_api="openblas")
    scipys = [library for library in found.lib_controllers if "numpy.libs" not in library.filepath]
    first = {x: _initial_threads.setdefault(x.filepath, x.num_threads) for x in scipys}
    return found, first
