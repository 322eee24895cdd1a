"""Writing a Weaving Information File (WIF 1.1)."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.fabric.draft import Draft
from spacemap_vtk.fabric.loom import Loom
from spacemap_vtk.fabric.settle import colors_of
from spacemap_vtk.fabric.wishes import Wishes
from spacemap_vtk.io.wif import WifDraft


def format_wif(draft: Draft | WifDraft) -> bytes:
    """Write a draft as a Weaving Information File."""
    # `parse_wif` gives the same draft again, its warnings apart: lengths to the last bit, colours
    # in the range 0 to 255. A family without colours gets the one that it is woven in here: there
    # are programs that read no draft without a palette, and none without the defaults of what is
    # given for each thread.
    wif = draft if isinstance(draft, WifDraft) else None
    cloth = draft.draft if isinstance(draft, WifDraft) else draft
    if wif is None or not _weaves(wif.loom, cloth):
        wif = WifDraft(cloth, Loom.from_drawdown(cloth.drawdown))
    loom = wif.loom
    picks, ends = cloth.drawdown.shape
    (warp_numbers, weft_numbers), table = _color_table(
        colors_of("warp", ends, cloth.warp_colors, Wishes()),
        colors_of("weft", picks, cloth.weft_colors, Wishes()),
    )
    sections: dict[str, list[str]] = {
        "TEXT": [f"Title={title}"] if (title := _one_line(cloth.title)) else [],
        "WEAVING": [
            f"Shafts={loom.shafts}",
            f"Treadles={loom.treadles or loom.shafts}",
            f"Rising Shed={'true' if loom.rising else 'false'}",
        ],
        "WARP": _family(
            len(loom.threading),
            warp_numbers,
            _default(cloth.warp_spacing, wif.warp_spacings),
            _default(cloth.warp_thickness, wif.warp_thicknesses),
        ),
        "WEFT": _family(
            len(loom.sheds()),
            weft_numbers,
            _default(cloth.weft_spacing, wif.weft_spacings),
            _default(cloth.weft_thickness, wif.weft_thicknesses),
        ),
        "COLOR PALETTE": [f"Entries={len(table)}", "Form=RGB", "Range=0,255"],
        "COLOR TABLE": _listed(table),
        "THREADING": _listed(loom.threading),
        # Without a line in [TIEUP] there would be no treadling to read.
        "TIEUP": [] if loom.liftplan else _listed(loom.tieup or ((),)),
        "TREADLING": [] if loom.liftplan else _listed(loom.treadling),
        "LIFTPLAN": _listed(loom.liftplan or ()),
        "WARP COLORS": _lines(warp_numbers),
        "WEFT COLORS": _lines(weft_numbers),
        "WARP SPACING": _lengths(wif.warp_spacings),
        "WEFT SPACING": _lengths(wif.weft_spacings),
        "WARP THICKNESS": _lengths(wif.warp_thicknesses),
        "WEFT THICKNESS": _lengths(wif.weft_thicknesses),
    }
    sections = {name: lines for name, lines in sections.items() if lines}
    head = {
        "WIF": [
            "Version=1.1",
            # Date and developers are constants of the standard, and required by it.
            "Date=April 20, 1997",
            "Developers=wif@mhsoft.com",
            "Source Program=spacemap_vtk",
        ],
        "CONTENTS": [f"{name}=true" for name in sections],
    }
    blocks = (
        "\r\n".join([f"[{name}]", *lines, ""]) for name, lines in {**head, **sections}.items()
    )
    return "\r\n".join(blocks).encode("utf-8", errors="replace")


def _weaves(loom: Loom, cloth: Draft) -> bool:
    """Return whether a loom is that of a cloth, and one that can be read from a file."""
    moved = loom.treadling if loom.liftplan is None else loom.liftplan
    if not any(loom.threading) or not any(moved):
        return False
    return np.array_equal(loom.drawdown(), cloth.drawdown)


def _one_line(title: str) -> str:
    return re.sub("[\r\n]+", " ", title).strip()


def _family(
    threads: int, colors: Sequence[int], spacing: float | None, thickness: float | None
) -> list[str]:
    common = Counter(colors).most_common(1)[0][0]
    lines = [f"Threads={threads}", f"Color={common}", "Units=Centimeters"]
    if spacing is not None:
        lines.append(f"Spacing={_centimetres(spacing)}")
    if thickness is not None:
        lines.append(f"Thickness={_centimetres(thickness)}")
    return lines


def _default(length: float | None, threads: NDArray[np.float64] | None) -> float | None:
    return float(threads.mean()) if length is None and threads is not None else length


def _color_table(
    *families: NDArray[np.uint8],
) -> tuple[list[list[int]], list[tuple[int, ...]]]:
    """Return the number in the table of each thread's colour, and the table."""
    number: dict[tuple[int, ...], int] = {}
    numbers = [
        [number.setdefault(tuple(color), len(number) + 1) for color in family.tolist()]
        for family in families
    ]
    return numbers, list(number)


def _centimetres(length: float) -> str:
    # Shifting the point of the shortest decimal loses nothing; 100 * length would round, and the
    # draft read again would differ in the last bit.
    return format(Decimal(repr(float(length))).scaleb(2), "f")


def _lengths(lengths: NDArray[np.float64] | None) -> list[str]:
    return _lines(_centimetres(length) for length in lengths) if lengths is not None else []


def _listed(rows: Iterable[Sequence[int]]) -> list[str]:
    return _lines(",".join(map(str, row)) or "0" for row in rows)


def _lines(values: Iterable[object]) -> list[str]:
    return [f"{index}={value}" for index, value in enumerate(values, start=1)]
