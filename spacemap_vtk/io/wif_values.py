"""The values in a Weaving Information File: booleans, real numbers, counts, lists."""

from __future__ import annotations

import re
from decimal import Decimal

from spacemap_vtk.errors import SizeError
from spacemap_vtk.io.wif_text import MAX_NUMBER, Entry, Notes, whole

# No class \d: it takes the digits of every script, which int() reads and Decimal may not.
_DECIMAL = re.compile(
    r"[-+]?(?:[0-9]{1,40}(?:\.[0-9]{0,40})?|\.[0-9]{1,40})(?:[eE][-+]?[0-9]{1,3})?"
)
_LIST = re.compile(r"[0-9]+(?:[\s,]+[0-9]+)*")
_TRUE = frozenset({"true", "on", "yes", "1", "t", "y"})
_FALSE = frozenset({"false", "off", "no", "0", "f", "n"})


def boolean(text: str) -> bool | None:
    """Read true, on, yes or 1, and their opposites, in any case."""
    word = text.strip().lower()
    return True if word in _TRUE else False if word in _FALSE else None


def decimal(text: str) -> Decimal | None:
    """Read a real number exactly."""
    return Decimal(text) if _DECIMAL.fullmatch(text) else None


def count(entry: Entry) -> int:
    """Read how many threads, shafts or treadles there are."""
    if not entry.value:
        return 0
    value = decimal(entry.value)
    allowed = f"a whole number from 1 to {MAX_NUMBER}"
    if value is None or value < 0 or value != value.to_integral_value():
        raise entry.refusal("not a count", allowed)
    if value > MAX_NUMBER:
        raise entry.refusal("too many", allowed, SizeError)
    return int(value)


def numbers(entry: Entry, notes: Notes) -> tuple[int, ...]:
    """Read a list of shafts or treadles."""
    allowed = f"numbers from 1 to {MAX_NUMBER} with commas between them, or 0 for none"
    match = _LIST.match(entry.value)
    if match is None:
        if entry.value:
            raise entry.refusal("not a list of numbers", allowed)
        return ()
    rest = entry.value[match.end() :].strip(" \t,")
    if re.search("[0-9]", rest):
        # A number lost in the middle would weave another cloth without a word.
        raise entry.refusal("not a list of numbers", allowed)
    if rest:
        notes.add(entry.line, f'"{rest[:40]}" after the numbers is ignored', "rest")
    items = match.group().replace(",", " ").split()
    if len(items) - 1 > match.group().count(","):
        notes.add(entry.line, "blanks between the numbers are read as commas", "blanks")
    values = {whole(item) for item in items}
    if max(values) > MAX_NUMBER:
        raise entry.refusal("the number is too large", allowed, SizeError)
    return tuple(sorted(values - {0}))
