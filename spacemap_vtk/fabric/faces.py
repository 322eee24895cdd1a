"""A cloth seen from so far that a yarn is hardly a pixel wide: its colours, a texel a crossing.

Both faces are made of the same four layers: of each crossing the colours of its end and its pick,
where the end lies over the pick and where it lies under it. What is black in one layer belongs to
another, so that a layer can be averaged over any region (mip-mapped), and only then be lit: the
yarns of a family that lie on top get one light, those that are seen between them another.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.fabric.cloth import Cloth
from spacemap_vtk.fabric.double_weave import Layers
from spacemap_vtk.ndarrays import Bools, Floats

#: Light that falls through the cloth in front on the one behind.
_SHADE = 0.6


@dataclass(frozen=True)
class Tube:
    """What of a family's yarns decides how much light comes from them."""

    #: Width over height of the section, and width over spacing.
    aspect: float
    cover: float
    #: Root mean square of the axes' slope on the yarns' upper sides, and where they dive, in rad.
    slope_over: float
    slope_under: float


def tubes(cloth: Cloth) -> tuple[Tube, Tube]:
    """Return the mean measures of warp and weft.

    Parameters
    ----------
    cloth : Cloth
        With room for its yarns.

    Returns
    -------
    tuple of Tube
        Warp and weft.
    """
    made = []
    for number, (family, threads) in enumerate(zip(cloth.families, cloth.threads, strict=True)):
        gaps = np.diff(cloth.drawdown, axis=number)  # True where a yarn changes side
        share = float(np.count_nonzero(gaps)) / gaps.size if gaps.size else 0.0
        theta = float(family.crimp.theta)
        made.append(
            Tube(
                threads.aspect,
                min(family.width / family.spacing, 1.0),
                0.4 * theta * float(np.sqrt(share)),
                0.7 * theta * float(np.sqrt(share)),
            )
        )
    return made[0], made[1]


def layers(
    drawdown: Bools, warp: NDArray[np.uint8], weft: NDArray[np.uint8], double: Layers | None = None
) -> tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.uint8], NDArray[np.uint8]]:
    """Return the colours of a cloth's crossings, by who lies on top.

    Parameters
    ----------
    drawdown : (picks, ends) ndarray of bool
        True: the end lies over the pick.
    warp, weft : (n, 3) or (picks, ends, 3) ndarray of uint8
        Colours of the ends and of the picks, or one for all; or of both at each crossing.
    double : Layers, optional
        Of a double weave: on each face the crossings of the cloth behind lie in the shade.

    Returns
    -------
    tuple of (picks, ends, 4) ndarray of uint8
        Ends that lie over their pick; picks that lie over their end; ends under; picks under. Red,
        green, blue and 255; 0 where there is none.

    Examples
    --------
    >>> red, blue = np.array([[255, 0, 0]], np.uint8), np.array([[0, 0, 255]], np.uint8)
    >>> over, _, _, under = layers(np.array([[True, False]]), red, blue)
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
        # what lies on top on a face is seen on that one; a pixel's alpha is no light
        for behind, two in ((~double.above, made[:2]), (double.above, made[2:])):
            for seen in two:
                light = np.where(double.own & behind, _SHADE, 1.0)[..., None]
                seen[..., :3] = np.rint(seen[..., :3] * light)
    return made


def grid_lines(cloth: Cloth, number: int, cells: int) -> Floats:
    """Return places that cut a cloth into cells of as many yarns each.

    Parameters
    ----------
    cloth : Cloth
        With room for its yarns.
    number : {0, 1}
        The family: its yarns lie side by side along x (warp) or y (weft).
    cells : int
        How many.

    Returns
    -------
    (cells + 1,) float64
        In m; the first and the last are where the cloth ends. A share k / cells of the yarns lies
        before place k.
    """
    place = cloth.yarns[number].position
    reach = cloth.families[1 - number].overhang
    width = 0.5 * cloth.families[number].width
    past = max(reach, width)
    borders = np.concatenate(
        [[place[0] - past], 0.5 * (place[1:] + place[:-1]), [place[-1] + past]]
    )
    return np.interp(np.linspace(0.0, len(place), cells + 1), np.arange(len(borders)), borders)
