"""Record in a file how it was made: program, scene, job, and digests of the files that were read.

Code that makes a file calls `attach_record` once. Each writer stores `record_text` where its format
has room for it, and a function registered by `finds_record` finds it there again. The record is
JSON in ASCII, which any format can store. It contains no date, user or folder, so the same job
gives the same bytes everywhere.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from spacemap_vtk.errors import InputError, SpacemapError

#: Name of the record in every file.
NAME = "spacemap-record"
#: Most bytes of a record, and number of bytes at a file's beginning that are searched for it.
_MOST = 2**23
#: Characters in a line of comment; some readers refuse longer lines.
_LINE = 96
_F = TypeVar("_F", bound=Callable[[Path], "str | None"])


@dataclass(frozen=True)
class Record:
    """Program, job, scene and inputs of a file."""

    #: Version of the program.
    version: str
    #: The job, in the form of `spacemap_vtk.jobs.job.Job.as_json`.
    order: Mapping[str, Any]
    #: The whole scene as it was run, in the form of a scene file.
    scene: str
    #: Name of the scene file.
    file: str = ""
    #: Time that is shown, in s, or the first and the last one.
    times: tuple[float, ...] = ()
    #: Digests of the files that were read, by their paths as the scene names them.
    inputs: Mapping[str, str] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The record as JSON."""
        return json.dumps(asdict(self), separators=(",", ":"))


_current: ContextVar[Record | None] = ContextVar("record", default=None)
_finders: dict[str, Callable[[Path], str | None]] = {}


@contextmanager
def attach_record(record: Record | None) -> Iterator[None]:
    """Add a record to all files that are written inside the block."""
    token = _current.set(record)
    try:
        yield
    finally:
        _current.reset(token)


@contextmanager
def attach_record_at(time: float, **more: Any) -> Iterator[None]:
    """Add the record of one time of a series to all files that are written inside the block."""
    record = _current.get()
    if record is not None:
        record = replace(record, times=(time,))
    with attach_record(record), attach_order(times=[time], **more):
        yield


@contextmanager
def attach_order(**more: Any) -> Iterator[None]:
    """Add the record, with other values of the job, to all files written inside the block."""
    record = _current.get()
    if record is not None:
        record = replace(record, order={**record.order, **more})
    with attach_record(record):
        yield


def record_text() -> str:
    """Return the record of the file that is being written, or an empty string."""
    record = _current.get()
    return "" if record is None else record.text


def record_comments(sign: str) -> list[str]:
    """Return the record as lines of comment that begin with `sign`; none without a record."""
    text = record_text().replace("--", "-\\u002d")  # XML allows no "--" in a comment
    parts = [text[begin : begin + _LINE] for begin in range(0, len(text), _LINE)]
    return [f"{sign} {NAME}: {part}|" for part in parts]


def finds_record(*endings: str) -> Callable[[_F], _F]:
    """Register a finder of records for some endings; None or an error means no record."""

    def register(function: _F) -> _F:
        _finders.update(dict.fromkeys(endings, function))
        return function

    return register


def find_record_in_comments(path: Path) -> str | None:
    """Find a record in lines of comment, whatever sign begins them."""
    with path.open("rb") as stream:
        begin = stream.read(_MOST)
    found = re.findall(rb"^[ #;*]*(?:comment )?%s: (.*)\|\r?$" % NAME.encode(), begin, re.M)
    return b"".join(found).decode("ascii", "replace") or None


def read_record(path: Path) -> Record | None:
    """Return the record of a file, or None if it has none."""
    import_module("spacemap_vtk.io.formats")
    teller = _finders.get(path.suffix.lower())
    try:
        text = None if teller is None else teller(path)
    except (SpacemapError, PermissionError):
        raise
    # These errors mean that another program made the file. SyntaxError comes from Pillow.
    except (OSError, ValueError, LookupError, TypeError, SyntaxError, RecursionError):
        return None
    return None if text is None else _parse_record(text, path)


def _parse_record(text: str, path: Path) -> Record:
    # The file may come from a stranger: its form is checked, and its content is not trusted.
    try:
        if len(text) > _MOST:
            raise ValueError(f"{len(text)} characters are too many")
        given = json.loads(text)
        inputs = {str(name): str(digest) for name, digest in given["inputs"].items()}
        version, scene, file = (str(given[key]) for key in ("version", "scene", "file"))
        times = tuple(float(time) for time in given["times"])
        return Record(version, dict(given["order"]), scene, file, times, inputs)
    except (
        ArithmeticError,
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        RecursionError,
    ) as error:
        raise InputError(
            f"{path}: its provenance record is damaged: {error}"[:300], key="file"
        ) from None


def record_endings() -> list[str]:
    """Return the endings of formats that can store a record."""
    import_module("spacemap_vtk.io.formats")
    return sorted(_finders)
