"""How many threads dense algebra may take."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from functools import cache
from typing import Any

#: Below so many degrees of freedom the dense blocks are small.
_SMALL = 50_000


def for_size(dof: int) -> AbstractContextManager[Any]:
    """Return a context in which small problems are worked on by one thread.

    Small blocks gain nothing by more, and where other programs want the processors too, OpenBLAS'
    threads wait for each other: 9,000 degrees of freedom took 9 s in place of 0.3.

    Parameters
    ----------
    dof : int
        Size of the problem.

    Returns
    -------
    context manager
        Does nothing for large problems, or where threadpoolctl is not installed.
    """
    controller = _controller() if dof < _SMALL else None
    return nullcontext() if controller is None else controller.limit(limits=1, user_api="blas")


@cache
def _controller() -> Any:
    try:
        from threadpoolctl import ThreadpoolController
    except ImportError:  # ParaView's own Python
        return None
    return ThreadpoolController()
