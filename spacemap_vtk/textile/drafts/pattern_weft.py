"""Pattern wefts over a plain ground: overshot, summer and winter, supplementary wefts.

Such a cloth is a plain weave of ends and tabby picks with a pattern pick in each shed. On the loom
pattern picks are beaten up against each other, and the tabby disappears beneath them.

Tabby picks lie over and under one end in turn. A pattern weft is one whose picks lie between two
tabby picks of opposite sheds, so that the cloth without it is a plain weave. That distinguishes it
from huck and other laces, whose plain picks on both sides of a float open the same shed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.ndarrays import Bools, Floats
from spacemap_vtk.textile.drafts.drawdown import as_drawdown, tile_drawdown

#: Least share of neighbouring ends that a tabby pick separates: a draft may have errors.
_LEAST_ALTERNATION = 0.95
#: Least share of the pattern picks that have tabby on both sides, and between whose two tabby picks
#: the ends change.
_LEAST_ORDER = 0.9
#: A pattern pick floats over so many ends, or is so many times as thick as the tabby.
_LEAST_FLOAT = 3
_LEAST_RATIO = 1.25


class PatternWeft(NamedTuple):
    """The picks of a cloth with a pattern weft; a pick that is neither belongs to plain borders."""

    tabby: Bools
    """(picks,) Plain picks beside a pattern pick."""
    pattern: Bools
    """(picks,) Picks that lie on the ground and may cover the tabby."""


def find_pattern_weft(
    drawdown: ArrayLike, thickness: ArrayLike | None = None
) -> PatternWeft | None:
    """Find tabby and pattern picks, or None; a thicker weft need not float as far."""
    matrix = as_drawdown(drawdown)
    picks, ends = matrix.shape
    if ends < 2 * _LEAST_FLOAT:
        matrix = tile_drawdown(matrix, 2 * _LEAST_FLOAT * ends, picks)
    alternation = (matrix[:, 1:] != matrix[:, :-1]).mean(axis=1)
    plain = alternation >= _LEAST_ALTERNATION
    pattern = np.flatnonzero(~plain)
    inner = pattern[(pattern > 0) & (pattern < picks - 1)]
    if not inner.size:
        return None
    between = plain[inner - 1] & plain[inner + 1]
    opposite = (matrix[inner - 1] != matrix[inner + 1]).mean(axis=1) >= _LEAST_ALTERNATION
    if min(between.mean(), opposite[between].mean() if between.any() else 0.0) < _LEAST_ORDER:
        return None
    tabby = np.zeros(picks, dtype=bool)
    for side in (-1, 1):
        beside = pattern + side
        beside = beside[(beside >= 0) & (beside < picks)]
        tabby[beside[plain[beside]]] = True
    if not _stands_out(matrix, tabby, ~plain, thickness):
        return None
    return PatternWeft(tabby, ~plain)


def _stands_out(matrix: Bools, tabby: Bools, pattern: Bools, thickness: ArrayLike | None) -> bool:
    """Return whether most pattern picks float far, or are thicker than the tabby."""
    if thickness is not None:
        widths: Floats = np.broadcast_to(np.asarray(thickness, dtype=np.float64), len(matrix))
        if widths[pattern].mean() >= _LEAST_RATIO * widths[tabby].mean():
            return True
    windows = np.lib.stride_tricks.sliding_window_view(matrix[pattern], _LEAST_FLOAT, axis=1)
    over = np.count_nonzero(windows, axis=2)
    floats = np.isin(over, (0, _LEAST_FLOAT)).any(axis=1)
    return bool(np.mean(floats) >= 0.5)
