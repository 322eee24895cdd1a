"""Drafts: drawdowns with the loom, colours and spacings that a draft file stores."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Bools, Ints
from spacemap_vtk.textile.drafts.drawdown import as_drawdown
from spacemap_vtk.textile.drafts.loom import Loom, Rows
from spacemap_vtk.textile.weave.threads import Lengths, repeat_values


@dataclass(frozen=True, kw_only=True, eq=False)
class DraftThreads:
    """Colours, spacings and thicknesses of the warp or weft in a draft; None if not given.

    They are not yet the measures of a cloth: a draft gives each thread a space, draws it in the
    middle of that space, and gives the width at which to draw it.

    Parameters
    ----------
    spacing, thickness : float or ndarray, optional
        In metres: one value for all threads, or (n,) one for each.
    colors : (n, 3) uint8, optional
        RGB colour of each thread.
    """

    spacing: Lengths | None = None
    thickness: Lengths | None = None
    colors: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        if self.colors is not None:
            object.__setattr__(self, "colors", np.ascontiguousarray(self.colors, dtype=np.uint8))

    def repeat(self, count: int) -> DraftThreads:
        """Repeat the values over a number of threads.

        Parameters
        ----------
        count : int
            Number of threads.

        Returns
        -------
        DraftThreads
            Values of single threads start again after the last one.
        """
        return replace(
            self,
            spacing=None if self.spacing is None else repeat_values(self.spacing, count),
            thickness=None if self.thickness is None else repeat_values(self.thickness, count),
            colors=None if self.colors is None else np.resize(self.colors, (count, 3)),
        )

    def fill_spaces(self, spacing: float) -> DraftThreads:
        # Threads without a thickness fill their spaces, in m.
        if self.thickness is not None:
            return self
        return replace(self, thickness=spacing if self.spacing is None else self.spacing)

    def crop(self, part: slice | Ints) -> DraftThreads:
        # Some of the threads, in the order of their indices.
        values = {name: getattr(self, name) for name in ("spacing", "thickness", "colors")}
        own = {name: value[part] for name, value in values.items() if np.ndim(value)}
        return replace(self, **own)


@dataclass(frozen=True, eq=False)
class Draft:
    """A weave: its drawdown, and what else a draft file may store.

    Parameters
    ----------
    drawdown : (picks, ends) bool
        True: the end lies over the pick.
    loom : Loom, optional
        Threading, tie-up, treadling or liftplan that weave the drawdown.
    warp, weft : DraftThreads, optional
        Colours, spacings and thicknesses.
    title : str, optional
        Name of the draft.
    warnings : tuple of str, optional
        Problems found in the source of the draft.
    other_sections : dict of str to tuple of str, optional
        Contents of a WIF file that do not describe the cloth, such as its author: lines by section.

    Raises
    ------
    InputError
        The drawdown is not a matrix with at least one pick and one end, or the number of colours
        is not the number of yarns.

    Examples
    --------
    >>> Draft([[True, False, True], [False, True, False]]).size
    (3, 2)
    """

    drawdown: Bools
    loom: Loom | None = None
    warp: DraftThreads = field(default_factory=DraftThreads)
    weft: DraftThreads = field(default_factory=DraftThreads)
    title: str = ""
    warnings: tuple[str, ...] = ()
    other_sections: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "drawdown", as_drawdown(self.drawdown))
        object.__setattr__(self, "warnings", tuple(self.warnings))
        picks, ends = self.drawdown.shape
        for key, colors, count, yarn in (
            ("warp_colors", self.warp.colors, ends, "end"),
            ("weft_colors", self.weft.colors, picks, "pick"),
        ):
            if colors is not None and colors.shape != (count, 3):
                raise InputError(
                    f"each {yarn} needs one RGB colour; the array has shape {colors.shape}",
                    key=key,
                    allowed=f"({count}, 3)",
                )

    @property
    def size(self) -> tuple[int, int]:
        """Numbers of ends and picks."""
        return self.drawdown.shape[1], self.drawdown.shape[0]

    def trim(self) -> Draft:
        """Remove unused threads at the edges.

        Returns
        -------
        Draft
            Without ends at the sides that pass through no heddle, and without picks at beginning
            and end that have no shed. The draft itself if it has none of them, or no loom.
        """
        if self.loom is None:
            return self
        ends, picks = _used_slice(self.loom.threading), _used_slice(self.loom.sheds())
        if self.drawdown[picks, ends].shape == self.drawdown.shape:
            return self
        return self.crop(ends, picks)

    def crop(self, ends: slice, picks: slice) -> Draft:
        """Cut out a part.

        Parameters
        ----------
        ends, picks : slice
            Threads that stay.

        Returns
        -------
        Draft
            With the same shafts and treadles.
        """
        loom = self.loom
        if loom is not None:
            lifted = None if loom.liftplan is None else loom.liftplan[picks]
            loom = replace(
                loom,
                threading=loom.threading[ends],
                treadling=loom.treadling[picks],
                liftplan=lifted,
            )
        return replace(
            self,
            drawdown=self.drawdown[picks, ends],
            loom=loom,
            warp=self.warp.crop(ends),
            weft=self.weft.crop(picks),
        )

    def find_loom(self, drawdown: Bools) -> Loom:
        """Find a loom that weaves a cloth.

        Parameters
        ----------
        drawdown : (picks, ends) bool
            Drawdown of the cloth.

        Returns
        -------
        Loom
            The draft's loom, repeated, if it weaves the cloth; otherwise the smallest loom that
            does.
        """
        if self.loom is not None:
            loom = self.loom.repeat(drawdown.shape[1], len(drawdown))
            if np.array_equal(loom.drawdown(), drawdown):
                return loom
        return Loom.from_drawdown(drawdown)


def _used_slice(rows: Rows) -> slice:
    """Find where the rows that are not empty begin and end."""
    used = [index for index, row in enumerate(rows) if row]
    return slice(used[0], used[-1] + 1) if used else slice(None)
