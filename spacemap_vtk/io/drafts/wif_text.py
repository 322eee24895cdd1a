"""Text of a Weaving Information File (WIF): sections, entries, values and warnings.

This module knows nothing about weaving. It reads a file line by line and does not use
`configparser`, which has no line numbers, refuses what weaving programs write, and takes ``;`` in
a title for a comment.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from decimal import Decimal

from spacemap_vtk.errors import InfoMessage, InputError, SizeError

#: Highest number of a thread, shaft or treadle; also the most threads in a family.
MAX_NUMBER = 100_000
#: Most bytes or characters in a file.
MAX_LENGTH = 2**26

_NEWLINE = re.compile("\r\n|\r|\n")
# Not \d, which matches the digits of every script: int() reads them all, Decimal may not.
_DECIMAL = re.compile(
    r"[-+]?(?:[0-9]{1,40}(?:\.[0-9]{0,40})?|\.[0-9]{1,40})(?:[eE][-+]?[0-9]{1,3})?"
)
_LIST = re.compile(r"[0-9]+(?:[\s,]+[0-9]+)*")
_TRUE = frozenset({"true", "on", "yes", "1", "t", "y"})
_FALSE = frozenset({"false", "off", "no", "0", "f", "n"})

_SINGLE_SECTIONS = ("THREADING", "TIEUP", "TREADLING", "LIFTPLAN", "COLOR PALETTE", "COLOR TABLE")
_FAMILY_PARTS = ("", " COLORS", " SPACING", " THICKNESS")
_DROPPED_PARTS = (
    " SYMBOL PALETTE",
    " SYMBOL TABLE",
    " SYMBOLS",
    " SPACING ZOOM",
    " THICKNESS ZOOM",
)
_FAMILIES = ("WARP", "WEFT")

#: Sections whose entries are read.
READ = frozenset(
    {"WIF", "CONTENTS", "TEXT", "WEAVING", *_SINGLE_SECTIONS}.union(
        family + part for family in _FAMILIES for part in _FAMILY_PARTS
    )
)
#: Sections of the standard that show the threads or the cloth in another way. They are dropped,
#: because they would be wrong after the draft is edited.
DROPPED = frozenset(
    {"DESIGN", "BITMAP IMAGE", "BITMAP FILE", "BITMAP IMAGE DATA"}.union(
        family + part for family in _FAMILIES for part in _DROPPED_PARTS
    )
)
#: Sections of the standard that say nothing about the cloth; their lines are not parsed.
SKIPPED = DROPPED | {"NOTES", "TRANSLATIONS"}


class WarningList:
    """Warnings with line numbers: one for each kind, with the number of cases."""

    def __init__(self) -> None:
        self._cases: dict[str, list[tuple[int, str]]] = {}
        self._doubtful: set[str] = set()

    def add(self, line: int, text: str, kind: str = "", doubtful: bool = False) -> None:
        """Add a warning if the cloth may differ from the intended one (doubtful), else a remark."""
        self._cases.setdefault(kind or text, []).append((line, text))
        if doubtful:
            self._doubtful.add(kind or text)

    def texts(self) -> tuple[str, ...]:
        """Return the warnings and remarks in the order of their lines."""
        texts = []
        for cases, kind in sorted((sorted(cases), kind) for kind, cases in self._cases.items()):
            (line, text), last = cases[0], cases[-1][0]
            more = f" (and {len(cases) - 1} more, the last in line {last})" if cases[1:] else ""
            message = f"line {line}: {text}{more}"
            texts.append(message if kind in self._doubtful else InfoMessage(message))
        return tuple(texts)


@dataclass(frozen=True)
class Entry:
    """One ``key=value`` line."""

    #: Section in capitals; key and value as in the file, without comments and outer blanks.
    section: str
    key: str
    value: str
    #: Line number, counted from 1.
    line: int

    def error(self, what: str, allowed: str, kind: type[InputError] = InputError) -> InputError:
        """Return the error for this entry, with its line."""
        return kind(
            f"line {self.line}: {what}",
            key=f"[{self.section}] {self.key}",
            value=self.value,
            allowed=allowed,
            cure="Correct the line, or export the draft again from the weaving program.",
        )


@dataclass
class WifSection:
    """A section; sections of the same name are merged."""

    #: In capitals, with single blanks.
    name: str
    #: Line number of its first header.
    line: int
    #: Entries by key. Keys are in lower case; numbers have no leading zeros.
    entries: dict[str, Entry] = field(default_factory=dict)
    #: Lines of a section that is not parsed, as they are in the file.
    lines: list[str] = field(default_factory=list)


def decode(data: bytes, warnings: WarningList) -> str:
    """Decode a file: UTF-8 with or without BOM, UTF-16 with BOM, else Latin-1."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        warnings.add(
            1, "the file is UTF-16, which the standard does not allow; it is read as UTF-16"
        )
        return data.decode("utf-16", errors="replace")
    data = data.removeprefix(b"\xef\xbb\xbf")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = len(_NEWLINE.findall(data[: error.start].decode("latin-1"))) + 1
        warnings.add(line, "a character is neither ASCII nor UTF-8; the file is read as Latin-1")
        return data.decode("latin-1")


