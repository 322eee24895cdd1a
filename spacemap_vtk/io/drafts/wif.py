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
from spacemap_vtk.io.drafts.draft_bytes import MAX_CROSSINGS, content, loose_threads
from spacemap_vtk.io.drafts.wif_text import (
    MAX_LENGTH,
    MAX_NUMBER,
    Entry,
    Notes,
    WifText,
    boolean,
    count,
    decimal,
    decode,
    numbers,
)
from spacemap_vtk.io.drafts.wif_threads import read_colors, read_lengths
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.loom import Loom, Rows

# Lists of a section: entry and numbers by thread or treadle.
_Found = dict[int, tuple[Entry, tuple[int, ...]]]

_CURE = "Check that it is a whole WIF file, or export it again from the weaving program"


def read_wif(path: str | os.PathLike[str]) -> Draft:
    """Read a Weaving Information File."""
    try:
        return parse_wif(content(Path(path)))
    except InputError as error:
        error.file = os.fsdecode(path)
        raise


def parse_wif(data: str | bytes) -> Draft:
    """Read a Weaving Information File from its content."""
    if len(data) > MAX_LENGTH:
        raise SizeError("the file is too long", allowed=f"up to {MAX_LENGTH} bytes", cure=_CURE)
    notes = Notes()
    text = WifText(decode(data, notes) if isinstance(data, bytes) else data, notes)
    if not {"WEAVING", "WARP", "WEFT", "THREADING", "TREADLING", "LIFTPLAN"} & set(text.sections):
        raise _missing(text, "section of a draft up to the end of the file")
    _check_head(text)
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
        warnings=notes.texts(),
        besides=text.besides,
    )


def _missing(text: WifText, what: str, section: str = "") -> InputError:
    """Return the error for a missing part, with the line of the section or the last line."""
    line = text.sections[section].line if section in text.sections else text.last
    allowed = "a draft in the WIF format, version 1.1"
    return InputError(f"line {line}: there is no {what}", allowed=allowed, cure=_CURE)


def _check_head(text: WifText) -> None:
    """Add one warning for all faults of [WIF] and [CONTENTS], which hold nothing essential."""
    found: list[tuple[int, str]] = []
    if "WIF" not in text.sections:
        found.append((1, "there is no [WIF]; read as version 1.1"))
    else:
        version = text.entry("WIF", "version")
        value = version.value if version else ""
        if decimal(value) != decimal("1.1"):
            what = f'Version "{value[:40]}" is' if value else "there is no Version;"
            found.append((text.line("WIF", key="version"), f"{what} read as 1.1"))
    contents = text.sections.get("CONTENTS")
    if contents is None:
        found.append((1, "there is no [CONTENTS]"))
    else:
        entries = contents.entries.values()
        listed = {entry.key.upper(): entry.line for entry in entries if boolean(entry.value)}
        there = {
            name: section.line
            for name, section in text.sections.items()
            if name not in ("WIF", "CONTENTS") and not name.startswith("PRIVATE")
        }
        lacking = {name: line for name, line in listed.items() if name not in text.sections}
        for names, lines, what in (
            (list(lacking), lacking, "[CONTENTS] lists {}, not there"),
            ([name for name in there if name not in listed], there, "[CONTENTS] does not list {}"),
        ):
            if names:
                more = f" and {len(names) - 1} more" if names[1:] else ""
                found.append((lines[names[0]], what.format(f"[{names[0][:40]}]{more}")))
    if found:
        text.notes.add(min(line for line, _ in found), "; ".join(what for _, what in found))


def _read_loom(text: WifText) -> Loom:
    """Read threading, tie-up, treadling, liftplan, and the numbers of ends and picks."""
    threading = _rows(text, "THREADING")
    if not _says_something(text, "WARP", threading):
        raise _missing(text, "end threaded in [THREADING]", "THREADING")
    tieup, treadling = _rows(text, "TIEUP"), _rows(text, "TREADLING")
    liftplan = _rows(text, "LIFTPLAN")
    treadled = _is_treadled(text, tieup, treadling, liftplan)
    pick_section, pick_rows = ("TREADLING", treadling) if treadled else ("LIFTPLAN", liftplan)
    ends = _threads(text, "WARP", "THREADING", threading)
    picks = _threads(text, "WEFT", pick_section, pick_rows)
    if ends * picks > MAX_CROSSINGS:
        raise SizeError(
            f"line {text.line('WEFT', pick_section, key='threads')}: the cloth is too large",
            key="[WARP] Threads x [WEFT] Threads",
            value=f"{ends} x {picks}",
            allowed=f"up to {MAX_CROSSINGS} crossings",
            cure="Cut the draft to one repeat",
        )
    lifts = tieup if treadled else liftplan
    treadles = _treadles(text, tieup, treadling) if treadled else 0
    # Treadles that are tied to nothing are kept, so that a written draft has their lines again.
    tied = [treadle for treadle in tieup if treadle <= treadles]
    loom = Loom(
        threading=_filled(text, threading, ends),
        tieup=_dense(tieup, max(tied, default=0)) if treadled else (),
        treadling=_filled(text, treadling, picks) if treadled else (),
        liftplan=None if treadled else _filled(text, liftplan, picks),
        rising=_is_rising(text),
        shafts=_loom_count(text, "shafts", [*_uses(threading), *_uses(lifts)]),
        treadles=treadles,
    )
    _note_floats(text, loom, threading, pick_rows, pick_section)
    return loom


