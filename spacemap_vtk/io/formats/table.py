"""Tables of numbers in text files: a column of times, a column of factors."""

from __future__ import annotations

import re
from pathlib import Path

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import reads

_BETWEEN = re.compile(r"\s*[,;\t]\s*|\s+")
#: 1,5 and 0,2 in a line that has semicolons, as spreadsheets of half the world write numbers.
_DECIMAL_COMMA = re.compile(r"(\d),(\d)")


@reads(".csv", ".txt", label="Table", holds="table", general=True, rest=True)
def read_table(path: Path) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Read two columns of numbers."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not a text"
        raise InputError(
            f"{reason}: {path}", key="file", allowed="a table as text (.csv)"
        ) from None
    rows: list[tuple[float, float]] = []
    heading = True
    for number, line in enumerate(text.splitlines(), 1):
        line = line.partition("#")[0].strip()
        if not line:
            continue
        if ";" in line:
            line = _DECIMAL_COMMA.sub(r"\1.\2", line)
        try:
            time, value = (float(word) for word in _BETWEEN.split(line)[:2])
        except ValueError:
            if not heading:
                raise InputError(
                    f'line {number} of {path}: "{line}"',
                    key="file",
                    allowed="two numbers in each line, time in s and factor",
                ) from None
        else:
            rows.append((time, value))
        heading = False
    if not rows:
        raise InputError(
            f"{path} has no numbers", key="file", allowed="lines of time in s and factor"
        )
    times, values = zip(*rows, strict=True)
    return times, values
