"""List a draft in words: threading, heddles, treadling, tie-up, colours, spacings, notes."""

from __future__ import annotations

import numpy as np

from spacemap_vtk.draw.draft_print.content import THREADS, DraftContent, color_letter, write_row
from spacemap_vtk.draw.draft_print.cover import draft_notes
from spacemap_vtk.draw.draft_print.group_flow import Row, group_rows, heading_rows, paragraph_rows
from spacemap_vtk.textile.drafts.loom import count_marks


def list_draft(content: DraftContent, width: float) -> list[Row]:
    """Return the rows of everything that is listed, for columns of this width in mm."""
    rows: list[Row] = []
    if content.lists_loom:
        rows += _list_loom(content, width)
    for family in (0, 1):
        rows += _list_colors(content, family, width)
        rows += _list_sizes(content, family, width)
    return rows


def list_notes(content: DraftContent, width: float) -> list[Row]:
    """Return the rows of the draft's notes."""
    notes = (paragraph_rows(note.split(" "), width) for note in draft_notes(content))
    return [*heading_rows("Notes"), *(row for rows in notes for row in rows)]


def _list_loom(content: DraftContent, width: float) -> list[Row]:
    rows = heading_rows(f"Threading, ends {_range(content, 0)}")
    rows += group_rows(content.threading_groups, THREADS[0], width)
    rows += heading_rows("Heddles on each shaft")
    rows += paragraph_rows(_count_heddles(content), width)
    name = "Treadling" if content.has_treadles else "Liftplan"
    rows += heading_rows(f"{name}, picks {_range(content, 1)}")
    rows += group_rows(content.treadling_groups, THREADS[1], width)
    if content.has_treadles:
        ties = enumerate(content.loom.tieup, start=1)
        rows += heading_rows("Tie-up")
        rows += paragraph_rows([f"{number}: {write_row(tied)};" for number, tied in ties], width)
    return rows


def _count_heddles(content: DraftContent) -> list[str]:
    counts = count_marks(content.loom.threading, content.loom.shafts)
    words = [f"{shaft}: {count};" for shaft, count in enumerate(counts, start=1)]
    return [*words, f"together {sum(counts)}"]


def _list_colors(content: DraftContent, family: int, width: float) -> list[Row]:
    numbers = content.color_numbers[family].tolist()
    if len(set(numbers)) == 1:
        return []
    groups = content.value_groups(family, numbers, color_letter)
    heading = heading_rows(f"Colours of the {('warp', 'weft')[family]}")
    return heading + group_rows(groups, THREADS[family], width)


def _list_sizes(content: DraftContent, family: int, width: float) -> list[Row]:
    """Return the rows of spacings and thicknesses that are not the same for all threads."""
    rows: list[Row] = []
    threads = content.threads[family]
    for what, values in (("Spacing", threads.spacing), ("Thickness", threads.thickness)):
        if values is not None and np.ndim(values) and np.ptp(values) > 0:
            rounded = np.round(1e3 * np.asarray(values), 3).tolist()
            groups = content.value_groups(family, rounded, "{:g}".format)
            rows += heading_rows(f"{what} of the {('warp', 'weft')[family]}, in mm")
            rows += group_rows(groups, THREADS[family], width)
    return rows


def _range(content: DraftContent, family: int) -> str:
    first = content.first[family]
    return f"{first}–{first + content.size[family] - 1}"
