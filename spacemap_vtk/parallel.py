"""Array work in a few threads, and in compiled loops where there is a compiler.

NumPy and SciPy release the interpreter's lock inside their loops, so plain threads use all cores as
long as each call has some thousand elements to work on.

What NumPy does to a large fabric is bound by its intermediate results, which go to memory and come
back: a step that reads and writes each byte once is out of its reach. A loop that Numba compiles
keeps them in registers. So Numba comes with the program; only what is the same in every time step
of a large fabric has such a loop, and beside it stands the NumPy code that gives the same numbers
within rounding, for ParaView's own Python and wherever there is no Numba. Small fabrics do not wait
for a compiler: to load it takes half a second, and to run it, once on a machine, some seconds. Only
the surface of one that takes about a thousand steps goes on with it, always from the same step on,
so that who does the same again gets the same bits. With the environment variable SPACEMAP_COMPILED
at ``always`` all loops are compiled from the first step on, and at ``never`` none is.
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

#: Multiplications that OpenBLAS does in the calling thread. From about there on it starts threads
#: of its own, which fight with ours: seconds, not ms.
BLAS_SERIAL = 2**18

#: Points of a surface, or points that ride along, from which a compiler pays, as threads do.
WORTHWHILE = 100_000

# The work is bound by memory: more threads than this only wait for each other.
_MOST_THREADS = 8


def thread_count() -> int:
    """Return how many threads array work is spread over."""
    return min(core_count(), _MOST_THREADS)


def core_count() -> int:
    """Return how many cores this process may use."""
    return len(cores())


def cores() -> list[int]:
    """Return the numbers of the cores that this process may use."""
    try:
        return sorted(os.sched_getaffinity(0))
    except AttributeError:  # Windows, macOS
        return list(range(os.cpu_count() or 1))


def blocks(count: int, size: int) -> list[slice]:
    """Cut what is counted into slices of a size; the last one may be shorter."""
    return [slice(begin, min(begin + size, count)) for begin in range(0, count, size)]


def for_each(
    jobs: Sequence[Task], worker: Callable[[], Callable[[Task], None]], threads: int | None = None
) -> None:
    """Do every job, in any order, in a few threads; stop where the work is cancelled."""
    # The threads live for one call: kept ones would be lost by a fork and hang the child.
    if not jobs:
        return
    count = min(threads or thread_count(), len(jobs))
    token = active_token()  # of this thread; the others have none
    waiting = iter(jobs)  # next() of a list iterator is atomic: each job is taken once

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


#: Modules whose machine code is kept in the user's cache folder, and not beside the package. Files
#: that pip did not install stay behind when it uninstalls, and what is left then hides the editable
#: package of the README's second command.
_IN_CACHE = ("spacemap_vtk.draw.raster_loops",)


def compiled(function: Function) -> Function:
    """Have a function compiled at its first call, for the types of its arguments."""
    # The machine code is kept on disk, so that the compiler runs once on a machine.
    from numba import config, njit

    from spacemap_vtk import cache

    # A division by zero is infinite, as in NumPy; a product and a sum may be rounded once.
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
    usual = config.CACHE_DIR
    try:
        if function.__module__ in _IN_CACHE:
            place = cache.folder()
            if place is None:
                raise RuntimeError
            config.CACHE_DIR = str(place / "compiled")
        made: Function = njit(**options, cache=True)(function)
    except RuntimeError:  # there is no folder to keep machine code in
        made = njit(**options)(function)
    finally:
        config.CACHE_DIR = usual
    return made


def loops(name: str, many: bool) -> ModuleType | None:
    """Return a module of compiled loops, where there are many points and a compiler."""
    wish = os.environ.get("SPACEMAP_COMPILED")
    if wish == "never" or (wish != "always" and not many):
        return None
    try:
        from numba import config
    except ImportError:
        return None
    return None if config.DISABLE_JIT else import_module(name)
