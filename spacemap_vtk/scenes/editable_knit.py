"""A knit's chart on the screen, and the scene values that result from editing it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import lcm
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.textiles.knit import Knit
from spacemap_vtk.ndarrays import Bytes
from spacemap_vtk.textile.rods.stitches import (
    STRUCTURES,
    loops_used,
    parse_chart,
    plan_passes,
    stitches_made,
    words_of,
)

#: Most stitches that a chart shows.
_MOST = 2000
#: What each word of a row does, and the cables that are offered.
STITCHES = {
    "k": "knit",
    "p": "purl",
    "t": "tuck",
    "m": "miss",
    "f": "miss, float in front",
    "yo": "yarn over",
    "k2tog": "k2tog",
    "ssk": "ssk",
    "sk2p": "sk2p",
    "s2kp": "s2kp",
    "c4f": "cable left",
    "c4b": "cable right",
}


@dataclass(frozen=True, eq=False)
class EditableKnit:
    """A repeat of a knit, the lowest row first."""

    #: (rows, stitches), words of each row from the left; a cable as c4f, and empty beside it.
    stitches: NDArray[np.str_]
    #: (rows, stitches, 3), colour of each stitch.
    colors: Bytes
    #: (k, 3), colours of the scene.
    palette: Bytes

    @property
    def size(self) -> tuple[int, int]:
        """Number of stitches and of rows."""
        return self.stitches.shape[1], self.stitches.shape[0]

    def with_stitch(self, x: int, y: int, word: str) -> EditableKnit:
        """Change a stitch, counted from the left and from below, from 0, or begin a cable there."""
        stitches = self.stitches.copy()
        size = stitches_made(word)
        x = min(x, len(stitches[y]) - size)
        if x < 0:
            raise InputError(f"the chart is narrower than a cable of {size} stitches")
        for place in range(x, x + size):
            start = self.start_of(place, y)
            stitches[y, start : start + stitches_made(self.stitches[y, start])] = "k"
        stitches[y, x : x + size] = ""
        stitches[y, x] = word
        return replace(self, stitches=stitches)

    def start_of(self, x: int, y: int) -> int:
        """Return where the cable of a stitch begins, or the stitch itself."""
        return max(k for k in range(x + 1) if self.stitches[y, k])

    def surplus(self, y: int) -> int:
        """Return how many stitches a row makes more than it uses of the row below; 0 if it fits."""
        return sum(stitches_made(word) - loops_used(word) for word in self.stitches[y] if word)

    def with_color(self, x: int | None, y: int, color: tuple[int, int, int]) -> EditableKnit:
        """Change the colour of a stitch, or of a whole row if x is None."""
        colors = self.colors.copy()
        colors[y, slice(None) if x is None else x] = color
        return replace(self, colors=colors)

    def with_replaced_color(
        self, old: tuple[int, int, int], new: tuple[int, int, int]
    ) -> EditableKnit:
        """Replace a colour everywhere."""
        colors, palette = self.colors.copy(), self.palette.copy()
        for each in (colors, palette):
            each[(each == np.array(old, dtype=np.uint8)).all(axis=-1)] = new
        return replace(self, colors=colors, palette=palette)

    def with_rows(self, rows: tuple[str, ...]) -> EditableKnit:
        """Change the stitches to those of a structure, and keep the colours."""
        given = _letters(rows)
        height, width = (
            lcm(a, b) for a, b in zip(given.shape, _least(self.colors).shape, strict=False)
        )
        return EditableKnit(
            _repeat(given, height, width),
            _repeat(_least(self.colors), height, width),
            self.palette,
        )

    def resize(self, stitches: int, rows: int) -> EditableKnit:
        """Cut or repeat the chart."""
        if stitches * rows > _MOST:
            raise InputError(f"a chart shows at most {_MOST} stitches")
        letters = _repeat(self.stitches, rows, stitches)
        for row in letters:
            for x in np.flatnonzero(row):
                if x + stitches_made(row[x]) > stitches:
                    row[x:] = "k"
        return EditableKnit(letters, _repeat(self.colors, rows, stitches), self.palette)

    def values(self) -> dict[str, Any]:
        """Return the values of the scene by key; None removes a key."""
        rows = tuple("".join(row) for row in _least(self.stitches))
        if (self.colors == self.colors[:, :1]).all():
            words = [_hex(color) for color in _least(self.colors[:, :1])[:, 0]]
            return {
                "rows": _rows_value(rows),
                "chart": None,
                "color": words[0] if len(words) == 1 else words,
            }
        colors = self.colors.reshape(-1, 3).tolist()
        palette = list(dict.fromkeys(map(tuple, [*self.palette.tolist(), *colors])))
        used = [color for color in palette if list(color) in colors]
        # Colours that no stitch has are kept, unless there are too many for the letters.
        palette = palette if len(palette) <= 26 else used
        if len(palette) > 26:
            raise InputError("a chart has at most 26 colours")
        grid = _least(self.colors)
        chart = [
            "".join(chr(ord("A") + palette.index(tuple(color))) for color in row)
            for row in grid.tolist()
        ]
        return {
            "rows": _rows_value(rows),
            "chart": list(parse_chart(chart)),
            "color": [_hex(color) for color in palette],
        }


def make_editable_knit(rows: Any, chart: Any, color: Any) -> EditableKnit:
    """Make the chart of a knit from the values of a textile."""
    stitches = _letters(rows)
    palette = np.reshape(Knit.colors if color is None else color, (-1, 3)).astype(np.uint8)
    if chart is None:
        colors = palette[:, None]
    else:
        numbers = np.array([[ord(letter) for letter in row] for row in chart]) - ord("A")
        colors = palette[np.minimum(numbers, len(palette) - 1)]
    height, width = (lcm(a, b) for a, b in zip(stitches.shape, colors.shape[:2], strict=True))
    if height * width > _MOST:
        raise InputError(
            f"rows and colours repeat themselves only after {width} × {height} stitches; a chart "
            f"shows at most {_MOST}"
        )
    return EditableKnit(_repeat(stitches, height, width), _repeat(colors, height, width), palette)


def require_knittable(values: dict[str, Any]) -> None:
    """Refuse values of `EditableKnit.values` that no yarn can knit."""
    rows = values["rows"]
    plan_passes(STRUCTURES[rows] if isinstance(rows, str) else rows, values["chart"] or ())


def _letters(rows: tuple[str, ...]) -> NDArray[np.str_]:
    """Return a word for each stitch: a letter, a cable at its first stitch, or nothing."""
    grid = [
        [cell for word in words_of(row) for cell in (word, *[""] * (stitches_made(word) - 1))]
        for row in rows
    ]
    return np.array(grid, dtype="<U5")


def _repeat(grid: Any, rows: int, stitches: int) -> Any:
    """Cut or repeat a grid along its first two axes."""
    height, width = grid.shape[:2]
    return grid[np.ix_(np.arange(rows) % height, np.arange(stitches) % width)]


def _least(grid: Any) -> Any:
    """Return the smallest part of which a grid is a repeat."""
    for axis in (0, 1):
        count = grid.shape[axis]
        period = next(
            k
            for k in range(1, count + 1)
            if count % k == 0 and (np.roll(grid, k, axis=axis) == grid).all()
        )
        grid = grid.take(np.arange(period), axis=axis)
    return grid


def _rows_value(rows: tuple[str, ...]) -> str | list[str]:
    """Return the name of a structure, or its rows."""
    return next((name for name, own in STRUCTURES.items() if own == rows), list(rows))


def _hex(color: Any) -> str:
    return "#{:02x}{:02x}{:02x}".format(*color)
