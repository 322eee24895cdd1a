"""Textures of a cloth whose yarns are less than about a pixel wide: one texel for each crossing.

A texel has the mean colour of what is visible of its crossing. That need not be its own end and
pick: a thick pattern weft covers the tabby beside it, and the upper cloth of a double weave covers
yarns of the lower one. So each local weave has its own shares of the neighbouring yarns.
"""

from __future__ import annotations

import numpy as np

from spacemap_vtk.ndarrays import AnyInts, Floats, Singles
from spacemap_vtk.textile.weave.cloth import Cloth


def visible_colors(
    weaves: AnyInts, shares: Singles, number: int, colors: Singles, first: int = 0
) -> Singles:
    """Sum the colours of a family's visible yarns at each crossing.

    Parameters
    ----------
    weaves : (picks, ends) ndarray of int
        Number of the local weave of each crossing.
    shares : (weaves, 2 n + 1) ndarray of float32
        For each local weave, the share of a crossing that its own yarn fills in the middle, and
        those of up to n neighbours on both sides.
    number : {0, 1}
        Family of the yarns: warp or weft.
    colors : (n, 3) or (picks, ends, 3) ndarray of float32
        Colours of the yarns, in linear light; one for all, one for each, or one for each at each
        crossing.
    first : int
        Number of the first pick, if `weaves` is a part of the cloth.

    Returns
    -------
    (picks, ends, 4) ndarray of float32
        The colours times their shares, and the sum of the shares.

    Examples
    --------
    >>> shares = np.array([[0, 0.75, 0.25]], np.float32)
    >>> red_blue = np.array([[1, 0, 0], [0, 0, 1]], np.float32)
    >>> visible_colors(np.zeros((1, 2), int), shares, 0, red_blue)[0, 0].tolist()
    [0.75, 0.0, 0.25, 1.0]
    """
    made = np.zeros((*weaves.shape, 4), np.float32)
    reach = shares.shape[1] // 2
    rows, columns = np.arange(weaves.shape[0]) + first, np.arange(weaves.shape[1])
    for step in range(-reach, reach + 1):
        if not shares[:, reach + step].any():
            continue
        share = shares[:, reach + step][weaves]
        if colors.ndim == 3:
            row = rows if number == 0 else np.clip(rows + step, 0, len(colors) - 1)
            column = columns
            if number == 0:
                column = np.clip(columns + step, 0, colors.shape[1] - 1)
            shown = colors[row[:, None], column]
        elif number == 0:
            shown = colors[np.clip(columns + step, 0, len(colors) - 1)]
        else:
            shown = colors[np.clip(rows + step, 0, len(colors) - 1)][:, None]
        made[..., :3] += share[..., None] * shown
        made[..., 3] += share
    return made


def grid_lines(cloth: Cloth, number: int, cells: int) -> Floats:
    """Find positions that divide a cloth into cells with equal numbers of yarns.

    Parameters
    ----------
    cloth : Cloth
        There must be room for its yarns.
    number : {0, 1}
        Family of the yarns, which lie next to each other along x (warp) or y (weft).
    cells : int
        Number of cells.

    Returns
    -------
    (cells + 1,) float64
        In m; the first and the last position are the edges of the cloth. A share k / cells of the
        yarns lies before position k.
    """
    place = cloth.yarns[number].position
    reach = cloth.families[1 - number].overhang
    width = 0.5 * cloth.families[number].width
    past = max(reach, width)
    borders = np.concatenate(
        [[place[0] - past], 0.5 * (place[1:] + place[:-1]), [place[-1] + past]]
    )
    return np.interp(np.linspace(0.0, len(place), cells + 1), np.arange(len(borders)), borders)
