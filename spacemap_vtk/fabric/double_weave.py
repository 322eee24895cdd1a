"""Double weaves: two cloths in one draft, of every other end and pick, one above the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Share of the crossings that must lie where both cloths are woven, each for itself; what remains
#: are edges of blocks.
_WOVEN = 0.9


def upper_cloth(drawdown: NDArray[np.bool_]) -> NDArray[np.bool_] | None:
    """Find which of two interleaved cloths lies above the other.

    Ends of the cloth above lie over all picks of the one below, and its picks over all ends of that
    one; with its own threads each cloth interlaces. Where the two change places, a block ends.

    Parameters
    ----------
    drawdown : numpy.ndarray
        (picks, ends) bool, True where the end lies over the pick.

    Returns
    -------
    numpy.ndarray or None
        (picks // 2, ends // 2) bool, for each pair of picks and of ends whether the cloth of the
        first end of each pair is above; None where the draft is not of two such cloths.

    Examples
    --------
    Two plain weaves, the first above:

    >>> plain = np.indices((4, 4)).sum(axis=0) % 2 == 0
    >>> both = np.zeros((8, 8), dtype=bool)
    >>> both[::2, ::2], both[1::2, 1::2], both[1::2, ::2] = plain, plain, True
    >>> bool(upper_cloth(both).all())
    True
    >>> upper_cloth(plain) is None
    True
    """
    picks, ends = (size // 2 * 2 for size in drawdown.shape)
    if min(picks, ends) < 4:
        return None
    cells = drawdown[:picks, :ends]
    for first in (0, 1):
        # the picks that go with the first ends: the first of each pair, or the second
        own, other = cells[first::2], cells[1 - first :: 2]
        above = other[:, ::2]
        cloths = own[:, ::2], other[:, 1::2]
        if np.array_equal(above, ~own[:, 1::2]) and all(
            _woven(above, cloth) and _woven(above.T, cloth.T) for cloth in cloths
        ):
            return np.ascontiguousarray(above)
    return None


def _woven(above: NDArray[np.bool_], cloth: NDArray[np.bool_]) -> bool:
    """Return whether the yarns along the first axis change side between two changes of place."""
    stays = above[1:] == above[:-1]
    runs = np.zeros(above.shape, dtype=np.int64)
    np.cumsum(~stays, axis=0, out=runs[1:])
    runs += np.arange(above.shape[1]) * len(above)
    turns = np.bincount(runs[1:][stays & (cloth[1:] != cloth[:-1])], minlength=above.size)
    return float((turns[runs] > 0).mean()) >= _WOVEN
