"""Read VTK's legacy files if they are whole; VTK's reader reads wild memory where data are missing.

`is_truncated` finds this out by reading a file's keywords.
"""

from __future__ import annotations

import re
from pathlib import Path

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import lazy_function, reads, truncated_error

#: Bytes of each type. VTK's ids are written as four; "long" has four on Windows, eight elsewhere.
_BYTES = {
    **dict.fromkeys(("char", "unsigned_char", "signed_char"), 1),
    **dict.fromkeys(("short", "unsigned_short"), 2),
    **dict.fromkeys(("int", "unsigned_int", "float", "vtkIdType"), 4),
    **dict.fromkeys(("double", "long_long", "unsigned_long_long"), 8),
    **dict.fromkeys(("vtktypeint32", "vtktypeuint32"), 4),
    **dict.fromkeys(("vtktypeint64", "vtktypeuint64"), 8),
}
#: Components of attributes whose line does not state them.
_COMPONENTS = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6, "GLOBAL_IDS": 1}
_COMPONENTS |= {"PEDIGREE_IDS": 1, "EDGE_FLAGS": 1}
_CELLS = {"CELLS", "POLYGONS", "LINES", "VERTICES", "TRIANGLE_STRIPS"}
#: Keywords that no numbers follow in the next lines.
_PLAIN = {"DATASET", "DIMENSIONS", "SPACING", "ORIGIN", "ASPECT_RATIO"}


def _check(path: Path) -> None:
    if is_truncated(path):
        raise truncated_error(path)


reads(".vtk", label="VTK legacy", holds="mesh", check=_check)(
    lazy_function("reading", "read_with_vtk", "vtkIOLegacy", "vtkGenericDataObjectReader")
)


def is_truncated(path: Path) -> bool:
    """Return whether a legacy .vtk file ends before its last array is complete."""
    content = path.read_bytes()
    if not content.startswith(b"# vtk"):
        raise InputError(f'{path}: not a legacy .vtk file: it does not begin with "# vtk"')
    # With the wrong size of "long" a file may be unreadable; that result does not count.
    ends = [_ends_early(content, size) for size in (8, 4)]
    return True in ends and False not in ends


def _ends_early(content: bytes, long: int) -> bool | None:
    try:
        _LegacyScanner(content, long).run()
    except (_UnknownContentError, ValueError, IndexError, KeyError):
        return None
    except EOFError:
        return True
    return False


class _UnknownContentError(Exception):
    pass


class _LegacyScanner:
    """A walk through a file from keyword to keyword, which skips the numbers between them."""

    def __init__(self, content: bytes, long: int) -> None:
        self.content, self.at, self.rows = content, 0, 1
        self.bytes = {**_BYTES, "long": long, "unsigned_long": long}
        self.line(), self.line()
        self.binary = self.line().strip().upper() == "BINARY"

    def line(self) -> str:
        if self.at >= len(self.content):
            raise EOFError
        end = self.content.find(b"\n", self.at)
        end = len(self.content) if end < 0 else end
        text = self.content[self.at : end].decode("latin-1")
        self.at = end + 1
        return text

    def words(self) -> list[str]:
        """Return the words of the next line that is not empty; none at the end."""
        while self.at < len(self.content):
            words = self.line().split()
            if words:
                return words
        return []

    def numbers(self, count: int, kind: str) -> None:
        if count and not self.binary:
            found, self.at = _skip_words(self.content, self.at, count)
            if found < count:
                raise EOFError
            return
        if kind in ("string", "bit", "variant"):
            raise _UnknownContentError
        self.at += count * self.bytes[kind]
        if self.at > len(self.content):
            raise EOFError

    def run(self) -> None:
        if not self.words():
            raise EOFError
        while words := self.words():
            self.part(words)

    def part(self, words: list[str]) -> None:
        name = words[0].upper()
        if name == "METADATA":
            while self.at < len(self.content) and self.line().strip():
                pass
        elif name in ("POINTS", "X_COORDINATES", "Y_COORDINATES", "Z_COORDINATES"):
            self.numbers(int(words[1]) * (3 if name == "POINTS" else 1), words[2])
        elif name in _CELLS:
            self.cells(int(words[1]), int(words[2]))
        elif name == "CELL_TYPES":
            self.numbers(int(words[1]), "int")
        elif name in ("POINT_DATA", "CELL_DATA"):
            self.rows = int(words[1])
        elif name == "SCALARS":
            if self.words()[:1] != ["LOOKUP_TABLE"]:
                raise _UnknownContentError
            self.numbers(self.rows * (int(words[3]) if len(words) > 3 else 1), words[2])
        elif name == "COLOR_SCALARS":
            self.numbers(self.rows * int(words[2]), "unsigned_char")
        elif name == "TEXTURE_COORDINATES":
            self.numbers(self.rows * int(words[2]), words[3])
        elif name in _COMPONENTS:
            self.numbers(self.rows * _COMPONENTS[name], words[2])
        elif name == "LOOKUP_TABLE":
            self.numbers(4 * int(words[2]), "unsigned_char")
        elif name == "FIELD":
            for _ in range(int(words[2])):
                self.array()
        elif name not in _PLAIN:
            raise _UnknownContentError

    def array(self) -> None:
        words = self.words()
        while words[:1] == ["METADATA"]:
            self.part(words)
            words = self.words()
        if len(words) < 4:
            raise EOFError
        self.numbers(int(words[1]) * int(words[2]), words[3])

    def cells(self, first: int, second: int) -> None:
        before = self.at
        words = self.words()
        if words[:1] != ["OFFSETS"]:  # before version 5: sizes and numbers in one list
            self.at = before
            self.numbers(second, "int")
            return
        self.numbers(first, words[1])
        words = self.words()
        if words[:1] != ["CONNECTIVITY"]:
            raise EOFError
        self.numbers(second, words[1])


def _skip_words(content: bytes, begin: int, count: int) -> tuple[int, int]:
    """Return the number of words that follow, at most `count`, and where the last one ends."""
    done, at = 0, begin
    # The file is split in pieces: all of its words at once would need too much memory.
    while done < count and at < len(content):
        piece = content[at : at + 2**22]
        if at + len(piece) < len(content):
            piece = piece[: max(piece.rfind(b"\n"), piece.rfind(b" ")) + 1] or piece
        found = len(piece.split())
        if done + found >= count:
            ends = [match.end() for match in re.finditer(rb"\S+", piece)]
            return count, at + ends[count - done - 1]
        done, at = done + found, at + len(piece)
    return done, at
