"""Run array work in a few threads, and in compiled loops where Numba is installed.

NumPy and SciPy release the interpreter's lock inside their loops, so threads use all cores as long
as each call handles some thousand elements.

NumPy code for a large fabric is limited by its intermediate results, which are written to memory
and read back. A loop compiled by Numba keeps them in registers, so it reads and writes each byte
once.

- Only work that is repeated in every time step of a large fabric has a compiled loop. Each loop has
  NumPy code with the same result within rounding, for ParaView's Python and wherever Numba is
  missing.
- Small fabrics do not use the compiler: loading it takes half a second, and compiling (once per
  machine) some seconds. The exception is a surface that is evaluated about a thousand times. It
  switches to compiled loops always at the same step, so that a repeated run gives the same bits.
- With the environment variable SPACEMAP_COMPILED set to ``always`` all loops are compiled from the
  first step on; with ``never``, none is.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from types import ModuleType
from typing import Any, TypeVar

from spacemap_vtk.cancel import active_token

Task = TypeVar("Task")
Function = TypeVar("Function", bound=Callable[..., object])

#: Multiplications that OpenBLAS does in the calling thread. From about this number on it starts
#: threads, which compete with ours; a call then takes seconds instead of milliseconds.
BLAS_SERIAL = 2**18

#: Surface points or embedded points from which a compiler, or threads, save more than they cost.
MANY_POINTS = 100_000

# The work is limited by memory bandwidth: more threads only wait for each other.
_MOST_THREADS = 8


def thread_count() -> int:
    """Return the number of threads for array work."""
    return min(core_count(), _MOST_THREADS)


def core_count() -> int:
    """Return the number of cores that this process may use."""
    return len(core_numbers())


def core_numbers() -> list[int]:
    """Return the numbers of the cores that this process may use."""
    try:
        return sorted(os.sched_getaffinity(0))
    except AttributeError:  # Windows, macOS
        return list(range(os.cpu_count() or 1))


def blocks(count: int, size: int) -> list[slice]:
    """Cut a range of `count` items into slices of `size`; the last one may be shorter."""
    return [slice(begin, min(begin + size, count)) for begin in range(0, count, size)]


def for_each(
    jobs: Sequence[Task], worker: Callable[[], Callable[[Task], None]], threads: int | None = None
) -> None:
    """Run every job, in any order, in a few threads; stop if the work is cancelled."""
    # Threads live for one call only: a fork would lose permanent ones, and the child would hang.
    if not jobs:
        return
    count = min(threads or thread_count(), len(jobs))
    token = active_token()  # of this thread; the other threads have none
    waiting = iter(jobs)  # next() of a list iterator is atomic: each job runs once

    def run() -> None:
        do = worker()
        try:
            for job in waiting:
                token.check()
                do(job)
        except BaseException:
            for _ in waiting:  # so that the other threads stop as well
                pass
            raise

    if count == 1:
        run()
        return
    with ThreadPoolExecutor(count - 1) as executor:
        others = [executor.submit(run) for _ in range(count - 1)]
        run()
        for other in others:
            other.result()


#: Modules whose machine code goes into the user's cache folder instead of the package's folder. pip
#: does not remove files that it did not install. What it leaves behind would hide the editable
#: package of the README's second command.
_IN_CACHE = ("spacemap_vtk.draw.software.raster_loops",)


def compile_function(function: Function) -> Function:
    """Return a function that is compiled at its first call, for the types of its arguments."""
    # The machine code is stored on disk, so that the compiler runs only once per machine.
    from numba import config, njit

    from spacemap_vtk import cache

    # Division by zero gives infinity, as in NumPy; a multiply-add may be rounded once (fused).
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
    usual = config.CACHE_DIR
    try:
        if function.__module__ in _IN_CACHE:
            place = cache.folder()
            if place is None:
                raise RuntimeError
            config.CACHE_DIR = str(place / "compiled")
        compiled: Function = njit(**options, cache=True)(function)
    except RuntimeError:  # there is no folder for machine code
        compiled = njit(**options)(function)
    finally:
        config.CACHE_DIR = usual
    return compiled


def load_loops(name: str, many: bool) -> ModuleType | None:
    """Import a module of compiled loops; None if there are too few points or no compiler."""
    setting = os.environ.get("SPACEMAP_COMPILED")
    if setting == "never" or (setting != "always" and not many):
        return None
    try:
        from numba import config
    except ImportError:
        return None
    return None if config.DISABLE_JIT else import_module(name)
