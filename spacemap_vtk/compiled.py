"""Loops that Numba compiles, where it is installed: ``pip install 'spacemap_vtk[fast]'``.

What NumPy does to a large fabric is bound by its intermediate results, which go to memory and come
back. A compiled loop keeps them in registers and touches each byte once. Only what is the same in
every time step of a large fabric has such a loop, and beside it stands the NumPy code that gives
the same numbers within rounding. Small fabrics never wait for a compiler: to load it takes half a
second, and to run it, once on a machine, some seconds.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., object])

#: Points of a surface, or points that ride along, from which a compiler pays, as threads do.
WORTHWHILE = 100_000


def compiled(function: Function) -> Function:
    """Have a function compiled at its first call, for the types of its arguments."""
    # The machine code is kept on disk, so that the compiler runs once on a machine.
    from numba import njit

    # A division by zero is infinite, as in NumPy; a product and a sum may be rounded once.
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}
    try:
        made: Function = njit(**options, cache=True)(function)
    except RuntimeError:  # there is no folder to keep machine code in
        made = njit(**options)(function)
    return made


def loops(name: str) -> ModuleType | None:
    """Return a module of compiled loops, if there is a compiler."""
    try:
        from numba import config
    except ImportError:
        return None
    return None if config.DISABLE_JIT else import_module(name)