def _rows(text: WifText, section: str) -> _Found:
    """Read a section of lists of shafts or treadles: entry and numbers by thread or treadle."""
    rows = {
        index: (entry, numbers(entry, text.notes))
        for index, entry in text.numbered(section).items()
    }
    if section == "TIEUP" and MAX_NUMBER + 1 in rows:
        entry, _ = rows[MAX_NUMBER + 1]
        raise entry.refusal("too many treadles", f"treadles from 1 to {MAX_NUMBER}", SizeError)
    return rows


def _says_something(text: WifText, family: str, rows: _Found) -> bool:
    """Return whether any thread of the cloth has a shaft or treadle in these rows."""
    entry = text.entry(family, "threads")
    last = (count(entry) if entry else 0) or MAX_NUMBER
    return any(found for index, (_, found) in rows.items() if index <= last)


def _is_treadled(text: WifText, tieup: _Found, treadling: _Found, liftplan: _Found) -> bool:
    """Return whether tie-up and treadling define the sheds, and not the liftplan."""
    pressed = _says_something(text, "WEFT", treadling)
    lifted = _says_something(text, "WEFT", liftplan)
    if pressed and tieup:
        if lifted:
            what = "there are a treadling and a liftplan; the treadling is used"
            text.notes.add(text.line("LIFTPLAN"), what)
        return True
    if not lifted:
        if not pressed:
            raise _missing(text, "treadle in [TREADLING] and no shaft in [LIFTPLAN]", "TREADLING")
        raise _missing(text, "tie-up in [TIEUP] for the treadling, and no [LIFTPLAN]", "TIEUP")
    if treadling:
        lack = "has no tie-up" if pressed else "presses no treadle"
        text.notes.add(text.line("TREADLING"), f"the treadling {lack}; the liftplan is used")
    return False


def _threads(text: WifText, family: str, section: str, rows: _Found) -> int:
    """Return the number of ends or picks; if it is not given, the last number in `section`."""
    entry = text.entry(family, "threads")
    stated = count(entry) if entry else 0
    if stated:
        return stated
    last = max(rows)
    if last > MAX_NUMBER:
        raise rows[last][0].refusal("too many threads", f"up to {MAX_NUMBER}", SizeError)
    line = text.line(family, section, key="threads")
    text.notes.add(line, f"[{family}] has no Threads; {last} assumed, the last in [{section}]")
    return last


def _filled(text: WifText, rows: _Found, threads: int) -> Rows:
    """Return the numbers of each thread; a thread that the section leaves out has none."""
    for thread, (entry, found) in rows.items():
        if thread > threads and found:
            text.note_beyond(entry, threads)
    return _dense(rows, threads)


def _dense(rows: _Found, length: int) -> Rows:
    return tuple(rows[index][1] if index in rows else () for index in range(1, length + 1))


def _loom_count(text: WifText, key: str, uses: Sequence[tuple[Entry, int]]) -> int:
    """Return the number of shafts or treadles: the stated number, or more if more are used."""
    entry = text.entry("WEAVING", key)
    stated = count(entry) if entry else 0
    used = max((number for _, number in uses), default=0)
    if not stated:
        line = text.line("WEAVING", "THREADING", key=key)
        text.notes.add(line, f"[WEAVING] has no {key.title()}; {used} assumed, the most used")
    for user, number in uses:
        if number > stated > 0:
            what = f"{key[:-1]} {number} is beyond {key.title()}={stated}; taken as it is"
            text.notes.add(user.line, f"[{user.section}] {what}", f"beyond {key} {user.section}")
    return max(stated, used)


def _uses(rows: _Found) -> list[tuple[Entry, int]]:
    return [(entry, max(found)) for entry, found in rows.values() if found]


def _treadles(text: WifText, tieup: _Found, treadling: _Found) -> int:
    for entry, pressed in treadling.values():
        if any(treadle not in tieup for treadle in pressed):
            loose = next(treadle for treadle in pressed if treadle not in tieup)
            what = f"treadle {loose} is pressed but has no tie-up; it moves no shaft"
            text.notes.add(entry.line, what, "no tie-up", doubtful=True)
    ties = [(entry, treadle) for treadle, (entry, shafts) in tieup.items() if shafts]
    return _loom_count(text, "treadles", [*ties, *_uses(treadling)])


def _is_rising(text: WifText) -> bool:
    entry = text.entry("WEAVING", "rising shed")
    rising = boolean(entry.value) if entry else None
    if rising is None:
        line = text.line("WEAVING", "THREADING", key="rising shed")
        what = "there is no Rising Shed"
        if entry:
            what = f'Rising Shed "{entry.value[:40]}" is neither true nor false'
        text.notes.add(line, f"{what}; a rising shed is assumed")
    return rising is not False


def _note_floats(text: WifText, loom: Loom, threading: _Found, picks: _Found, section: str) -> None:
    for name, first, what in loose_threads(loom):
        found, where = (threading, "THREADING") if name == "end" else (picks, section)
        line = found[first][0].line if first in found else text.line(where)
        text.notes.add(line, what, doubtful=True)
