"""How many threads dense algebra takes: one, but for the largest blocks.

NumPy's and SciPy's wheels bring an OpenBLAS each, with threads of its own that keep their
processor while they wait for the next call. Where calls are short and go to both in turn, they
stand in each other's way: a cube of 95,000 degrees of freedom took 58 s by two threads of each and
39 s by one.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import cache
from typing import Any

#: Multiplications from which several threads are quicker than one.
_MANY = 1e9
#: Threads of each library when it was met: later it may be limited already.
_at_first: dict[str, int] = {}


def one() -> AbstractContextManager[Any]:
    """Return a context in which dense algebra is done by the calling thread.

    Returns
    -------
    context manager
        In it results do not depend on how many cores there are, but for `several`.
    """
    pools = known_pools(_has_scipys())
    return nullcontext() if pools is None else pools[0].limit(limits=1)


def several(work: float) -> AbstractContextManager[Any]:
    """Return a context, within that of `one`, in which a large block is shared among threads."""
    pools = known_pools(_has_scipys()) if work > _MANY else None
    return nullcontext() if pools is None else _lifted(pools[1])


@contextmanager
def _lifted(pool: dict[Any, int]) -> Iterator[None]:
    for library, most in pool.items():
        library.set_num_threads(most)
    try:
        yield
    finally:
        for library in pool:
            library.set_num_threads(1)


def _has_scipys() -> bool:
    """Return whether SciPy's dense algebra is loaded: modes from disk, and figures, need none."""
    return "scipy.linalg" in sys.modules


@cache
def known_pools(with_scipys: bool) -> tuple[Any, dict[Any, int]] | None:
    """Return the control of every OpenBLAS loaded, and of SciPy's how many threads it had first."""
    try:
        from threadpoolctl import ThreadpoolController
    except ImportError:  # ParaView's own Python
        return None
    # MKL, which Pardiso brings, has threads that wait without a processor.
    found = ThreadpoolController().select(internal_api="openblas")
    scipys = [library for library in found.lib_controllers if "numpy.libs" not in library.filepath]
    first = {x: _at_first.setdefault(x.filepath, x.num_threads) for x in scipys}
    return found, first
