"""YarnFloats of a cloth: where yarns pass several crossings on one side, on either face."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from spacemap_vtk.ndarrays import Bools, Ints
from spacemap_vtk.textile.drafts.draft import Draft
from spacemap_vtk.textile.drafts.drawdown import as_drawdown


class YarnFloats(NamedTuple):
    """YarnFloats of one family on one face, as arrays (floats,) in the order of the yarns."""

    yarn: Ints
    """The yarn that floats, from 0."""
    begin: Ints
    """First yarn of the other family that it passes, from 0."""
    length: Ints
    """Number of crossings that it passes."""

    def longer_than(self, most: int) -> YarnFloats:
        """Select long floats.

        Parameters
        ----------
        most : int
            Number of crossings.

        Returns
        -------
        YarnFloats
            Those that pass more crossings.
        """
        return YarnFloats(*(column[self.length > most] for column in self))

    @property
    def longest(self) -> int:
        """Crossings of the longest float; 0 if there is none."""
        return int(self.length.max(initial=0))


#: Most crossings of floats of ends, and of floats of picks.
FloatLimits = tuple[int, int]


def float_limits(draft: Draft, length: float) -> FloatLimits | None:
    """Convert a length of floats to numbers of crossings.

    Parameters
    ----------
    draft : Draft
        Its mean spacings are used.
    length : float
        In metres.

    Returns
    -------
    tuple of int, or None
        Most crossings of floats of ends and of picks that are not longer; at least 1. None if the
        draft gives no spacing.
    """
    limits = []
    for threads in (draft.weft, draft.warp):
        if threads.spacing is None:
            return None
        spacing = float(np.mean(np.asarray(threads.spacing)))
        limits.append(max(1, int(length / spacing * (1.0 + 1e-9))))
    return limits[0], limits[1]


def find_floats(drawdown: ArrayLike, family: int, face: bool = True) -> YarnFloats:
    """Find all floats of the warp or the weft on one face of a cloth.

    Parameters
    ----------
    drawdown : (picks, ends) array_like
        True: the end lies over the pick.
    family : int
        0: floats of ends, over picks. 1: floats of picks, over ends.
    face : bool
        True: the face, which the drawdown shows. False: the reverse.

    Returns
    -------
    YarnFloats
        Also those of a single crossing. A float ends at the edge of the drawdown, even if it would
        continue in the next repeat.

    Examples
    --------
    >>> floats = find_floats([[1, 1, 0, 0, 0]], family=1)
    >>> floats.begin.tolist(), floats.length.tolist()
    ([2], [3])
    """
    matrix = as_drawdown(drawdown)
    # The warp is on the face where the drawdown is True, and the weft where it is False.
    on_face = matrix.T if family == 0 else ~matrix
    shown = on_face if face else ~on_face
    padded = np.pad(shown, ((0, 0), (1, 1))).astype(np.int8)
    steps = np.diff(padded, axis=1)
    yarn, begin = np.nonzero(steps == 1)
    _, end = np.nonzero(steps == -1)
    return YarnFloats(yarn, begin, end - begin)


def mark_floats(drawdown: ArrayLike, limits: FloatLimits, face: bool = True) -> Bools:
    """Mark the crossings of long floats on one face.

    Parameters
    ----------
    drawdown : (picks, ends) array_like
        True: the end lies over the pick.
    limits : tuple of int
        Most crossings of floats of ends, and of picks, that are not marked.
    face : bool
        True: the face, which the drawdown shows. False: the reverse.

    Returns
    -------
    (picks, ends) bool
        True where the yarn that is seen on this face floats over more crossings.
    """
    shape = as_drawdown(drawdown).shape
    marks = np.zeros(shape, bool)
    for family, most in enumerate(limits):
        yarn, begin, length = find_floats(drawdown, family, face).longer_than(most)
        yarns, others = shape[::-1] if family == 0 else shape
        # +1 where a float begins, -1 after its end: floats of one yarn on one face do not touch.
        steps = np.zeros((yarns, others + 1), np.int8)
        steps[yarn, begin] = 1
        steps[yarn, begin + length] = -1
        floating = np.cumsum(steps[:, :-1], axis=1, dtype=np.int8) > 0
        marks |= floating.T if family == 0 else floating
    return marks
