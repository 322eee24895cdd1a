"""Run array work in a few threads.

NumPy and SciPy release the interpreter's lock inside their loops, so plain threads use all cores as
long as each call has some thousand elements to work on.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Job = TypeVar("Job")

#: Multiplications that OpenBLAS does in the calling thread. From about there on it starts threads
#: of its own, which fight with ours: seconds, not ms.
BLAS_SERIAL = 2**18

# The work is bound by memory: more threads than this only wait for each other.
_MOST_THREADS = 8


def thread_count() -> int:
    """Return how many threads array work is spread over."""
    try:
        available = len(os.sched_getaffinity(0))
    except AttributeError:  # Windows, macOS
        available = os.cpu_count() or 1
    return min(available, _MOST_THREADS)


def for_each(
    jobs: Sequence[Job], worker: Callable[[], Callable[[Job], None]], threads: int | None = None
) -> None:
    """Do every job, in any order, in a few threads."""
    # The threads live for one call: kept ones would be lost by a fork and hang the child.
    if not jobs:
        return
    count = min(threads or thread_count(), len(jobs))
    waiting = iter(jobs)  # next() of a list iterator is atomic: each job is taken once

    def run() -> None:
        do = worker()
        try:
            for job in waiting:
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
