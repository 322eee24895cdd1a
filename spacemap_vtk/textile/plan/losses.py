"""Usual draw-in and shrinkage of cloth, by material: a guess until a sample has been measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from spacemap_vtk.textile.weave.yarn_library import Yarn

_HANDWOVEN = 'S. Bateman and M. Parsons, "Planning a Weaving Project", Handwoven (2022)'


class Losses(NamedTuple):
    """Draw-in and shrinkage of cloth of a material."""

    draw_in: float
    """Share by which the cloth on the loom is narrower than the warp in the reed."""
    shrinkage: float
    """Share by which the cloth becomes shorter and narrower when it is washed."""
    source: str
    """Where the numbers come from."""


#: Losses if nothing is known about the material.
_USUAL_LOSSES = Losses(0.05, 0.1, f"{_HANDWOVEN}: 10 % without a sample; draw-in as for cotton")
#: Draw-in and shrinkage by material.
LOSSES = {
    "cotton": Losses(
        0.05,
        0.1,
        "published projects: 8/2 cotton 20.9 to 18 in, 10/2 cotton 15 % in all (draw-in and "
        "shrinkage)",
    ),
    "linen": Losses(
        0.03, 0.04, 'L. Fry, "Dimensional loss" (2010); Linencharm: shrinkage 3 to 5 %'
    ),
    "tencel": Losses(
        0.06, 0.1, f'M. Petrini, "Draw-in" (2023): 4.5 to 7.4 %; shrinkage: {_HANDWOVEN}'
    ),
}


def usual_losses(named: Sequence[Yarn]) -> Losses:
    """Return usual losses for the yarns of a family.

    Parameters
    ----------
    named : sequence of Yarn
        The first yarn's material decides; may be empty.

    Returns
    -------
    Losses
        Those of cotton for cottolin; usual ones for materials that are not in the table.
    """
    word = named[0].name.rpartition(" ")[2] if named else ""
    return LOSSES.get("cotton" if word == "cottolin" else word, _USUAL_LOSSES)
