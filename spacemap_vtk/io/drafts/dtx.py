"""Read and write drafts of Fiberworks (.dtx).

A file is text. Its sections begin with @@, and contain keys (%%) and lines:

- Info: the numbers of shafts, treadles, ends and picks.
- Threading: the shaft of each end, 0 for none.
- Tieup: a row of 0 and 1 for each shaft, the highest first; a column for each treadle.
- Treadling: the treadle of each pick; with %%compound, lists separated by commas.
- Liftplan: a row of 0 and 1 for each pick; the first column is the first shaft.
- `Color Palet` (or `Palette`): r,g,b on each line. `Warp Colors` and `Weft Colors` hold indices of
  these lines, counted from 0.
- Warp Spacing, Weft Spacing: whole numbers of `UNIT`.

%%%%sinking (sic) in Tieup or Liftplan means that the named shafts go down. The format has no
thickness.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.drafts.draft_bytes import check_size, color_table, content, loose_notes
from spacemap_vtk.io.drafts.wif_text import MAX_NUMBER, Notes, decode, whole
from spacemap_vtk.ndarrays import Bytes, Ints
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.loom import Loom, Rows
from spacemap_vtk.textile.weave.threads import Lengths

#: Unit of spacing in m; Fiberworks uses this value when it writes a WIF.
UNIT = 0.53e-3
#: Spacing, in units, of threads for which the file gives none.
USUAL = 4
#: Sections that do not describe the cloth.
_SKIPPED = {"startdtx", "enddtx", "contents", "imprint", "private", "notes"}
#: Sections that are read.
_READ = {"description", "info", "threading", "tieup", "treadling", "liftplan", "color palette"}
#: Sections with one value for each thread; these are read too.
_THREADS = {f"{family} {what}" for family in ("warp", "weft") for what in ("colors", "spacing")}
#: Other names of sections, with the names used here.
_OLDER = {"color palet": "color palette"}
_CURE = "Save the draft again in Fiberworks, or export it as WIF"


@dataclass
class _Section:
    name: str
    line: int
    keys: dict[str, str] = field(default_factory=dict)
    #: Lines with their line numbers in the file.
    lines: list[tuple[int, str]] = field(default_factory=list)


def read_dtx(path: Path) -> Draft:
    """Read a Fiberworks draft."""
    notes = Notes()
    sections = _sections(decode(content(path), notes), notes)
    info = {
        key: _count(sections["info"], key) if "info" in sections else 0
        for key in ("shafts", "treadles", "ends", "picks")
    }
    lifted, pressed = "liftplan" in sections, {"tieup", "treadling"} <= sections.keys()
    if "threading" not in sections or not (lifted or pressed):
        lacks = "Threading" if "threading" not in sections else "Tieup with Treadling, nor Liftplan"
        raise InputError(f"there is no {lacks}", allowed="a draft of Fiberworks", cure=_CURE)
    if lifted and pressed:
        line = sections["liftplan"].line
        notes.add(line, "there are a treadling and a liftplan; the treadling is used")
    threading = _lists(sections["threading"])
    picks = _lists(sections["treadling"]) if pressed else _bits(sections["liftplan"])
    size = max(info["ends"], len(threading)), max(info["picks"], len(picks))
    check_size(*size)
    shed = sections["tieup" if pressed else "liftplan"]
    loom = Loom(
        threading=_filled(threading, size[0]),
        tieup=_tieup(shed) if pressed else (),
        treadling=_filled(picks, size[1]) if pressed else (),
        liftplan=None if pressed else _filled(picks, size[1]),
        rising="sinking" not in shed.keys,
        shafts=info["shafts"],
        treadles=info["treadles"] if pressed else 0,
    )
    for text in loose_notes(loom):
        notes.add(sections["threading"].line, text, doubtful=True)
    palette = _palette(sections.get("color palette"))
    warp, weft = (
        DraftThreads(
            spacing=_spacing(sections.get(f"{family} spacing"), count),
            colors=_colors(sections.get(f"{family} colors"), palette, count, usual, notes),
        )
        for family, count, usual in (("warp", size[0], 0), ("weft", size[1], 1))
    )
    title = sections["description"].lines if "description" in sections else []
    name = title[0][1] if title else path.stem
    return Draft(loom.drawdown(), loom, warp, weft, name, warnings=notes.texts())


def _sections(text: str, notes: Notes) -> dict[str, _Section]:
    found: dict[str, _Section] = {}
    section = None
    for number, line in enumerate(text.splitlines(), 1):
        line = line.strip()
        if line.startswith("@@"):
            name = " ".join(line[2:].lower().split())
            name = _OLDER.get(name, name)
            section = found[name] = _Section(line[2:].strip(), number)
            if name not in _SKIPPED | _READ | _THREADS:
                notes.add(number, f"the section {line[2:42]} is not read")
        elif section is None:
            if line:
                break
        elif line.startswith("%%"):
            key, _, value = line.lstrip("%").partition(" ")
            section.keys[key.strip().lower()] = value.strip()
        elif line:
            section.lines.append((number, line))
    if "startdtx" not in found:
        raise InputError("it does not begin with @@StartDTX", allowed="a .dtx file", cure=_CURE)
    if "enddtx" not in found:
        notes.add(section.line if section else 1, "the file ends without @@EndDTX")
    return found


def _refusal(section: _Section, line: int, value: str, allowed: str) -> InputError:
    what = f"line {line}: can't be read"
    return InputError(what, key=section.name, value=value[:40], allowed=allowed, cure=_CURE)


def _number(section: _Section, line: int, text: str, signed: bool = False) -> int:
    if signed and text.startswith("-"):
        return -_number(section, line, text[1:])
    value = whole(text) if re.fullmatch("[0-9]+", text) else MAX_NUMBER + 1
    if value > MAX_NUMBER:
        raise _refusal(section, line, text, f"whole numbers up to {MAX_NUMBER}")
    return value


def _count(info: _Section, key: str) -> int:
    return _number(info, info.line, info.keys.get(key) or "0")


def _lists(section: _Section) -> list[tuple[int, ...]]:
    """Return the numbers of each thread; blanks separate threads, commas separate numbers."""
    return [
        tuple(sorted({_number(section, line, word) for word in words.split(",")} - {0}))
        for line, text in section.lines
        for words in re.sub(r"\s*,\s*", ",", text).split()
    ]


def _bits(section: _Section) -> list[tuple[int, ...]]:
    """Return for each row the columns that hold a 1, counted from 1."""
    for line, text in section.lines:
        if set(text) - {"0", "1"} or len(text) > MAX_NUMBER:
            raise _refusal(section, line, text, "a row of 0 and 1")
    return [tuple(k for k, bit in enumerate(text, 1) if bit == "1") for _, text in section.lines]


def _tieup(section: _Section) -> Rows:
    rows = _bits(section)
    columns = max((len(text) for _, text in section.lines), default=0)
    ties: list[list[int]] = [[] for _ in range(columns)]
    for shaft, row in enumerate(reversed(rows), 1):
        for treadle in row:
            ties[treadle - 1].append(shaft)
    return tuple(map(tuple, ties))


def _filled(rows: list[tuple[int, ...]], count: int) -> Rows:
    return (*rows, *[()] * (count - len(rows)))


def _palette(section: _Section | None) -> Bytes | None:
    if section is None or not section.lines:
        return None
    colors = []
    for line, text in section.lines:
        parts = [part.strip() for part in text.split(",")]
        if len(parts) != 3 or any(not re.fullmatch("[0-9]{1,3}", p) or int(p) > 255 for p in parts):
            raise _refusal(section, line, text, "three numbers from 0 to 255 with commas")
        colors.append([int(part) for part in parts])
    return np.array(colors, np.uint8)


def _colors(
    section: _Section | None, palette: Bytes | None, count: int, usual: int, notes: Notes
) -> Bytes | None:
    """Return each thread's colour; `usual` is the palette's entry if the file gives none."""
    if palette is None:
        return None
    found = [] if section is None else _lists_of_one(section, signed=True)
    chosen = np.full(count, found[0] if found else min(usual, len(palette) - 1))
    chosen[: len(found)] = found[:count]
    unknown = (chosen < 0) | (chosen >= len(palette))
    if section is not None and unknown.any():
        what = f"{section.name} has numbers that are none of the palette's 0 to {len(palette) - 1}"
        notes.add(section.line, f"{what}; its first colour is used for them", doubtful=True)
        chosen[unknown] = 0
    return np.asarray(palette[chosen])


def _spacing(section: _Section | None, count: int) -> Lengths:
    units = np.full(count, USUAL)
    if section is not None:
        found = _lists_of_one(section)[:count]
        units[: len(found)] = found
        units[units == 0] = USUAL
    return float(UNIT * units[0]) if (units == units[0]).all() else UNIT * units


def _lists_of_one(section: _Section, signed: bool = False) -> list[int]:
    words = [(line, word) for line, text in section.lines for word in text.split()]
    return [_number(section, line, word, signed) for line, word in words]


def losses(draft: Draft) -> list[str]:
    """Return sentences about what a .dtx cannot store of a draft."""
    told = []
    if draft.loom is not None and any(len(shafts) > 1 for shafts in draft.loom.threading):
        told.append("a .dtx has one heddle an end: it is threaded and tied up anew")
    for family, threads in (("warp", draft.warp), ("weft", draft.weft)):
        spacing, thickness = threads.spacing, threads.thickness
        if spacing is None:
            usual = f"{USUAL * UNIT * 1e3:g} mm ({family})"
            told.append(f"a .dtx gives every thread a spacing; here {usual}")
        elif not np.allclose(UNIT * _units(spacing), spacing, rtol=1e-3):
            told.append(f"the {family}'s spacing is rounded to units of {UNIT * 1e3:g} mm")
        if thickness is not None and not np.array_equal(thickness, np.asarray(spacing)):
            told.append(f"a .dtx has no thickness: that of the {family} is lost")
    return told


def _units(spacing: Lengths) -> Ints:
    return np.clip(np.rint(np.asarray(spacing) / UNIT), 1, MAX_NUMBER).astype(np.int64)


def format_dtx(draft: Draft) -> bytes:
    """Return a draft as the content of a .dtx file, in the layout of Fiberworks."""
    loom = draft.loom
    if loom is None or any(len(shafts) > 1 for shafts in loom.threading):
        loom = Loom.from_drawdown(draft.drawdown)
    sinking = [] if loom.rising else ["%%%%sinking"]
    ends, picks = draft.size
    colors, table = color_table(draft)
    sections: dict[str, list[str]] = {
        "Info": [
            f"%%shafts {loom.shafts}",
            f"%%treadles {loom.treadles or loom.shafts}",
            f"%%ends {ends}",
            f"%%picks {picks}",
        ],
        "Threading": _wrapped([str(max(shafts, default=0)) for shafts in loom.threading]),
    }
    if loom.liftplan is None:
        tied = (*loom.tieup, *[()] * (loom.treadles - len(loom.tieup)))
        sections["Tieup"] = sinking + [
            "".join("01"[shaft in ties] for ties in tied) for shaft in range(loom.shafts, 0, -1)
        ]
        several = any(len(pressed) > 1 for pressed in loom.treadling)
        sections["Treadling"] = ["%%compound"] * several + _wrapped(
            [",".join(map(str, pressed)) or "0" for pressed in loom.treadling]
        )
    else:
        sections["Liftplan"] = sinking + [
            "".join("01"[shaft in lifted] for shaft in range(1, loom.shafts + 1))
            for lifted in loom.liftplan
        ]
    sections["Color Palet"] = [",".join(map(str, color)) for color in table]
    for name, own, count, indices in (
        ("Warp", draft.warp, ends, colors[0]),
        ("Weft", draft.weft, picks, colors[1]),
    ):
        sections[f"{name} Colors"] = _wrapped(list(map(str, indices)))
        if own.spacing is not None:
            units = np.broadcast_to(_units(own.spacing), count)
            sections[f"{name} Spacing"] = _wrapped(list(map(str, units.tolist())))
    title = " ".join(draft.title.split())
    if title:
        sections = {"Description": [title], **sections}
    names = [name.replace("Palet", "Palette") for name in sections]
    blocks = {"StartDTX": ["%%version 1"], "Contents": [*names, "EndDTX"], **sections, "EndDTX": []}
    text = "\r\n".join("\r\n".join([f"@@{name}", *lines, ""]) for name, lines in blocks.items())
    return text.encode("utf-8", errors="replace")


def _wrapped(words: list[str]) -> list[str]:
    """Join words into lines of 20 words."""
    return [" ".join(words[k : k + 20]) for k in range(0, len(words), 20)]
