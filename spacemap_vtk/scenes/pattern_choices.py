"""Patterns and drafts that lists offer for a weave, with their titles and small pictures."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.filters.weave_parameters import pattern_repeat
from spacemap_vtk.io import registry
from spacemap_vtk.ndarrays import Bools
from spacemap_vtk.scenes import library
from spacemap_vtk.textile.drafts import drawdown
from spacemap_vtk.textile.weave.resolve import WARP_COLOR, WEFT_COLOR

#: Weaves to choose from; any other name can be typed.
PATTERNS = (
    "plain",
    "twill 2/1",
    "twill 2/2",
    "twill 3/1",
    "satin 5/2",
    "satin 8/3",
    "basket 2",
)
#: Width and height of a small picture in pixels.
_SIZE = 144, 96
#: Pixels along each side of a crossing of a pattern.
_PATTERN_SQUARE = 6
#: Pixels along each side of a crossing of a draft: fewer, as repeats of drafts are larger.
_DRAFT_SQUARE = 3
#: Factor of the colour along both sides of a yarn, which shows the yarn's direction.
_SHADE = 0.74


def draft_names() -> list[str]:
    """Return the names of the drafts that come with the program, such as ``drafts/apron.wif``."""
    files = sorted((library.folder() / "drafts").iterdir())
    return [f"drafts/{file.name}" for file in files if registry.kind_of(file) == "draft"]


def title_of_pattern(pattern: Any, draft: Any = None) -> str:
    """Return the title of a weave: the name of its draft or pattern, or the size of its repeat."""
    if draft is not None:
        words = Path(draft).stem.replace("_", " ")
    elif isinstance(pattern, str):
        words = "plain weave" if pattern.strip().lower() == "plain" else pattern.strip()
    else:
        picks, ends = pattern_repeat(pattern).shape
        words = f"weave of {ends} ends and {picks} picks"
    return words[:1].upper() + words[1:]


def picture_of_pattern(pattern: Any) -> NDArray[np.uint8]:
    """Draw some repeats of a pattern; RGB, shape (height, width, 3)."""
    repeat = pattern_repeat(pattern)
    return _draw(repeat, np.array([WARP_COLOR]), np.array([WEFT_COLOR]), _PATTERN_SQUARE)


@lru_cache(64)
def picture_of_draft(name: str) -> NDArray[np.uint8]:
    """Draw the first ends and picks of a draft with its colours, as `picture_of_pattern`."""
    draft = registry.read(library.find(name), "draft")
    warp, weft = (
        np.array([usual]) if own is None else own
        for own, usual in ((draft.warp.colors, WARP_COLOR), (draft.weft.colors, WEFT_COLOR))
    )
    return _draw(draft.drawdown, warp, weft, _DRAFT_SQUARE)


def _draw(repeat: Bools, warp: NDArray[Any], weft: NDArray[Any], square: int) -> NDArray[np.uint8]:
    ends, picks = (side // square for side in _SIZE)
    over = drawdown.tile_drawdown(repeat, ends, picks)
    rows, columns = repeat.shape
    end_colors = warp[np.arange(ends) % columns % len(warp)]
    pick_colors = weft[np.arange(picks) % rows % len(weft)]
    colors = np.where(over[..., None], end_colors[None, :], pick_colors[:, None])
    colors, over = (each.repeat(square, 0).repeat(square, 1) for each in (colors, over))
    # Between two yarns of small squares, one darker line is enough.
    edge = np.isin(np.arange(square), (0, square - 1 if square > _DRAFT_SQUARE else 0))
    across, along = np.tile(edge, ends)[None, :], np.tile(edge, picks)[:, None]
    shade = np.where(np.where(over, across, along), _SHADE, 1.0)
    return np.rint(colors * shade[..., None]).astype(np.uint8)[::-1]  # the first pick is below
