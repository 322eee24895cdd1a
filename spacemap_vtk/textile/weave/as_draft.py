"""Convert any cloth to a draft that weaving programs can read."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.drafts.draft import Draft, DraftThreads
from spacemap_vtk.textile.weave.cloth import FAMILIES, Cloth
from spacemap_vtk.textile.weave.resolve import ClothRequest
from spacemap_vtk.textile.weave.threads import Lengths


def as_draft(cloth: Cloth, draft: Draft, request: ClothRequest, title: str = "") -> Draft:
    """Convert a cloth to a draft.

    Parameters
    ----------
    cloth : Cloth
        May be a cloth whose yarns have no room.
    draft : Draft
        The draft from which the cloth was resolved. Values that the request did not change are
        copied from it, including thicknesses of yarns that would have to be thinned.
    request : ClothRequest
        The request.
    title : str
        Title for a draft that has none.

    Returns
    -------
    Draft
        Has a loom; `spacemap_vtk.textile.weave.resolve.resolve` makes the same cloth from it.

    Raises
    ------
    InputError
        No thread spaces give these distances between the yarns.
    """
    families = []
    for number, (own, wanted) in enumerate(
        ((draft.warp, request.warp), (draft.weft, request.weft))
    ):
        threads, count = cloth.threads[number], cloth.size[number]
        repeated = own.repeat(count)
        spacing, thickness = repeated.spacing, repeated.thickness
        colors: NDArray[np.uint8] | None = threads.colors
        is_pattern = draft.loom is None
        if (
            wanted.spacing is not None
            or wanted.sett is not None
            or (is_pattern and spacing is None)
        ):
            spacing = _collapse_equal(_thread_spaces(cloth, number))
        if wanted.has_thickness or wanted.aspect is not None or (is_pattern and thickness is None):
            thickness = _collapse_equal(
                np.resize(threads.aspect * np.asarray(threads.diameter), count)
            )
        if not is_pattern and own.colors is None and wanted.color is None:
            colors = None
        families.append(DraftThreads(spacing=spacing, thickness=thickness, colors=colors))
    return Draft(
        cloth.drawdown,
        draft.find_loom(cloth.drawdown),
        warp=families[0],
        weft=families[1],
        title=draft.title or title,
        warnings=draft.warnings,
        other_sections=draft.other_sections,
    )


def _collapse_equal(lengths: Floats) -> Lengths:
    """Return the mean if all threads have it, otherwise the lengths."""
    mean = float(lengths.mean())
    return mean if (lengths == mean).all() else lengths


def _thread_spaces(cloth: Cloth, number: int) -> Floats:
    """Compute the space of each thread; the thread is in its middle."""
    gaps, count = np.asarray(cloth.threads[number].spacing), cloth.size[number]
    if gaps.ndim == 0 or gaps.size == 0:
        return np.full(count, float(gaps) if gaps.ndim == 0 else cloth.diameter_sum)
    # s[i] + s[i + 1] = 2 gap[i]: the first space fixes all others, with alternating signs.
    sign = (-1.0) ** np.arange(count)
    rest = np.zeros(count)
    for index, gap in enumerate(gaps.tolist()):
        rest[index + 1] = 2.0 * gap - rest[index]
    low = max(float((-rest[sign > 0]).max()), 0.0)
    high = float(rest[sign < 0].min())
    if not low < high:
        raise InputError(
            f"a WIF cannot store these distances between the {FAMILIES[number]} yarns",
            key=cloth.names("spacing", number),
            cure="A WIF centres each thread in its own space: use distances that change less from "
            "yarn to yarn",
        )
    return np.asarray(rest + sign * 0.5 * (low + high))
