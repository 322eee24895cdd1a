"""How a file came to be, inside the file: program, scene, order and digests of what was read.

Whoever has a file made says so once, by `recorded`; each writer puts `told` where its format has
room for it, and a function under `tells` finds it there again. It is JSON in ASCII, so that any
format takes it, and knows no date, user or folder: the same order gives the same bytes anywhere.
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

#: What the record is called in every file.
NAME = "spacemap-record"
#: Bytes that a record may have, and at the beginning of how many it is looked for.
_MOST = 2**23
#: Characters of a line of comment: there are readers that take no longer ones.
_LINE = 96
_F = TypeVar("_F", bound=Callable[[Path], "str | None"])


@dataclass(frozen=True)
class Record:
    """What a file was made of, and by what."""

    #: Of the program that made it.
    version: str
    #: What was asked for, beside the scene: a job as `spacemap_vtk.jobs.job.Job.as_json` has it.
    order: Mapping[str, Any]
    #: The whole scene as it was run, as a scene file has it.
    scene: str
    #: The name of the scene's file.
    file: str = ""
    #: What is shown: a time in s, or the first and the last.
    times: tuple[float, ...] = ()
    #: Digests of files that were read, by their paths as the scene names them.
    inputs: Mapping[str, str] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """It as JSON."""
        return json.dumps(asdict(self), separators=(",", ":"))


_current: ContextVar[Record | None] = ContextVar("record", default=None)
_tellers: dict[str, Callable[[Path], str | None]] = {}


@contextmanager
def recorded(record: Record | None) -> Iterator[None]:
    """Let what is written meanwhile have a record."""
    token = _current.set(record)
    try:
        yield
    finally:
        _current.reset(token)


@contextmanager
def recorded_at(time: float, **more: Any) -> Iterator[None]:
    """Let what is written meanwhile have the record of one of its series' times."""
    record = _current.get()
    if record is not None:
        order = {**record.order, "times": [time], **more}
        record = replace(record, order=order, times=(time,))
    with recorded(record):
        yield


def told() -> str:
    """Return the record of what is being written; empty where there is none."""
    record = _current.get()
    return "" if record is None else record.text


def comments(sign: str) -> list[str]:
    """Return the record as lines of comment that begin with a sign; none where there is none."""
    text = told().replace("--", "-\\u002d")  # which no comment of XML's has
    parts = [text[begin : begin + _LINE] for begin in range(0, len(text), _LINE)]
    return [f"{sign} {NAME}: {part}|" for part in parts]


def tells(*endings: str) -> Callable[[_F], _F]:
    """Register what finds the record in files of some endings; None, or a fault: there is none."""

    def register(function: _F) -> _F:
        _tellers.update(dict.fromkeys(endings, function))
        return function

    return register


def told_in_comments(path: Path) -> str | None:
    """Find a record in lines of comment, whatever their sign."""
    with path.open("rb") as stream:
        begin = stream.read(_MOST)
    found = re.findall(rb"^[ #;*]*(?:comment )?%s: (.*)\|\r?$" % NAME.encode(), begin, re.M)
    return b"".join(found).decode("ascii", "replace") or None


def record_in(path: Path) -> Record | None:
    """Return the record of a file; None where it has none."""
    import_module("spacemap_vtk.io.formats")
    teller = _tellers.get(path.suffix.lower())
    try:
        text = None if teller is None else teller(path)
    except (SpacemapError, PermissionError):
        raise
    # What is not as ours: of another's file. A SyntaxError is Pillow's.
    except (OSError, ValueError, LookupError, TypeError, SyntaxError, RecursionError):
        return None
    return None if text is None else _parsed(text, path)


def _parsed(text: str, path: Path) -> Record:
    # It may be a stranger's: nothing of it is believed but its form.
    try:
        if len(text) > _MOST:
            raise ValueError(f"it has {len(text)} characters")
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
            f"{path}: the record of how it was made is damaged: {error}"[:300], key="file"
        ) from None


def endings() -> list[str]:
    """Return the endings of files that have room for a record."""
    import_module("spacemap_vtk.io.formats")
    return sorted(_tellers)
