"""Errors of spacemap_vtk, derived from the built-in ones, and its warnings.

Every message names the item at fault, its value, what is allowed and a cure, so that the command
line, the window and ParaView can show it unchanged.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

#: Packages whose frames are skipped when a warning looks for the user's line.
_OWN_PACKAGES = ("spacemap_vtk", "vtkmodules", "pyvista")


class SpacemapError(Exception):
    """Base of every error that spacemap_vtk raises on purpose.

    Parameters
    ----------
    message : str
        What is wrong.
    key : str, optional
        Name of the parameter at fault, e.g. ``"warp_diameter"``.
    value : object, optional
        The refused value.
    allowed : str, optional
        What would be accepted.
    cure : str, optional
        What the user can do about it.
    window_cure : str, optional
        The same in the window and the browser, whose menus and fields have other names.
    """

    def __init__(
        self,
        message: str,
        *,
        key: str | None = None,
        value: object = None,
        allowed: str | None = None,
        cure: str | None = None,
        window_cure: str | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.key = key
        self.value = value
        self.allowed = allowed
        self.cure = cure
        self.window_cure = window_cure or cure
        #: Set where they are known: the file at fault, and the section that contains `key`.
        self.file: str | None = None
        self.section: str | None = None

    def __str__(self) -> str:
        return self._format(self.cure)

    @property
    def text_for_window(self) -> str:
        """The message with the cure for the window and the browser."""
        return self._format(self.window_cure)

    def _format(self, cure: str | None) -> str:
        where = f"{self.file}: " if self.file else ""
        if where and self.message.startswith(where):
            where = ""  # a mesh was given as a scene: the user wrote no key
        elif self.key is not None:
            where += _shorten(f"{self.section}.{self.key}" if self.section else self.key, 160)
            where += ": " if self.value is None else f" = {format_value(self.value)}: "
        text = where + _shorten(self.message, 1000)
        if self.allowed:
            text += f"; allowed: {self.allowed}"
        return escape_unprintable(f"{text}. {cure}" if cure else text)


class InputError(SpacemapError, ValueError):
    """A value that the program cannot use."""


class UnknownNameError(InputError, AttributeError):
    """A name (keyword, attribute, section, key) that does not exist."""


class GeometryError(InputError):
    """A fabric, cage or object whose geometry is impossible, flat, inverted or empty."""


class SizeError(InputError, MemoryError):
    """A request that would not fit into memory, refused before any memory is allocated."""


class SolverError(SpacemapError, RuntimeError):
    """A numerical method that did not reach its tolerance."""


class MissingLibraryError(SpacemapError, RuntimeError):
    """A system library or an optional package that is not installed."""


class InfoMessage(str):
    """A sentence that only informs. `spacemap info` prints it; pictures do not warn about it."""

    __slots__ = ()


class SpacemapWarning(UserWarning):
    """A stage's doubt about its result; Python's `warnings` shows, hides or raises it."""


def warn_user(text: str) -> None:
    """Issue a `SpacemapWarning` at the user's line that called the package, also through VTK.

    Parameters
    ----------
    text : str
        One sentence.

    Raises
    ------
    SpacemapWarning
        If a filter of `warnings` turns it into an error.
    """
    frame = sys._getframe(1)
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] in _OWN_PACKAGES:
        frame = frame.f_back
    warnings.warn_explicit(
        text,
        SpacemapWarning,
        frame.f_code.co_filename,
        frame.f_lineno,
        frame.f_globals.get("__name__") or "<string>",  # with None, Python drops the warning
        frame.f_globals.setdefault("__warningregistry__", {}),
    )


@contextmanager
def add_key_to_errors(key: str) -> Iterator[None]:
    """Add a parameter's name to errors that name no parameter.

    Parameters
    ----------
    key : str
        Name of the parameter.

    Yields
    ------
    None
        While the parameter's value is used.
    """
    try:
        yield
    except SpacemapError as error:
        error.key = error.key or key
        raise


@contextmanager
def add_section_to_errors(section: str) -> Iterator[None]:
    """Add the name of the scene section to errors.

    Parameters
    ----------
    section : str
        Name of the section that contains the parameters at fault.

    Yields
    ------
    None
        While the section's parameters are used.
    """
    try:
        yield
    except SpacemapError as error:
        error.section = section
        raise


def format_value(value: object) -> str:
    """Format `value` as a user would write it, in one line.

    Parameters
    ----------
    value : object
        The refused value.

    Returns
    -------
    str
        At most 80 characters. A path is not shortened, because its end says most.
    """
    if isinstance(value, Path):
        return f'"{value}"'
    return _shorten(_format(value), 80)


def _shorten(text: str, most: int) -> str:
    text = escape_unprintable(text[: most + 1])
    return text if len(text) <= most else text[: most - 3] + "..."


def format_error(error: BaseException) -> str:
    """Return the message of any error in one line.

    Parameters
    ----------
    error : BaseException
        Any error, also Python's MemoryError, whose message is only a size or empty.

    Returns
    -------
    str
        Its message, or the name of its type if the message is empty.
    """
    text = " ".join(str(error).split())
    if isinstance(error, MemoryError) and not isinstance(error, SpacemapError):
        return f"out of memory: {text}".removesuffix(": ")
    return text or type(error).__name__


def escape_unprintable(text: str, keep: str = "") -> str:
    """Replace unprintable characters, which a stranger's file may contain, by their codes.

    Parameters
    ----------
    text : str
        Any text. Line ends would hide what follows, and terminals obey control characters.
    keep : str
        Unprintable characters that stay.

    Returns
    -------
    str
        The same text if all of it is printable.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in keep else repr(c)[1:-1] for c in text)


def _format(value: object) -> str:
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_format(item) for item in value)}]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else str(value)