class WifText:
    """The text of a file, divided into sections."""

    def __init__(self, text: str, warnings: WarningList) -> None:
        self.sections: dict[str, WifSection] = {}
        self.warnings = warnings
        self.last = 1
        current: WifSection | None = None
        for number, raw in enumerate(_NEWLINE.split(text.removeprefix("\ufeff")), start=1):
            line = raw.strip()
            if not line:
                continue
            self.last = number
            if line.startswith(";"):
                continue
            if line.startswith("["):
                current = _open_section(line, number, self.sections, warnings)
            elif current is None:
                warnings.add(number, "text before the first section is ignored", "preamble")
            elif current.name in READ:
                _add_entry(line, number, current, warnings)
            elif current.name not in DROPPED:
                current.lines.append(raw.rstrip())

    def entry(self, section: str, key: str) -> Entry | None:
        """Return the entry of a key, or None if it is missing or empty."""
        found = self.sections.get(section)
        entry = found.entries.get(key) if found else None
        return entry if entry and entry.value else None

    @property
    def besides(self) -> dict[str, tuple[str, ...]]:
        """Lines that are kept but are not part of the draft, such as author and notes."""
        texts = self.sections["TEXT"].entries if "TEXT" in self.sections else {}
        lines = {"TEXT": [f"{e.key}={e.value}" for key, e in texts.items() if key != "title"]}
        lines |= {name: section.lines for name, section in self.sections.items() if section.lines}
        return {name: tuple(kept) for name, kept in lines.items() if kept}

    def line(self, *sections: str, key: str = "") -> int:
        """Return the line of a key, else of the first section that exists, else 1."""
        found = next((self.sections[name] for name in sections if name in self.sections), None)
        if found is None:
            return 1
        return found.entries[key].line if key in found.entries else found.line

    def note_beyond(self, entry: Entry, threads: int) -> None:
        """Warn that an entry is for a thread that the cloth does not have."""
        section = entry.section
        what = f"[{section}] {entry.key[:12]} is beyond the {threads} threads and is ignored"
        self.warnings.add(entry.line, what, f"beyond {section}")

    def numbered(self, section: str) -> dict[int, Entry]:
        """Return the entries of a section by number: of a thread, treadle or colour."""
        found = self.sections.get(section)
        rows = {}
        for key, entry in found.entries.items() if found else ():
            if re.fullmatch("[0-9]+", key) and key != "0":
                rows[parse_integer(key)] = entry
            else:
                what = f'[{section}] "{entry.key[:40]}" is not a number from 1 and is ignored'
                self.warnings.add(entry.line, what, f"key {section}")
        return rows


