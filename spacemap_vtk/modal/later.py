"""Parts of scipy that are imported when something of them is first used.

A scene whose modes are kept needs none of them, and together they take as long to import as all of
this package.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


class _Later:
    """Stands for a module.

    Parameters
    ----------
    name : str
        The module's.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        value = getattr(import_module(self._name), attribute)
        setattr(self, attribute, value)  # found at once from now on
        return value


blas = _Later("scipy.linalg.blas")
csgraph = _Later("scipy.sparse.csgraph")
lapack = _Later("scipy.linalg.lapack")
linalg = _Later("scipy.linalg")
special = _Later("scipy.special")
