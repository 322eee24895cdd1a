"""Crops of a large cloth in which each of its local weaves occurs, and what they tell of it."""

from __future__ import annotations

from dataclasses import replace
from math import ceil

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.fabric.cloth import Cloth

#: Crossings along both sides of the weave round a crossing: where a yarn bends is told by it and
#: the crossings beside it.
_LOCAL = 3
#: Crossings along both sides of a crop: so many times the root of the number of weaves that are
#: looked for, of which a crop of a cloth without order then holds nearly all; and at least.
_PER_WEAVE, _LEAST = 4.0, 12


def telling_crops(cloth: Cloth, most: int) -> list[tuple[int, int, Cloth]] | None:
    """Return the first end and pick of each crop, and the crop; each 3 x 3 crossings are in one."""
    # None where yarns of a family differ or bend as a spline does, so that place and neighbours
    # count, where there are no 3 x 3 crossings, and where it would be more crossings than `most`.
    varied = any(np.ndim(v) for t in cloth.threads for v in (t.diameter, t.spacing))
    if varied or cloth.axis == "spline" or min(cloth.size) < _LOCAL:
        return None
    codes = _codes(cloth.drawdown)
    first = np.full(2 ** (_LOCAL * _LOCAL), -1, np.int64)
    first[codes.ravel()[::-1]] = np.arange(codes.size)[::-1]
    threads = [replace(t, colors=t.colors[:1]) for t in cloth.threads]
    found: list[tuple[int, int, Cloth]] = []
    while len(left := first[first >= 0]):
        side = max(_LEAST, ceil(_PER_WEAVE * len(left) ** 0.5))
        pick, end = (
            max(min(at - side // 2, size - side), 0)
            for at, size in zip(
                divmod(int(left.min()), codes.shape[1]), cloth.drawdown.shape, strict=True
            )
        )
        drawdown = cloth.drawdown[pick : pick + side, end : end + side]
        first[_codes(drawdown)] = -1
        crop = replace(cloth, drawdown=drawdown, warp=threads[0], weft=threads[1])
        found.append((end, pick, crop))
        if sum(crop.drawdown.size for _, _, crop in found) > most:
            return None
    return found


def _codes(drawdown: NDArray[np.bool_]) -> NDArray[np.uint16]:
    """Return a number for the weave of 3 x 3 crossings that begins at each."""
    rows, columns = (size - _LOCAL + 1 for size in drawdown.shape)
    codes = np.zeros((rows, columns), np.uint16)
    for i in range(_LOCAL):
        for j in range(_LOCAL):
            codes <<= 1
            codes |= drawdown[i : i + rows, j : j + columns]
    return codes
