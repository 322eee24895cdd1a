"""Colours, spacing and thickness of the threads in a Weaving Information File.

They do not change how the cloth is woven. A value that cannot be read causes a warning, never an
error.
"""

from __future__ import annotations

import re
from decimal import Decimal

import numpy as np

from spacemap_vtk.io.drafts.wif_text import Entry, WifText, parse_decimal
from spacemap_vtk.ndarrays import Bytes
from spacemap_vtk.textile.weave.threads import Lengths

_Color = tuple[Decimal, Decimal, Decimal]

#: Length of a unit in m, by its spellings in lower case without blanks, points and hyphens.
UNITS: dict[str, Decimal] = {
    # Units of the standard; a decipoint is 1/720 inch.
    **dict.fromkeys(
        ("decipoints", "decipoint", "decipts", "decipt", "dpts", "dpt", "dp"),
        Decimal("0.0254") / 720,
    ),
    **dict.fromkeys(("inches", "inch", "ins", "in", '"'), Decimal("0.0254")),
    **dict.fromkeys(
        ("centimeters", "centimeter", "centimetres", "centimetre", "cms", "cm"), Decimal("0.01")
    ),
}
#: Length in m of units that the standard does not have.
OTHER_UNITS: dict[str, Decimal] = dict.fromkeys(
    ("millimeters", "millimeter", "millimetres", "millimetre", "mm"), Decimal("0.001")
)
# Least length in m; a smaller one is a mistake.
_THINNEST = Decimal("1e-6")
# Largest length in m; a larger one is a mistake (a spacing of 24 for 24 ends per inch).
_THICKEST = Decimal(1)


def read_colors(text: WifText, ends: int, picks: int) -> tuple[Bytes | None, Bytes | None]:
    """Read the colours of warp and weft, scaled to 0 to 255; None if there are none."""
    # A colour is ``index``, an entry of [COLOR TABLE], or in an older form ``index,r,g,b``. By the
    # standard the table has precedence; r, g, b are used if the table has no such entry.
    palette = _Palette(text)
    warp, weft = palette.thread_colors("WARP", ends), palette.thread_colors("WEFT", picks)
    used = {*(warp or ()), *(weft or ())}
    if not used:
        return None, None
    low, high = palette.bounds or palette.assume_range(used)
    eight_bit = {color: [_scale(value, low, high) for value in color] for color in used}
    warp_colors, weft_colors = (
        np.array([eight_bit[color] for color in family], np.uint8) if family else None
        for family in (warp, weft)
    )
    return warp_colors, weft_colors


class _Palette:
    """[COLOR PALETTE] and [COLOR TABLE], with colours as in the file, not yet scaled."""

    def __init__(self, text: WifText) -> None:
        self.text = text
        self.bounds = self._bounds()
        self.table: dict[int, _Color] = {}
        for index, entry in text.numbered("COLOR TABLE").items():
            items = _parse_decimals(entry.value)
            if len(items) == 3:
                self.table[index] = self._check_color(entry, items)
            elif entry.value:
                text.warnings.add(
                    entry.line, f'"{entry.value[:40]}" is not r,g,b; it is ignored', "table"
                )
        self._check_head()

    def _check_head(self) -> None:
        form = self.text.entry("COLOR PALETTE", "form")
        if form and form.value.upper() != "RGB":
            self.text.warnings.add(form.line, f"Form={form.value[:40]} is read as RGB")
        entries = self.text.entry("COLOR PALETTE", "entries")
        if entries and parse_decimal(entries.value) != len(self.table):
            what = f"Entries={entries.value[:40]}, but [COLOR TABLE] has {len(self.table)}"
            self.text.warnings.add(entries.line, f"{what}; the table is used")

    def _bounds(self) -> tuple[int, int] | None:
        entry = self.text.entry("COLOR PALETTE", "range")
        bounds = re.findall("[0-9]{1,9}", entry.value) if entry else []
        if len(bounds) != 2 or int(bounds[0]) >= int(bounds[1]):
            return None
        return int(bounds[0]), int(bounds[1])

    def assume_range(self, used: set[_Color]) -> tuple[int, int]:
        """Return a range that contains all colours, for a file without a readable Range."""
        peak = max(value for color in {*used, *self.table.values()} for value in color)
        high = next((bound for bound in (255, 999, 65535) if peak <= bound), int(peak) + 1)
        entry = self.text.entry("COLOR PALETTE", "range")
        line = self.text.line("COLOR PALETTE", "COLOR TABLE", "WARP", "WEFT", key="range")
        what = f'"{entry.value[:40]}" cannot be read' if entry else "is missing"
        self.text.warnings.add(line, f"the Range of the colours {what}; 0,{high} is assumed")
        return 0, high

    def _check_color(self, entry: Entry, color: tuple[Decimal, ...]) -> _Color:
        low, high = self.bounds or (0, None)
        if min(color) < low or (high is not None and max(color) > high):
            what = f"colour {entry.value[:40]} is outside the Range and is clipped to it"
            self.text.warnings.add(entry.line, what, "clipped", doubtful=True)
        red, green, blue = color
        return red, green, blue

    def thread_colors(self, family: str, threads: int) -> list[_Color] | None:
        """Return each thread's colour, or None if the file gives the family none."""
        section = f"{family} COLORS"
        default = self.text.entry(family, "color")
        base = self._color(default) if default else None
        own = {}
        for thread, entry in entries_within(self.text, section, threads).items():
            color = self._color(entry)
            if color is not None:
                own[thread] = color
        if base is None:
            if not own:
                return None
            first = min(own)
            base = own[first]
            if len(own) < threads:
                what = f"{threads - len(own)} threads have no colour in [{section}] or [{family}];"
                what += f" they get that of thread {first}"
                self.text.warnings.add(self.text.line(section), what)
        return [own.get(thread, base) for thread in range(1, threads + 1)]

    def _color(self, entry: Entry) -> _Color | None:
        items = _parse_decimals(entry.value)
        if len(items) == 3:
            what = "three numbers for a colour are read as r,g,b"
            self.text.warnings.add(entry.line, what, f"rgb {entry.section}")
            return self._check_color(entry, items)
        if not items:
            if entry.value:
                what = f'"{entry.value[:40]}" is not a colour; it is ignored'
                self.text.warnings.add(entry.line, what, "color", doubtful=True)
            return None
        if len(items) not in (1, 4):
            what = "numbers after the index of a colour are ignored"
            self.text.warnings.add(entry.line, what, "color rest")
        index = int(items[0]) if items[0] == items[0].to_integral_value() else 0
        if index in self.table:
            return self.table[index]
        if len(items) == 4:
            return self._check_color(entry, items[1:])
        what = f"colour {entry.value[:12]} is not in [COLOR TABLE]; it is ignored"
        self.text.warnings.add(entry.line, what, f"index {entry.section}", doubtful=True)
        return None


