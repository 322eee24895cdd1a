"""Write a Weaving Information File (WIF 1.1)."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from decimal import Decimal

import numpy as np

from spacemap_vtk.io.drafts.draft_bytes import color_table
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.loom import Loom
from spacemap_vtk.textile.weave.threads import Lengths


def format_wif(draft: Draft) -> bytes:
    """Return a draft as the content of a Weaving Information File."""
    # `parse_wif` must give the same draft again, except for its warnings: lengths to the last bit,
    # colours in the range 0 to 255. A family without colours gets the colour in which this program
    # draws it, because some programs read no draft without a palette. The family's defaults are
    # written even if each thread has a value, because some programs read no draft without them.
    loom = draft.loom
    if loom is None or not _can_write_loom(loom, draft):
        loom = Loom.from_drawdown(draft.drawdown)
    places, table = color_table(draft)
    numbers = [[place + 1 for place in family] for family in places]
    title = re.sub("[\r\n]+", " ", draft.title).strip()
    sections: dict[str, list[str]] = {
        "TEXT": [*([f"Title={title}"] if title else []), *draft.other_sections.get("TEXT", ())],
        "WEAVING": [
            f"Shafts={loom.shafts}",
            f"Treadles={loom.treadles or loom.shafts}",
            f"Rising Shed={'true' if loom.rising else 'false'}",
        ],
        "WARP": _family_lines(len(loom.threading), numbers[0], draft.warp),
        "WEFT": _family_lines(len(loom.sheds()), numbers[1], draft.weft),
        "COLOR PALETTE": [f"Entries={len(table)}", "Form=RGB", "Range=0,255"],
        "COLOR TABLE": _list_lines(table),
        "THREADING": _list_lines(loom.threading),
        # If [TIEUP] had no line, a reader would not use the treadling.
        "TIEUP": [] if loom.liftplan else _list_lines(loom.tieup or ((),)),
        "TREADLING": [] if loom.liftplan else _list_lines(loom.treadling),
        "LIFTPLAN": _list_lines(loom.liftplan or ()),
        "WARP COLORS": _numbered_lines(numbers[0]),
        "WEFT COLORS": _numbered_lines(numbers[1]),
        "WARP SPACING": _length_lines(draft.warp.spacing),
        "WEFT SPACING": _length_lines(draft.weft.spacing),
        "WARP THICKNESS": _length_lines(draft.warp.thickness),
        "WEFT THICKNESS": _length_lines(draft.weft.thickness),
    }
    sections |= {
        name: list(lines) for name, lines in draft.other_sections.items() if name != "TEXT"
    }
    sections = {name: lines for name, lines in sections.items() if lines}
    head = {
        "WIF": [
            "Version=1.1",
            # The standard requires both entries and fixes their values.
            "Date=April 20, 1997",
            "Developers=wif@mhsoft.com",
            "Source Program=spacemap_vtk",
        ],
        # A line that begins with a bracket would be read as the title of another section.
        "CONTENTS": [f"{name}=true" for name in sections if not name.startswith("[")],
    }
    blocks = (
        "\r\n".join([f"[{name}]", *lines, ""]) for name, lines in {**head, **sections}.items()
    )
    return "\r\n".join(blocks).encode("utf-8", errors="replace")


def _can_write_loom(loom: Loom, draft: Draft) -> bool:
    """Return whether the loom weaves the draft, and can be read again from a file."""
    moved = loom.treadling if loom.liftplan is None else loom.liftplan
    if not any(loom.threading) or not any(moved):
        return False
    return np.array_equal(loom.drawdown(), draft.drawdown)


def _family_lines(count: int, colors: Sequence[int], threads: DraftThreads) -> list[str]:
    common = Counter(colors).most_common(1)[0][0]
    lines = [f"Threads={count}", f"Color={common}", "Units=Centimeters"]
    for name, lengths in (("Spacing", threads.spacing), ("Thickness", threads.thickness)):
        if lengths is not None:
            lines.append(f"{name}={_centimetres(float(np.mean(lengths)))}")
    return lines


def _centimetres(length: float) -> str:
    # Shifting the decimal point of the shortest representation is exact. 100 * length would round,
    # and the draft that is read again would differ in the last bit.
    return format(Decimal(repr(float(length))).scaleb(2), "f")


def _length_lines(lengths: Lengths | None) -> list[str]:
    if not isinstance(lengths, np.ndarray):
        return []
    return _numbered_lines(_centimetres(length) for length in lengths.tolist())


def _list_lines(rows: Iterable[Sequence[int]]) -> list[str]:
    return _numbered_lines(",".join(map(str, row)) or "0" for row in rows)


def _numbered_lines(values: Iterable[object]) -> list[str]:
    return [f"{index}={value}" for index, value in enumerate(values, start=1)]
