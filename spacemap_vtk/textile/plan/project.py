"""The plan of a project: from the finished size to ends, picks, lengths and masses of yarn.

Lengths follow the cloth backwards. The finished cloth is what washing leaves of the woven one
(shrinkage); the woven one is narrower than the warp in the reed (draw-in); the warp is longer than
the cloth, because it bends around the weft (take-up), and so is the weft. Shrinkage and draw-in are
shares of the larger length: a cloth of 10 m that shrinks to 9 m has a shrinkage of 10 %. A take-up,
like a crimp, is a share of the shorter one.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Bools, Bytes, Floats, Ints
from spacemap_vtk.textile.drafts.loom import Loom
from spacemap_vtk.textile.plan.loom_use import (
    Color,
    Edges,
    Step,
    check_edges,
    color_order,
    count_heddles,
    count_steps,
)
from spacemap_vtk.textile.plan.reed import Sleying
from spacemap_vtk.textile.plan.repeat import Repeat, find_repeat
from spacemap_vtk.textile.weave.families import FAMILIES

#: More threads than this are a mistake in a length or a sett.
MOST_THREADS = 1_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedDraft:
    """The draft of a project, once.

    Parameters
    ----------
    drawdown : (picks, ends) bool
        True: the end lies over the pick.
    loom : Loom
        Threading and treadling, or liftplan, that weave the drawdown.
    colors : tuple of (n, 3) uint8
        Colours of the ends and of the picks.
    densities : tuple of (n,) float
        Mass per length of the ends and of the picks, in kg/m.
    kinds : tuple of (n,) int
        Number of each thread's yarn: threads of different yarns are never added.
    take_ups : tuple of (n,) float
        Length of each end and pick over the length of the cloth, minus 1.
    """

    drawdown: Bools
    loom: Loom
    colors: tuple[Bytes, Bytes]
    densities: tuple[Floats, Floats]
    kinds: tuple[Ints, Ints]
    take_ups: tuple[Floats, Floats]


@dataclass(frozen=True, kw_only=True)
class ProjectRequest:
    """What is to be woven, and how; lengths in m, setts in 1/m.

    Parameters
    ----------
    width, length : float
        Finished size of a piece, without fringes and with its hems turned under.
    pieces : int
        Number of pieces on one warp.
    hem : float
        Length that is turned under at each end of a piece, as finished.
    fringe : float
        Unwoven warp at each end of a piece.
    ends, picks : int, optional
        Numbers of threads of a piece; by default those of whole repeats that come nearest to the
        size.
    sleying : Sleying
        Reed and ends per dent, which decide the sett of the warp.
    weft_sett : float
        Picks per metre on the loom.
    draw_in : float
        Share by which the cloth is narrower than the warp in the reed.
    warp_shrinkage, weft_shrinkage : float
        Share by which the cloth becomes shorter and narrower when it is washed.
    waste : float
        Length of warp that cannot be woven.
    sample : float
        Length of warp for a sample.
    floating : int, optional
        Number of floating selvedge ends; by default 2 if the draft needs them, otherwise none.
    allowance : float
        Share of yarn that is bought in addition.
    """

    width: float
    length: float
    pieces: int = 1
    hem: float = 0.0
    fringe: float = 0.0
    ends: int | None = None
    picks: int | None = None
    sleying: Sleying
    weft_sett: float
    draw_in: float = 0.0
    warp_shrinkage: float = 0.0
    weft_shrinkage: float = 0.0
    waste: float = 0.0
    sample: float = 0.0
    floating: int | None = None
    allowance: float = 0.0


@dataclass(frozen=True)
class YarnNeed:
    """Yarn of one colour and count that a family needs, without the allowance."""

    #: "warp" or "weft".
    family: str
    #: Red, green and blue from 0 to 255.
    color: Color
    #: Mass per length, in kg/m.
    density: float
    #: Number of the yarn, as in the draft.
    kind: int
    #: Number of ends, or of picks of all pieces.
    threads: int
    #: Total length, in m.
    length: float

    @property
    def mass(self) -> float:
        """Total mass, in kg."""
        return self.length * self.density


@dataclass(frozen=True, kw_only=True)
class Project:
    """A plan; lengths in m. Numbers of picks are those of a piece."""

    request: ProjectRequest
    #: Without floating selvedges.
    ends: int
    picks: int
    floating: int
    edges: Edges
    #: Repeats along the warp's and the weft's threads.
    repeats: tuple[Repeat, Repeat]
    #: Width of the warp in the reed.
    reed_width: float
    #: Width and length of a piece off the loom.
    woven_width: float
    woven_length: float
    #: Size of a piece when it is washed and hemmed.
    finished_width: float
    finished_length: float
    #: Mean take-up of the warp and of the weft.
    take_ups: tuple[float, float]
    #: Length of warp that a piece needs, fringes included.
    piece_length: float
    warp_length: float
    #: Need of each colour of the warp, then of the weft.
    yarns: tuple[YarnNeed, ...]
    #: Number of heddles on each shaft.
    heddles: dict[int, int]
    #: Steps of all pieces.
    steps: tuple[Step, ...]
    #: Whether the steps lift shafts, as a liftplan says, instead of pressing treadles.
    lifts: bool
    #: Stripes of one repeat of the warp, and of the weft.
    orders: tuple[list[tuple[Color, int]], list[tuple[Color, int]]]

    @property
    def dents(self) -> int:
        """Number of dents that the ends need, with a dent for each floating selvedge."""
        return self.request.sleying.dents(self.ends) + self.floating

    def total_length(self, family: int) -> float:
        """Return the length of all yarns of a family.

        Parameters
        ----------
        family : int
            0 for the warp, 1 for the weft.

        Returns
        -------
        float
            In m.
        """
        return sum(yarn.length for yarn in self.yarns if yarn.family == FAMILIES[family])


def plan_project(draft: PlannedDraft, request: ProjectRequest) -> Project:
    """Plan a project.

    Parameters
    ----------
    draft : PlannedDraft
        The draft, which is repeated over the cloth.
    request : ProjectRequest
        The size, and what happens to it on the loom and in the wash.

    Returns
    -------
    Project
        Numbers of threads are rounded to whole repeats, so the finished size differs from the
        requested one.

    Raises
    ------
    InputError
        A share is 1 or more, or the size needs too many threads.
    """
    _check(request)
    sett, repeats = request.sleying.sett, _repeats(draft)
    ends = request.ends or _round(
        repeats[0],
        request.width * sett / ((1.0 - request.weft_shrinkage) * (1.0 - request.draw_in)),
        "width",
    )
    on_loom = (request.length + 2.0 * request.hem) / (1.0 - request.warp_shrinkage)
    picks = request.picks or _round(repeats[1], on_loom * request.weft_sett, "length")
    woven_length, reed_width = picks / request.weft_sett, ends / sett
    woven_width = reed_width * (1.0 - request.draw_in)
    uses = [
        np.bincount(np.arange(count) % len(colors), minlength=len(colors))
        for count, colors in zip((ends, picks), draft.colors, strict=True)
    ]
    last = (ends - 1) % len(uses[0])
    edges = check_edges(
        draft.drawdown[:, 0],
        draft.drawdown[:, last],
        len(np.unique(np.column_stack([draft.colors[1], draft.kinds[1]]), axis=0)),
    )
    floating = (2 if edges.need_floating else 0) if request.floating is None else request.floating
    warp_take_up, weft_take_up = (
        float(np.average(each, weights=count))
        for each, count in zip(draft.take_ups, uses, strict=True)
    )
    piece = woven_length * (1.0 + warp_take_up) + 2.0 * request.fringe
    warp_length = request.pieces * piece + request.sample + request.waste
    # Floating selvedges are like the outer ends, in turn.
    np.add.at(uses[0], np.resize([0, last], floating), 1)
    yarns = (
        *_needs(draft, 0, uses[0], np.full(len(uses[0]), warp_length)),
        *_needs(draft, 1, request.pieces * uses[1], reed_width * (1.0 + draft.take_ups[1])),
    )
    return Project(
        request=request,
        ends=ends,
        picks=picks,
        floating=floating,
        edges=edges,
        repeats=repeats,
        reed_width=reed_width,
        woven_width=woven_width,
        woven_length=woven_length,
        finished_width=woven_width * (1.0 - request.weft_shrinkage),
        finished_length=woven_length * (1.0 - request.warp_shrinkage) - 2.0 * request.hem,
        take_ups=(warp_take_up, weft_take_up),
        piece_length=piece,
        warp_length=warp_length,
        yarns=yarns,
        heddles=count_heddles(draft.loom, ends),
        steps=tuple(count_steps(draft.loom, picks, request.pieces)),
        lifts=draft.loom.liftplan is not None,
        orders=(
            color_order(draft.colors[0][: repeats[0].size], draft.kinds[0][: repeats[0].size]),
            color_order(draft.colors[1][: repeats[1].size], draft.kinds[1][: repeats[1].size]),
        ),
    )


def _repeats(draft: PlannedDraft) -> tuple[Repeat, Repeat]:
    warp, weft = (
        find_repeat(lines, colors, np.column_stack([densities, kinds]))
        for lines, colors, densities, kinds in zip(
            (draft.drawdown.T, draft.drawdown),
            draft.colors,
            draft.densities,
            draft.kinds,
            strict=True,
        )
    )
    return warp, weft


def _round(repeat: Repeat, count: float, key: str) -> int:
    """Round a number of threads to whole repeats; refuse one that is far too large."""
    if not count < MOST_THREADS:
        threads = "ends" if key == "width" else "picks"
        raise InputError(
            f"this {key} needs {count:.3g} {threads}",
            key=key,
            allowed=f"up to {MOST_THREADS} {threads}",
            cure=f"Check the unit of the {key}.",
        )
    return repeat.nearest(count)


def _check(request: ProjectRequest) -> None:
    """Refuse shares that leave nothing, and lengths that are not positive."""
    for key in ("draw_in", "warp_shrinkage", "weft_shrinkage"):
        if not 0.0 <= getattr(request, key) < 1.0:
            raise InputError(
                "must be a share of the larger length",
                key=key,
                value=getattr(request, key),
                allowed="0 to less than 1",
            )
    for key in ("width", "length", "weft_sett"):
        if not 0.0 < getattr(request, key) < inf:
            raise InputError("must be positive", key=key, value=getattr(request, key))


def _needs(draft: PlannedDraft, family: int, uses: Ints, lengths: Floats) -> list[YarnNeed]:
    """Add the lengths of the threads of each colour and count, in the order of the draft."""
    kinds = np.column_stack([draft.colors[family], draft.densities[family], draft.kinds[family]])
    unique, first, which = np.unique(kinds, axis=0, return_index=True, return_inverse=True)
    which = which.reshape(-1)
    threads = np.bincount(which, weights=uses)
    total = np.bincount(which, weights=uses * lengths)
    return [
        YarnNeed(
            FAMILIES[family],
            (int(unique[kind, 0]), int(unique[kind, 1]), int(unique[kind, 2])),
            float(unique[kind, 3]),
            int(unique[kind, 4]),
            int(threads[kind]),
            float(total[kind]),
        )
        for kind in np.argsort(first).tolist()
        if threads[kind]
    ]
