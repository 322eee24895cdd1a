"""Read and write scene files in TOML."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import SCENE_KINDS, reader_endings, reads

#: Most bytes of a scene; parsing longer ones takes hours.
_LONGEST = 2**24
#: Longest line of a list, and longest table of a list that is written in one line.
_WIDTH = 110
_SHORT = 90
#: Most names in one dotted key, for the same reason.
_NAMES = 16
_NONE: Mapping[tuple[str, str], str] = {}


def parse_toml(text: str) -> dict[str, Any]:
    """Parse a text in TOML; raise a ValueError that describes its fault."""
    import tomllib  # missing in Python 3.10, which some versions of ParaView bring

    name = r"""(?:[\w-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')"""
    if re.search(rf"(?<![\w\"'-])(?:{name}[ \t]*\.[ \t]*){{{_NAMES}}}", text):
        raise ValueError(f"a key has more than {_NAMES} names")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("brackets are nested too deeply") from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError:  # Python's own message gives advice for programmers
        raise ValueError("a number has thousands of digits") from None


@reads(".toml", label="Space mapping scene", holds="scene", rest=True)
def read_scene(path: Path) -> dict[str, Any]:
    """Return a scene's values as they are in its file."""
    try:
        if path.stat().st_size > _LONGEST:
            raise ValueError(f"the file has more than {_LONGEST} bytes")
        return parse_toml(path.read_text(encoding="utf-8"))
    except ValueError as error:
        if path.suffix.lower() != ".toml":
            raise InputError(
                f"{path}: the ending is not that of a scene, draft, mesh or textile",
                allowed=", ".join(e for kind in SCENE_KINDS for e in reader_endings(kind)),
            ) from None
        why, cure = str(error), 'Correct that line; strings need quotes, as in "0.3 mm".'
        if isinstance(error, UnicodeDecodeError):
            line = error.object.count(b"\n", 0, error.start) + 1
            why = f"line {line} has a byte {error.object[error.start]:#04x}, which is not UTF-8"
            cure = "Save it as UTF-8 in a text editor."
        elif path.stat().st_size <= _LONGEST and path.read_bytes().startswith(b"\xef\xbb\xbf"):
            why, cure = "the file begins with a byte order mark", "Save it as UTF-8 without BOM."
        raise InputError(
            f"{path}: not a scene: {why}",
            allowed='a TOML text in UTF-8 with sections such as [weave] (see "spacemap keys")',
            cure=cure,
        ) from None
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from None


def format_value(value: Any) -> str:
    """Return a value as TOML in one line; a mapping becomes an inline table."""
    if isinstance(value, Mapping):
        pairs = ", ".join(f"{key} = {format_value(item)}" for key, item in value.items())
        return f"{{{pairs}}}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(format_value, value))}]"
    # A JSON string, number or flag is TOML too.
    return json.dumps(value, ensure_ascii=False, default=str)


def format_scene(
    values: Mapping[str, Any], comment: str, remarks: Mapping[tuple[str, str], str] = _NONE
) -> str:
    """Return the text of a scene file, with a comment on its origin and remarks behind keys."""
    lines = [f"# {comment}"]
    for section, content in values.items():
        if not isinstance(content, Mapping):
            lines.insert(1, f"{section} = {format_value(content)}")
            continue
        remark = remarks.get((section, ""))
        lines += ["", f"[{section}]" + (f"    # {remark}" if remark else "")]
        tables = {key: value for key, value in content.items() if _is_long_tables(value)}
        for key, value in content.items():
            remark = remarks.get((section, key))
            behind = f"    # {remark}" if remark else ""
            if key not in tables:
                first, *more = _format_lines(key, value)
                lines += [first + behind, *more]
        for key, value in tables.items():
            remark = remarks.get((section, key))
            lines += ["", f"# {remark}"] if remark else []
            for number, table in enumerate(value):
                lines += [""] * (number > 0 or not remark) + [f"[[{section}.{key}]]"]
                lines += [
                    line for name, item in table.items() for line in _format_lines(name, item)
                ]
    return "\n".join(lines) + "\n"


def _format_lines(key: str, value: Any) -> list[str]:
    """Return a key and its value in one line, or a long list in several, as wide as a page."""
    text = f"{key} = {format_value(value)}"
    if len(text) <= _WIDTH or not isinstance(value, (list, tuple)) or len(value) < 2:
        return [text]
    lines = [f"{key} = ["]
    for item in value:
        word = f"{format_value(item)},"
        if len(lines) > 1 and len(lines[-1]) + 1 + len(word) <= _WIDTH:
            lines[-1] += f" {word}"
        else:
            lines.append(f"    {word}")
    return [*lines, "]"]


def _is_long_tables(value: Any) -> bool:
    """Return whether a value is a list of tables, at least one of which is no short line."""
    if not isinstance(value, (list, tuple)) or not all(isinstance(item, Mapping) for item in value):
        return False
    return any(len(format_value(item)) > _SHORT or len(item) > 2 for item in value)
