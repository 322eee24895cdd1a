"""Read Weaving Information Files (WIF 1.1) as weaving programs really write them.

`wif_text` divides a file into entries, this module reads the loom from them, `wif_threads` reads
the colours and sizes of the threads, and `wif_writer` writes a file.

Rules, some of which go beyond the standard:

- If a file breaks the standard and its meaning is clear, a warning says so: once for all cases of a
  kind, with the line of the first. What the standard allows (sparse sections, several treadles,
  comments after values, any order and case) causes no warning.
- Data that determine the cloth (threading, tie-up, treadling, liftplan, counts) must be readable; a
  wrong guess would weave another cloth. Unreadable colours and sizes are ignored with a warning.
- Treadling with tie-up has precedence over the liftplan, unless it presses no treadle.
- If Rising Shed is missing, the shed is rising. A sinking shed moves the named shafts down: each
  end in none of these shafts, threaded or not, lies over the pick.
- If Units are missing, those of the other family are used, else inches.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from spacemap_vtk.errors import InputError, SizeError
from spacemap_vtk.io.drafts.draft_bytes import MAX_CROSSINGS, loose_threads, read_draft_bytes
from spacemap_vtk.io.drafts.wif_text import (
    MAX_LENGTH,
    MAX_NUMBER,
    Entry,
    WarningList,
    WifText,
    decode,
    parse_boolean,
    parse_count,
    parse_decimal,
    parse_numbers,
)
from spacemap_vtk.io.drafts.wif_threads import read_colors, read_lengths
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.loom import Loom, Rows

#: Lists of a section: entry and numbers by thread or treadle.
_RowEntries = dict[int, tuple[Entry, tuple[int, ...]]]

_CURE = "Check that the WIF file is complete, or export it again from the weaving program."


def read_wif(path: str | os.PathLike[str]) -> Draft:
    """Read a Weaving Information File."""
    try:
        return parse_wif(read_draft_bytes(Path(path)))
    except InputError as error:
        error.file = os.fsdecode(path)
        raise


def parse_wif(data: str | bytes) -> Draft:
    """Read a Weaving Information File from its content."""
    if len(data) > MAX_LENGTH:
        raise SizeError("the file is too large", allowed=f"up to {MAX_LENGTH} bytes", cure=_CURE)
    warnings = WarningList()
    text = WifText(decode(data, warnings) if isinstance(data, bytes) else data, warnings)
    if not {"WEAVING", "WARP", "WEFT", "THREADING", "TREADLING", "LIFTPLAN"} & set(text.sections):
        raise _missing_error(text, "the file has no section of a draft")
    _check_header(text)
    loom = _read_loom(text)
    ends, picks = len(loom.threading), len(loom.sheds())
    colors = read_colors(text, ends, picks)
    warp, weft = (
        DraftThreads(
            spacing=read_lengths(text, family, "SPACING", count),
            thickness=read_lengths(text, family, "THICKNESS", count),
            colors=own,
        )
        for family, count, own in zip(("WARP", "WEFT"), (ends, picks), colors, strict=True)
    )
    title = text.entry("TEXT", "title")
    return Draft(
        *(loom.drawdown(), loom, warp, weft, title.value if title else ""),
        warnings=warnings.texts(),
        other_sections=text.besides,
    )


def _missing_error(text: WifText, message: str, section: str = "") -> InputError:
    """Return the error for a missing part, with the line of the section or the last line."""
    line = text.sections[section].line if section in text.sections else text.last
    allowed = "a draft in the WIF format, version 1.1"
    return InputError(f"line {line}: {message}", allowed=allowed, cure=_CURE)


def _check_header(text: WifText) -> None:
    """Add one warning for all faults of [WIF] and [CONTENTS], which hold nothing essential."""
    found: list[tuple[int, str]] = []
    if "WIF" not in text.sections:
        found.append((1, "section [WIF] is missing; version 1.1 is assumed"))
    else:
        version = text.entry("WIF", "version")
        value = version.value if version else ""
        if parse_decimal(value) != parse_decimal("1.1"):
            what = f'Version "{value[:40]}" is unknown' if value else "[WIF] has no Version"
            found.append((text.line("WIF", key="version"), f"{what}; version 1.1 is assumed"))
    contents = text.sections.get("CONTENTS")
    if contents is None:
        found.append((1, "section [CONTENTS] is missing"))
    else:
        entries = contents.entries.values()
        listed = {entry.key.upper(): entry.line for entry in entries if parse_boolean(entry.value)}
        there = {
            name: section.line
            for name, section in text.sections.items()
            if name not in ("WIF", "CONTENTS") and not name.startswith("PRIVATE")
        }
        lacking = {name: line for name, line in listed.items() if name not in text.sections}
        for names, lines, what in (
            (list(lacking), lacking, "[CONTENTS] lists {}, but the file has no such section"),
            ([name for name in there if name not in listed], there, "[CONTENTS] does not list {}"),
        ):
            if names:
                more = f" and {len(names) - 1} more" if names[1:] else ""
                found.append((lines[names[0]], what.format(f"[{names[0][:40]}]{more}")))
    if found:
        text.warnings.add(min(line for line, _ in found), "; ".join(what for _, what in found))


def _read_loom(text: WifText) -> Loom:
    """Read threading, tie-up, treadling, liftplan, and the numbers of ends and picks."""
    threading = _read_rows(text, "THREADING")
    if not _has_numbers(text, "WARP", threading):
        raise _missing_error(text, "[THREADING] threads no end", "THREADING")
    tieup, treadling = _read_rows(text, "TIEUP"), _read_rows(text, "TREADLING")
    liftplan = _read_rows(text, "LIFTPLAN")
    treadled = _is_treadled(text, tieup, treadling, liftplan)
    pick_section, pick_rows = ("TREADLING", treadling) if treadled else ("LIFTPLAN", liftplan)
    ends = _thread_count(text, "WARP", "THREADING", threading)
    picks = _thread_count(text, "WEFT", pick_section, pick_rows)
    if ends * picks > MAX_CROSSINGS:
        raise SizeError(
            f"line {text.line('WEFT', pick_section, key='threads')}: the cloth is too large",
            key="[WARP] Threads x [WEFT] Threads",
            value=f"{ends} x {picks}",
            allowed=f"up to {MAX_CROSSINGS} crossings",
            cure="Cut the draft to one repeat.",
        )
    lifts = tieup if treadled else liftplan
    treadles = _treadle_count(text, tieup, treadling) if treadled else 0
    # Treadles that are tied to nothing are kept, so that a written draft has their lines again.
    tied = [treadle for treadle in tieup if treadle <= treadles]
    loom = Loom(
        threading=_fill_rows(text, threading, ends),
        tieup=_to_rows(tieup, max(tied, default=0)) if treadled else (),
        treadling=_fill_rows(text, treadling, picks) if treadled else (),
        liftplan=None if treadled else _fill_rows(text, liftplan, picks),
        rising=_is_rising(text),
        shafts=_loom_count(
            text, "shafts", [*_largest_numbers(threading), *_largest_numbers(lifts)]
        ),
        treadles=treadles,
    )
    _warn_about_floats(text, loom, threading, pick_rows, pick_section)
    return loom


def _read_rows(text: WifText, section: str) -> _RowEntries:
    """Read a section of lists of shafts or treadles: entry and numbers by thread or treadle."""
    rows = {
        index: (entry, parse_numbers(entry, text.warnings))
        for index, entry in text.numbered(section).items()
    }
    if section == "TIEUP" and MAX_NUMBER + 1 in rows:
        entry, _ = rows[MAX_NUMBER + 1]
        raise entry.error("too many treadles", f"treadles from 1 to {MAX_NUMBER}", SizeError)
    return rows


def _has_numbers(text: WifText, family: str, rows: _RowEntries) -> bool:
    """Return whether any thread of the cloth has a shaft or treadle in these rows."""
    entry = text.entry(family, "threads")
    last = (parse_count(entry) if entry else 0) or MAX_NUMBER
    return any(found for index, (_, found) in rows.items() if index <= last)


def _is_treadled(
    text: WifText, tieup: _RowEntries, treadling: _RowEntries, liftplan: _RowEntries
) -> bool:
    """Return whether tie-up and treadling define the sheds, and not the liftplan."""
    pressed = _has_numbers(text, "WEFT", treadling)
    lifted = _has_numbers(text, "WEFT", liftplan)
    if pressed and tieup:
        if lifted:
            what = "the file has a treadling and a liftplan; the treadling is used"
            text.warnings.add(text.line("LIFTPLAN"), what)
        return True
    if not lifted:
        if not pressed:
            raise _missing_error(
                text, "[TREADLING] presses no treadle and [LIFTPLAN] lifts no shaft", "TREADLING"
            )
        raise _missing_error(
            text, "the treadling has no [TIEUP], and there is no [LIFTPLAN]", "TIEUP"
        )
    if treadling:
        lack = "has no tie-up" if pressed else "presses no treadle"
        text.warnings.add(text.line("TREADLING"), f"the treadling {lack}; the liftplan is used")
    return False


def _thread_count(text: WifText, family: str, section: str, rows: _RowEntries) -> int:
    """Return the number of ends or picks; if it is not given, the last number in `section`."""
    entry = text.entry(family, "threads")
    stated = parse_count(entry) if entry else 0
    if stated:
        return stated
    last = max(rows)
    if last > MAX_NUMBER:
        raise rows[last][0].error("too many threads", f"up to {MAX_NUMBER}", SizeError)
    line = text.line(family, section, key="threads")
    text.warnings.add(
        line, f"[{family}] has no Threads; {last} is assumed, the last in [{section}]"
    )
    return last


def _fill_rows(text: WifText, rows: _RowEntries, threads: int) -> Rows:
    """Return the numbers of each thread; a thread that the section leaves out has none."""
    for thread, (entry, found) in rows.items():
        if thread > threads and found:
            text.note_beyond(entry, threads)
    return _to_rows(rows, threads)


def _to_rows(rows: _RowEntries, length: int) -> Rows:
    return tuple(rows[index][1] if index in rows else () for index in range(1, length + 1))


def _loom_count(text: WifText, key: str, uses: Sequence[tuple[Entry, int]]) -> int:
    """Return the number of shafts or treadles: the stated number, or more if more are used."""
    entry = text.entry("WEAVING", key)
    stated = parse_count(entry) if entry else 0
    used = max((number for _, number in uses), default=0)
    if not stated:
        line = text.line("WEAVING", "THREADING", key=key)
        text.warnings.add(
            line, f"[WEAVING] has no {key.title()}; {used} is assumed, the highest used"
        )
    for user, number in uses:
        if number > stated > 0:
            what = f"{key[:-1]} {number} is above {key.title()}={stated}; it is used as given"
            text.warnings.add(user.line, f"[{user.section}] {what}", f"beyond {key} {user.section}")
    return max(stated, used)


def _largest_numbers(rows: _RowEntries) -> list[tuple[Entry, int]]:
    return [(entry, max(found)) for entry, found in rows.values() if found]


def _treadle_count(text: WifText, tieup: _RowEntries, treadling: _RowEntries) -> int:
    for entry, pressed in treadling.values():
        if any(treadle not in tieup for treadle in pressed):
            loose = next(treadle for treadle in pressed if treadle not in tieup)
            what = f"treadle {loose} is pressed but has no tie-up; it moves no shaft"
            text.warnings.add(entry.line, what, "no tie-up", doubtful=True)
    ties = [(entry, treadle) for treadle, (entry, shafts) in tieup.items() if shafts]
    return _loom_count(text, "treadles", [*ties, *_largest_numbers(treadling)])


def _is_rising(text: WifText) -> bool:
    entry = text.entry("WEAVING", "rising shed")
    rising = parse_boolean(entry.value) if entry else None
    if rising is None:
        line = text.line("WEAVING", "THREADING", key="rising shed")
        what = "[WEAVING] has no Rising Shed"
        if entry:
            what = f'Rising Shed "{entry.value[:40]}" is neither true nor false'
        text.warnings.add(line, f"{what}; a rising shed is assumed")
    return rising is not False


def _warn_about_floats(
    text: WifText, loom: Loom, threading: _RowEntries, picks: _RowEntries, section: str
) -> None:
    for name, first, what in loose_threads(loom):
        found, where = (threading, "THREADING") if name == "end" else (picks, section)
        line = found[first][0].line if first in found else text.line(where)
        text.warnings.add(line, what, doubtful=True)
