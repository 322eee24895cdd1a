"""Drafts: a weave to be made, with what a draft file says of its yarns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric.drawdown import as_drawdown
from spacemap_vtk.fabric.loom import Loom, Rows
from spacemap_vtk.fabric.threads import Lengths, along
from spacemap_vtk.ndarrays import Bools


@dataclass(frozen=True, kw_only=True, eq=False)
class DraftThreads:
    """What a draft says of its warp or weft; None where it says nothing.

    These are not yet the measures of a cloth: a draft gives each thread a space of its own, in
    whose middle it stands, and draws its width.

    Parameters
    ----------
    spacing, thickness : float or ndarray, optional
        In metres: of all threads, or (n,) of each.
    colors : (n, 3) uint8, optional
        RGB colour of each thread.
    """

    spacing: Lengths | None = None
    thickness: Lengths | None = None
    colors: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        if self.colors is not None:
            object.__setattr__(self, "colors", np.ascontiguousarray(self.colors, dtype=np.uint8))

    def repeated(self, count: int) -> DraftThreads:
        """Return the same over so many threads.

        Parameters
        ----------
        count : int
            How many.

        Returns
        -------
        DraftThreads
            What is said of each thread begins again after the last.
        """
        return replace(
            self,
            spacing=None if self.spacing is None else along(self.spacing, count),
            thickness=None if self.thickness is None else along(self.thickness, count),
            colors=None if self.colors is None else np.resize(self.colors, (count, 3)),
        )

    def side_by_side(self, spacing: float) -> DraftThreads:
        # They fill their spaces [m] where nothing is said of their thickness.
        if self.thickness is not None:
            return self
        return replace(self, thickness=spacing if self.spacing is None else self.spacing)

    def cut(self, part: slice) -> DraftThreads:
        # Some of the threads.
        values = {name: getattr(self, name) for name in ("spacing", "thickness", "colors")}
        own = {name: value[part] for name, value in values.items() if np.ndim(value)}
        return replace(self, **own)


@dataclass(frozen=True, eq=False)
class Draft:
    """A weave to be made: its drawdown and what else a draft file may say.

    Parameters
    ----------
    drawdown : (picks, ends) bool
        True: the end lies over the pick.
    loom : Loom, optional
        The threading, tie-up, treadling or liftplan that weave it.
    warp, weft : DraftThreads, optional
        Colours, spacings and thicknesses.
    title : str, optional
        Name of the draft.
    warnings : tuple of str, optional
        What was odd about the source of the draft.
    besides : dict of str to tuple of str, optional
        What a WIF says that is not of the cloth, such as its author: lines by section.

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
    besides: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

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
                    f"one RGB colour for each {yarn} is needed, not an array of {colors.shape}",
                    key=key,
                    allowed=f"({count}, 3)",
                )

    @property
    def size(self) -> tuple[int, int]:
        """Ends and picks."""
        return self.drawdown.shape[1], self.drawdown.shape[0]

    def trimmed(self) -> Draft:
        """Cut off what its edges have no use of.

        Returns
        -------
        Draft
            Without the ends at its sides that are in no heddle, and the picks at its beginning and
            end that have no shed; itself, if there are none, or no loom says so.
        """
        loom = self.loom
        if loom is None:
            return self
        ends, picks = _used(loom.threading), _used(loom.sheds())
        drawdown = self.drawdown[picks, ends]
        if drawdown.shape == self.drawdown.shape:
            return self
        lifted = None if loom.liftplan is None else loom.liftplan[picks]
        loom = replace(
            loom,
            threading=loom.threading[ends],
            treadling=loom.treadling[picks],
            liftplan=lifted,
        )
        warp, weft = self.warp.cut(ends), self.weft.cut(picks)
        return replace(self, drawdown=drawdown, loom=loom, warp=warp, weft=weft)

    def loom_for(self, drawdown: Bools) -> Loom:
        """Return the loom for a cloth.

        Parameters
        ----------
        drawdown : (picks, ends) bool
            Of the cloth.

        Returns
        -------
        Loom
            The draft's own, repeated, if that weaves it; else the smallest that does.
        """
        if self.loom is not None:
            loom = self.loom.tiled(drawdown.shape[1], len(drawdown))
            if np.array_equal(loom.drawdown(), drawdown):
                return loom
        return Loom.from_drawdown(drawdown)


def _used(rows: Rows) -> slice:
    """Return where rows that say something begin and end."""
    used = [index for index, row in enumerate(rows) if row]
    return slice(used[0], used[-1] + 1) if used else slice(None)