def _scale(value: Decimal, low: int, high: int) -> int:
    return min(max(round((value - low) * 255 / (high - low)), 0), 255)


def _parse_decimals(value: str) -> tuple[Decimal, ...]:
    """Read numbers separated by commas or blanks; return none if one cannot be read."""
    items = [parse_decimal(item) for item in re.split(r"[\s,]+", value.strip(" \t,"))]
    numbers = tuple(item for item in items if item is not None)
    return numbers if len(numbers) == len(items) else ()


def entries_within(text: WifText, section: str, threads: int) -> dict[int, Entry]:
    """Return the entries by thread, without those beyond the threads of the cloth."""
    kept = {}
    for thread, entry in text.numbered(section).items():
        if thread <= threads:
            kept[thread] = entry
        elif entry.value not in ("", "0"):
            text.note_beyond(entry, threads)
    return kept


def read_lengths(text: WifText, family: str, name: str, threads: int) -> Lengths | None:
    """Read a family's spacing or thickness in m: one value for all threads, or one for each."""
    section = f"{family} {name}"
    default = text.entry(family, name.lower())
    entries = [entry for entry in entries_within(text, section, threads).items() if entry[1].value]
    if default is None and not entries:
        return None
    size = _read_unit(text, family)
    base = _read_length(text, default, size) if default else None
    own = {
        thread: length
        for thread, entry in entries
        if (length := _read_length(text, entry, size)) is not None
    }
    if not own:
        return base
    mean = float(np.mean(list(own.values())))
    if base is None and len(own) < threads:
        what = f"threads without {name.lower()}, which [{family}] lacks, get the mean of the others"
        text.warnings.add(text.line(section), what)
    fill = mean if base is None else base
    lengths = np.array([own.get(thread, fill) for thread in range(1, threads + 1)])
    return fill if (lengths == fill).all() else lengths


def _read_length(text: WifText, entry: Entry, size: Decimal) -> float | None:
    value = entry.value
    if parse_decimal(value) is None and parse_decimal(value.replace(",", ".", 1)) is not None:
        text.warnings.add(entry.line, f'"{value[:40]}": the comma is read as a point', "comma")
        value = value.replace(",", ".", 1)
    number = parse_decimal(value)
    if number is None:
        what = f'{entry.key} "{value[:40]}" in [{entry.section}] is not a number; it is ignored'
        text.warnings.add(entry.line, what, f"length {entry.section}", doubtful=True)
        return None
    length = number * size
    if _THINNEST <= length <= _THICKEST:
        return float(length)
    if length == 0:
        what = f"{entry.key} of 0 in [{entry.section}] is treated as not given"
    else:
        what = f"{entry.key} {value[:40]} in [{entry.section}] is not between 1 µm and 1 m; ignored"
    text.warnings.add(entry.line, what, f"length {entry.section}", doubtful=length != 0)
    return None


def _read_unit(text: WifText, family: str) -> Decimal:
    """Return a family's unit in m; the standard requires Units where lengths are given."""
    entry = text.entry(family, "units")
    word = _unit_word(entry)
    if word in UNITS:
        return UNITS[word]
    if entry is not None and word in OTHER_UNITS:
        what = f"Units={entry.value} is not in the standard; it is accepted"
        text.warnings.add(entry.line, what, "other units")
        return OTHER_UNITS[word]
    line = text.line(family, f"{family} SPACING", f"{family} THICKNESS", key="units")
    what = f'unknown Units "{entry.value[:40]}"' if entry else f"[{family}] has no Units"
    other = text.entry("WEFT" if family == "WARP" else "WARP", "units")
    assumed = _unit_word(other) if _unit_word(other) in UNITS else "inches"
    text.warnings.add(line, f"{what}; {assumed} are assumed", f"units {family}", doubtful=True)
    return UNITS[assumed]


def _unit_word(entry: Entry | None) -> str:
    return re.sub(r"[\s.-]", "", entry.value.lower()) if entry else ""
