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
from spacemap_vtk.io.drafts.draft_bytes import (
    check_size,
    color_table,
    loose_thread_warnings,
    read_draft_bytes,
)
from spacemap_vtk.io.drafts.wif_text import MAX_NUMBER, WarningList, decode, parse_integer
from spacemap_vtk.ndarrays import Bytes, Ints
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.loom import Loom, Rows
from spacemap_vtk.textile.weave.threads import Lengths

#: Unit of spacing in m; Fiberworks uses this value when it writes a WIF.
UNIT = 0.53e-3
#: Spacing, in units, of threads for which the file gives none.
DEFAULT_SPACING = 4
#: Sections that do not describe the cloth.
_SKIPPED = {"startdtx", "enddtx", "contents", "imprint", "private", "notes"}
#: Sections that are read.
_READ = {"description", "info", "threading", "tieup", "treadling", "liftplan", "color palette"}
#: Sections with one value for each thread; these are read too.
_THREADS = {f"{family} {what}" for family in ("warp", "weft") for what in ("colors", "spacing")}
#: Other names of sections, with the names used here.
_OLD_NAMES = {"color palet": "color palette"}
_CURE = "Save the draft again in Fiberworks, or export it as WIF."


@dataclass
class _Section:
    name: str
    line: int
    keys: dict[str, str] = field(default_factory=dict)
    #: Lines with their line numbers in the file.
    lines: list[tuple[int, str]] = field(default_factory=list)


def read_dtx(path: Path) -> Draft:
    """Read a Fiberworks draft."""
    warnings = WarningList()
    sections = _read_sections(decode(read_draft_bytes(path), warnings), warnings)
    info = {
        key: _parse_count(sections["info"], key) if "info" in sections else 0
        for key in ("shafts", "treadles", "ends", "picks")
    }
    lifted, pressed = "liftplan" in sections, {"tieup", "treadling"} <= sections.keys()
    if "threading" not in sections or not (lifted or pressed):
        lacks = "no Threading"
        if "threading" in sections:
            lacks = "neither Tieup with Treadling nor Liftplan"
        raise InputError(f"the file has {lacks}", allowed="a draft of Fiberworks", cure=_CURE)
    if lifted and pressed:
        line = sections["liftplan"].line
        warnings.add(line, "the file has a treadling and a liftplan; the treadling is used")
    threading = _number_lists(sections["threading"])
    picks = _number_lists(sections["treadling"]) if pressed else _set_columns(sections["liftplan"])
    size = max(info["ends"], len(threading)), max(info["picks"], len(picks))
    check_size(*size)
    shed = sections["tieup" if pressed else "liftplan"]
    loom = Loom(
        threading=_pad_rows(threading, size[0]),
        tieup=_read_tieup(shed) if pressed else (),
        treadling=_pad_rows(picks, size[1]) if pressed else (),
        liftplan=None if pressed else _pad_rows(picks, size[1]),
        rising="sinking" not in shed.keys,
        shafts=info["shafts"],
        treadles=info["treadles"] if pressed else 0,
    )
    for text in loose_thread_warnings(loom):
        warnings.add(sections["threading"].line, text, doubtful=True)
    palette = _read_palette(sections.get("color palette"))
    warp, weft = (
        DraftThreads(
            spacing=_read_spacing(sections.get(f"{family} spacing"), count),
            colors=_read_colors(sections.get(f"{family} colors"), palette, count, usual, warnings),
        )
        for family, count, usual in (("warp", size[0], 0), ("weft", size[1], 1))
    )
    title = sections["description"].lines if "description" in sections else []
    name = title[0][1] if title else path.stem
    return Draft(loom.drawdown(), loom, warp, weft, name, warnings=warnings.texts())


def _read_sections(text: str, warnings: WarningList) -> dict[str, _Section]:
    found: dict[str, _Section] = {}
    section = None
    for number, line in enumerate(text.splitlines(), 1):
        line = line.strip()
        if line.startswith("@@"):
            name = " ".join(line[2:].lower().split())
            name = _OLD_NAMES.get(name, name)
            section = found[name] = _Section(line[2:].strip(), number)
            if name not in _SKIPPED | _READ | _THREADS:
                warnings.add(number, f"unknown section {line[2:42]} is ignored")
        elif section is None:
            if line:
                break
        elif line.startswith("%%"):
            key, _, value = line.lstrip("%").partition(" ")
            section.keys[key.strip().lower()] = value.strip()
        elif line:
            section.lines.append((number, line))
    if "startdtx" not in found:
        raise InputError(
            "the file does not begin with @@StartDTX", allowed="a .dtx file", cure=_CURE
        )
    if "enddtx" not in found:
        warnings.add(section.line if section else 1, "the file ends without @@EndDTX")
    return found


def _section_error(section: _Section, line: int, value: str, allowed: str) -> InputError:
    what = f"line {line} cannot be read"
    return InputError(what, key=section.name, value=value[:40], allowed=allowed, cure=_CURE)


def _parse_number(section: _Section, line: int, text: str, signed: bool = False) -> int:
    if signed and text.startswith("-"):
        return -_parse_number(section, line, text[1:])
    value = parse_integer(text) if re.fullmatch("[0-9]+", text) else MAX_NUMBER + 1
    if value > MAX_NUMBER:
        raise _section_error(section, line, text, f"whole numbers up to {MAX_NUMBER}")
    return value


def _parse_count(info: _Section, key: str) -> int:
    return _parse_number(info, info.line, info.keys.get(key) or "0")


