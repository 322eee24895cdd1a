"""Make the drafts of this folder that are not copies of files: python scenes/drafts/make.py

Four are our own; they follow the textbook set-up of weaves that none of the other drafts has. Five
are tartans, woven in 2/2 twill from thread counts of a public collection (see ORIGIN.md).
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from spacemap_vtk.io.drafts.wif_writer import format_wif
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.drafts.loom import Loom, Rows

HERE = Path(__file__).parent
NATURAL, INDIGO, RUST, MADDER, SAGE = (
    (236, 228, 208),
    (34, 58, 112),
    (158, 74, 36),
    (150, 32, 44),
    (128, 150, 126),
)
#: Spacing of both families, and widths that close the cloth: of the warp and a single weft; of
#: tabby and a pattern weft that is twice as thick. All in m.
SPACING, PLAIN, FINE, THICK = 0.6e-3, 0.55e-3, 0.4e-3, 0.8e-3
#: Colours of tartans, as their collection has them, by letter.
TARTAN_COLORS = {
    "a": (0x43, 0x67, 0xAE),
    "b": (0x00, 0x00, 0x52),
    "g": (0x11, 0x45, 0x0D),
    "k": (0x00, 0x00, 0x00),
    "r": (0xAA, 0x00, 0x00),
    "w": (0xAA, 0xAA, 0xAA),
    "y": (0xAA, 0xAA, 0x00),
}
#: Half the threads of a repeat by name: letters of colours with numbers of threads, as in their
#: collection, where the counts in brackets come forwards, then backwards.
TARTANS = {
    "Gordon": "b12(k2b2k2b2k12g12y2g12k12b11k2)b2",
    "MacGregor": "r36(g18r4g6k1)w2",
    "Menzies Dress": "r36(w4r3w4r6w2r1)w12",
    "MacLeod of Lewis": "r1(y12k8y1)k8",
    "Anderson": "r3(a6r1k2r1a18k3w3k3y1k1y1k4r1b4r3g6r2g6)r4",
}


def draft(
    title: str,
    threading: list[int],
    tieup: Rows,
    treadling: list[int],
    pattern: tuple[int, int, int] | None = None,
) -> Draft:
    """Return a draft; every other pick is of a thick pattern weft if its colour is given."""
    ground = SAGE if pattern is None else NATURAL
    loom = Loom(tuple((s,) for s in threading), tieup, tuple((t,) for t in treadling))
    ends, picks = len(threading), len(treadling)
    weft = np.full((picks, 3), ground, dtype=np.uint8)
    thickness = np.full(picks, FINE)
    if pattern is not None:
        weft[::2], thickness[::2] = pattern, THICK
    return Draft(
        loom.drawdown(),
        loom,
        DraftThreads(
            spacing=SPACING, thickness=PLAIN, colors=np.full((ends, 3), NATURAL, dtype=np.uint8)
        ),
        DraftThreads(
            spacing=SPACING, thickness=PLAIN if pattern is None else thickness, colors=weft
        ),
        title,
    )


def with_tabby(treadles: list[int], tabby: tuple[int, int]) -> list[int]:
    """Follow each pattern pick with a tabby pick, on both tabby treadles in turn."""
    pairs = ((treadle, tabby[number % 2]) for number, treadle in enumerate(treadles))
    return [treadle for pair in pairs for treadle in pair]


def overshot() -> Draft:
    """Return four blocks on opposites, woven as drawn in."""
    shafts = {"A": (1, 2), "B": (2, 3), "C": (3, 4), "D": (4, 1)}
    blocks = [*"ABCD" * 2, *"CBAD", *"ABCDCBA", *"DABC", *"DCBA" * 2]
    threading: list[int] = []
    for block in blocks:
        for _ in range(6 if block == "D" else 4):
            # Odd and even shafts alternate, so that the ground is plain.
            threading.append(next(s for s in shafts[block] if s % 2 != (len(threading) % 2)))
    tieup = ((3, 4), (1, 4), (1, 2), (2, 3), (1, 3), (2, 4))
    picks = [n for block in blocks for n in [1 + "ABCD".index(block)] * (3 if block == "D" else 2)]
    title = "Overshot, woven as drawn in"
    return draft(title, threading, tieup, with_tabby(picks, (5, 6)), INDIGO)


def summer_and_winter() -> Draft:
    """Return two blocks in a checked profile, treadled in pairs."""
    units = {"A": [1, 3, 2, 3], "B": [1, 4, 2, 4]}
    profile = "AABBABABBAABBABABB"
    threading = [shaft for block in profile for shaft in units[block]]
    tieup = ((1, 4), (2, 4), (1, 3), (2, 3), (1, 2), (3, 4))
    first = {"A": 1, "B": 3}
    picks = [first[block] + side for block in profile for side in (0, 1, 1, 0)]
    title = "Summer and winter, in pairs"
    return draft(title, threading, tieup, with_tabby(picks, (5, 6)), RUST)


def monks_belt() -> Draft:
    """Return two blocks on opposites, in four sizes."""
    sizes = (4, 2, 2, 4, 2, 2, 4, 6)
    blocks = [(number % 2, size) for number, size in enumerate(sizes * 2)]
    threading = [1 + 2 * block + end % 2 for block, size in blocks for end in range(2 * size)]
    picks = [2 - block for block, size in blocks for _ in range(size)]
    tieup = ((1, 2), (3, 4), (1, 3), (2, 4))
    return draft("Monk's belt", threading, tieup, with_tabby(picks, (3, 4)), MADDER)


def huck_lace() -> Draft:
    """Return squares of weft floats and of warp floats, with plain weave between them."""
    half = [1, 2, 1, 2, 1], [4, 3, 4, 3, 4]
    threading = [*half[0], *half[1]] * 4
    # Treadles: both tabbies, and each without the shaft of one half unit.
    tieup = ((1, 3), (2, 4), (4,), (1,))
    lace = [1, 3, 1, 3, 1, 2, 4, 2, 4, 2]
    plain = [1, 2, 1, 2, 1, 2, 1, 2, 1, 2]
    return draft("Huck lace", threading, tieup, [*lace * 2, *plain] * 2)


def tartan(name: str) -> Draft:
    """Return so many repeats of a tartan in 2/2 twill that both fit."""
    stripes = [(color, int(count)) for color, count in re.findall(r"([a-z])(\d+)", TARTANS[name])]
    stripes.reverse()  # the last ones are narrower: more colours are seen near the first corner
    repeat = [color for color, count in [*stripes, *stripes[-2:0:-1]] for _ in range(count)]
    count = math.lcm(4, len(repeat))
    threading = [1 + thread % 4 for thread in range(count)]
    made = draft(f"{name} tartan", threading, ((1, 2), (2, 3), (3, 4), (4, 1)), threading)
    colors = np.array([TARTAN_COLORS[color] for color in repeat], dtype=np.uint8)
    threads = replace(made.warp, colors=np.resize(colors, (count, 3)))
    return replace(made, warp=threads, weft=threads)


if __name__ == "__main__":
    for make in (overshot, summer_and_winter, monks_belt, huck_lace):
        (HERE / f"{make.__name__}.wif").write_bytes(format_wif(make()))
    for name in TARTANS:
        file = f"tartan_{name.lower().replace(' ', '_')}.wif"
        (HERE / file).write_bytes(format_wif(tartan(name)))