def _open_section(
    line: str, number: int, sections: dict[str, WifSection], warnings: WarningList
) -> WifSection:
    title, bracket, _ = line[1:].partition("]")
    if not bracket:
        title = title.partition(";")[0]
        warnings.add(number, f'"{line[:40]}" has no "]"; it is read as a section', "bracket")
    name = " ".join(title.split()).upper()
    if name not in sections:
        sections[name] = WifSection(name, number)
        if name not in READ and name not in SKIPPED and not name.startswith("PRIVATE"):
            warnings.add(number, f"unknown section [{name[:40]}] is ignored", "unknown")
    elif name in READ:
        first = sections[name].line
        warnings.add(
            number, f"[{name}] is given twice, first in line {first}; both are read", "again"
        )
    return sections[name]


def _add_entry(line: str, number: int, section: WifSection, warnings: WarningList) -> None:
    # By the standard, a semicolon after a string belongs to it; only [TEXT] has strings.
    text = line if section.name == "TEXT" else line.partition(";")[0]
    name, equals, value = text.partition("=")
    name = " ".join(name.split())
    if not equals:
        warnings.add(
            number, f'"{line[:40]}" is not of the form key=value and is ignored', "no equals"
        )
        return
    key = (name.lstrip("0") or "0") if re.fullmatch("[0-9]+", name) else name.lower()
    if key in section.entries:
        earlier = section.entries[key].line
        what = f"[{section.name}] {name[:40]} is given twice, first in line {earlier}"
        warnings.add(number, f"{what}; the last value is used", f"twice {section.name}")
    section.entries[key] = Entry(section.name, name, value.strip(), number)


def parse_integer(digits: str) -> int:
    """Read a whole number of any length; above `MAX_NUMBER`, return `MAX_NUMBER` + 1."""
    digits = digits.lstrip("0") or "0"
    return MAX_NUMBER + 1 if len(digits) > 9 else min(int(digits), MAX_NUMBER + 1)


def parse_boolean(text: str) -> bool | None:
    """Read true, on, yes, t, y or 1 and their opposites, in any case; else return None."""
    word = text.strip().lower()
    return True if word in _TRUE else False if word in _FALSE else None


def parse_decimal(text: str) -> Decimal | None:
    """Read a real number exactly, or return None."""
    return Decimal(text) if _DECIMAL.fullmatch(text) else None


def parse_count(entry: Entry) -> int:
    """Read a number of threads, shafts or treadles; 0 if the value is empty."""
    if not entry.value:
        return 0
    value = parse_decimal(entry.value)
    allowed = f"a whole number from 1 to {MAX_NUMBER}"
    if value is None or value < 0 or value != value.to_integral_value():
        raise entry.error("the value must be a whole number", allowed)
    if value > MAX_NUMBER:
        raise entry.error("the value is too large", allowed, SizeError)
    return int(value)


def parse_numbers(entry: Entry, warnings: WarningList) -> tuple[int, ...]:
    """Read a list of shafts or treadles, in ascending order and without 0."""
    allowed = f"numbers from 1 to {MAX_NUMBER} with commas between them, or 0 for none"
    match = _LIST.match(entry.value)
    if match is None:
        if entry.value:
            raise entry.error("the value must be a list of numbers", allowed)
        return ()
    rest = entry.value[match.end() :].strip(" \t,")
    if re.search("[0-9]", rest):
        # Ignoring a number in the middle would weave another cloth without a warning.
        raise entry.error("the value must be a list of numbers", allowed)
    if rest:
        warnings.add(entry.line, f'"{rest[:40]}" after the numbers is ignored', "rest")
    items = match.group().replace(",", " ").split()
    if len(items) - 1 > match.group().count(","):
        warnings.add(entry.line, "spaces between the numbers are read as commas", "blanks")
    values = {parse_integer(item) for item in items}
    if max(values) > MAX_NUMBER:
        raise entry.error("the number is too large", allowed, SizeError)
    return tuple(sorted(values - {0}))
