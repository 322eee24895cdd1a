"""Read numbers from text files: two columns, such as times and factors, or a single one."""

from __future__ import annotations

import re
from pathlib import Path

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import reads

_SEPARATOR = re.compile(r"\s*[,;\t]\s*|\s+")
#: A decimal comma, as in 1,5; spreadsheets of many countries write it, with semicolons between
#: columns.
_DECIMAL_COMMA = re.compile(r"(\d),(\d)")


@reads(".csv", ".txt", label="Table", holds="table", general=True, rest=True)
def read_table(path: Path) -> tuple[tuple[float, ...], ...]:
    """Read two columns of numbers."""
    return _read_columns(path, 2, "two numbers in each line")


@reads(".csv", ".txt", label="Column", holds="column", general=True, rest=True)
def read_column(path: Path) -> tuple[float, ...]:
    """Read a single column of numbers."""
    return _read_columns(path, 1, "one number in each line")[0]


def _read_columns(path: Path, count: int, allowed: str) -> tuple[tuple[float, ...], ...]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not text"
        raise InputError(
            f"{reason}: {path}", key="file", allowed="a table as text (.csv)"
        ) from None
    rows: list[tuple[float, ...]] = []
    heading = True
    for number, line in enumerate(text.splitlines(), 1):
        line = line.partition("#")[0].strip()
        if not line:
            continue
        if ";" in line or count == 1:
            line = _DECIMAL_COMMA.sub(r"\1.\2", line)
        words = _SEPARATOR.split(line)
        try:
            row = tuple(float(word) for word in words[:count])
            is_row = len(row) == count and (count > 1 or len(words) == 1)
        except ValueError:
            is_row = False
        if is_row:
            rows.append(row)
        elif not heading or line[0] in "+-.0123456789":
            raise InputError(f'line {number} of {path}: "{line[:80]}"', key="file", allowed=allowed)
        heading = False
    if not rows:
        raise InputError(f"{path} has no numbers", key="file", allowed=allowed)
    return tuple(zip(*rows, strict=True))
