"""PySide6, imported with Python's own import function left in its place.

PySide6 puts one of its own there, which reads the source of every module that imports anything, to
look for a feature that nothing here uses: it would take as long as to import all of Qt. Whoever
starts the window imports this module before any other part of it.
"""

from __future__ import annotations

import builtins
from importlib import import_module

_plain = builtins.__import__
import_module("PySide6.QtCore")
builtins.__import__ = _plain