def _number_lists(section: _Section) -> list[tuple[int, ...]]:
    """Return the numbers of each thread; blanks separate threads, commas separate numbers."""
    return [
        tuple(sorted({_parse_number(section, line, word) for word in words.split(",")} - {0}))
        for line, text in section.lines
        for words in re.sub(r"\s*,\s*", ",", text).split()
    ]


def _set_columns(section: _Section) -> list[tuple[int, ...]]:
    """Return for each row the columns that hold a 1, counted from 1."""
    for line, text in section.lines:
        if set(text) - {"0", "1"} or len(text) > MAX_NUMBER:
            raise _section_error(section, line, text, "a row of 0 and 1")
    return [tuple(k for k, bit in enumerate(text, 1) if bit == "1") for _, text in section.lines]


def _read_tieup(section: _Section) -> Rows:
    rows = _set_columns(section)
    columns = max((len(text) for _, text in section.lines), default=0)
    ties: list[list[int]] = [[] for _ in range(columns)]
    for shaft, row in enumerate(reversed(rows), 1):
        for treadle in row:
            ties[treadle - 1].append(shaft)
    return tuple(map(tuple, ties))


def _pad_rows(rows: list[tuple[int, ...]], count: int) -> Rows:
    return (*rows, *[()] * (count - len(rows)))


def _read_palette(section: _Section | None) -> Bytes | None:
    if section is None or not section.lines:
        return None
    colors = []
    for line, text in section.lines:
        parts = [part.strip() for part in text.split(",")]
        if len(parts) != 3 or any(not re.fullmatch("[0-9]{1,3}", p) or int(p) > 255 for p in parts):
            raise _section_error(section, line, text, "three numbers from 0 to 255 with commas")
        colors.append([int(part) for part in parts])
    return np.array(colors, np.uint8)


def _read_colors(
    section: _Section | None, palette: Bytes | None, count: int, usual: int, warnings: WarningList
) -> Bytes | None:
    """Return each thread's colour; `usual` is the palette's entry if the file gives none."""
    if palette is None:
        return None
    found = [] if section is None else _single_numbers(section, signed=True)
    chosen = np.full(count, found[0] if found else min(usual, len(palette) - 1))
    chosen[: len(found)] = found[:count]
    unknown = (chosen < 0) | (chosen >= len(palette))
    if section is not None and unknown.any():
        what = f"{section.name} has colours outside the palette's 0 to {len(palette) - 1}"
        warnings.add(section.line, f"{what}; the first colour is used for them", doubtful=True)
        chosen[unknown] = 0
    return np.asarray(palette[chosen])


def _read_spacing(section: _Section | None, count: int) -> Lengths:
    units = np.full(count, DEFAULT_SPACING)
    if section is not None:
        found = _single_numbers(section)[:count]
        units[: len(found)] = found
        units[units == 0] = DEFAULT_SPACING
    return float(UNIT * units[0]) if (units == units[0]).all() else UNIT * units


def _single_numbers(section: _Section, signed: bool = False) -> list[int]:
    words = [(line, word) for line, text in section.lines for word in text.split()]
    return [_parse_number(section, line, word, signed) for line, word in words]


def losses(draft: Draft) -> list[str]:
    """Return sentences about what a .dtx cannot store of a draft."""
    lost = []
    if draft.loom is not None and any(len(shafts) > 1 for shafts in draft.loom.threading):
        lost.append("a .dtx stores one shaft for each end: threading and tie-up are computed anew")
    for family, threads in (("warp", draft.warp), ("weft", draft.weft)):
        spacing, thickness = threads.spacing, threads.thickness
        if spacing is None:
            length = f"{DEFAULT_SPACING * UNIT * 1e3:g} mm"
            lost.append(f"a .dtx stores a spacing for each thread; the {family} gets {length}")
        elif not np.allclose(UNIT * _spacing_units(spacing), spacing, rtol=1e-3):
            lost.append(f"the spacing of the {family} is rounded to units of {UNIT * 1e3:g} mm")
        if thickness is not None and not np.array_equal(thickness, np.asarray(spacing)):
            lost.append(f"a .dtx cannot store a thickness: that of the {family} is lost")
    return lost


def _spacing_units(spacing: Lengths) -> Ints:
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
        "Threading": _wrap_words([str(max(shafts, default=0)) for shafts in loom.threading]),
    }
    if loom.liftplan is None:
        tied = (*loom.tieup, *[()] * (loom.treadles - len(loom.tieup)))
        sections["Tieup"] = sinking + [
            "".join("01"[shaft in ties] for ties in tied) for shaft in range(loom.shafts, 0, -1)
        ]
        several = any(len(pressed) > 1 for pressed in loom.treadling)
        sections["Treadling"] = ["%%compound"] * several + _wrap_words(
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
        sections[f"{name} Colors"] = _wrap_words(list(map(str, indices)))
        if own.spacing is not None:
            units = np.broadcast_to(_spacing_units(own.spacing), count)
            sections[f"{name} Spacing"] = _wrap_words(list(map(str, units.tolist())))
    title = " ".join(draft.title.split())
    if title:
        sections = {"Description": [title], **sections}
    names = [name.replace("Palet", "Palette") for name in sections]
    blocks = {"StartDTX": ["%%version 1"], "Contents": [*names, "EndDTX"], **sections, "EndDTX": []}
    text = "\r\n".join("\r\n".join([f"@@{name}", *lines, ""]) for name, lines in blocks.items())
    return text.encode("utf-8", errors="replace")


def _wrap_words(words: list[str]) -> list[str]:
    """Join words into lines of 20 words."""
    return [" ".join(words[k : k + 20]) for k in range(0, len(words), 20)]
