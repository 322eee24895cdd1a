"""Textures of a cloth whose yarns are less than about a pixel wide: one texel for each crossing.

Both faces are made from the same four layers: for each crossing the colour of its end and of its
pick, where the end lies over the pick and where it lies under it. A texel that is black in one
layer belongs to another one. So a layer can first be averaged over any region (mip-mapped) and then
be lit: yarns on top of the cloth get one light, and yarns seen between them get another.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import Bools, Floats
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.double_weave import Layers

#: Share of the light that reaches the cloth behind.
_SHADE = 0.6


def color_layers(
    drawdown: Bools, warp: NDArray[np.uint8], weft: NDArray[np.uint8], double: Layers | None = None
) -> tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.uint8], NDArray[np.uint8]]:
    """Sort the colours of a cloth's crossings by the yarn on top.

    Parameters
    ----------
    drawdown : (picks, ends) ndarray of bool
        True: the end lies over the pick.
    warp, weft : (n, 3) or (picks, ends, 3) ndarray of uint8
        Colours of the ends and of the picks; one for all, or both at each crossing.
    double : Layers, optional
        For a double weave: on each face, crossings of the cloth behind lie in the shade.

    Returns
    -------
    tuple of (picks, ends, 4) ndarray of uint8
        Ends over their picks; picks over their ends; ends under; picks under. Red, green, blue and
        255; all 0 where there is none.

    Examples
    --------
    >>> red, blue = np.array([[255, 0, 0]], np.uint8), np.array([[0, 0, 255]], np.uint8)
    >>> over, _, _, under = color_layers(np.array([[True, False]]), red, blue)
    >>> over.tolist(), under.tolist()
    ([[[255, 0, 0, 255], [0, 0, 0, 0]]], [[[0, 0, 255, 255], [0, 0, 0, 0]]])
    """
    of_warp, of_weft = (
        np.concatenate([colors, np.full_like(colors[..., :1], 255)], axis=-1)
        for colors in (warp, weft if weft.ndim == 3 else weft[:, None])
    )
    over = drawdown[..., None]
    made = of_warp * over, of_weft * ~over, of_warp * ~over, of_weft * over
    if double is not None:
        # The first two layers are seen on the front, the others on the back. Alpha is not light
        # and keeps its value.
        for behind, two in ((~double.in_upper_cloth, made[:2]), (double.in_upper_cloth, made[2:])):
            for seen in two:
                light = np.where(double.same_cloth & behind, _SHADE, 1.0)[..., None]
                seen[..., :3] = np.rint(seen[..., :3] * light)
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
