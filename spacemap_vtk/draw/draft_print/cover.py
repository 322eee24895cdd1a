"""Draw the first page: title, notes, facts, yarns, an overview with the pages, both faces."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from spacemap_vtk.draw.draft_print.chart import MARK, ChartStyle, draw_chart
from spacemap_vtk.draw.draft_print.content import THREADS, DraftContent, color_letter
from spacemap_vtk.draw.draft_print.group_flow import ROW, draw_rule
from spacemap_vtk.draw.draft_print.layout import Chart, ChartGrid
from spacemap_vtk.draw.draft_print.page_map import PageMap, draw_page_map
from spacemap_vtk.draw.draft_print.paper import (
    BODY,
    FAINT,
    INK,
    PAGE_NUMBER,
    Box,
    Page,
    fit_box,
    shorten_text,
    wrap_words,
)
from spacemap_vtk.ndarrays import Bytes
from spacemap_vtk.textile.drafts.drawdown import repeat_size
from spacemap_vtk.units import format_quantity

#: Most places of longest floats that are listed.
_MOST_PLACES = 3
#: Most yarns that are listed.
_MOST_YARNS = 14
#: Most rows of notes on the first page; the rest follows later.
MOST_NOTES = 12
#: Width of the labels of facts, in mm.
_LABELS = 33.0
_TITLE = 17.0


def draft_texts(content: DraftContent) -> list[str]:
    """Return author, date and similar texts of the draft."""
    lines = content.draft.other_sections.get("TEXT", ())
    return [
        f"{key.strip()}: {value.strip()}"
        for key, _, value in (line.partition("=") for line in lines)
        if value.strip()
    ]


def draft_notes(content: DraftContent) -> list[str]:
    """Return the notes of the draft line by line."""
    notes = []
    for line in content.draft.other_sections.get("NOTES", ()):
        number, equals, value = line.partition("=")
        notes.append((value if equals and number.strip().isdecimal() else line).strip())
    return [line for line in notes if line]


def draw_cover(
    page: Page,
    content: DraftContent,
    title: str,
    subtitle: str,
    remarks: Sequence[str],
    legend: Callable[[Page], None],
) -> Box:
    """Draw title, facts and notes; return the free area below them."""
    body = page.body
    title = shorten_text(title, body.width - PAGE_NUMBER, _TITLE, bold=True)
    page.write(body.left, body.top + 6.0, title, _TITLE, bold=True)
    page.write(body.left, body.top + 11.0, shorten_text(subtitle, body.width, BODY), BODY, FAINT)
    draw_rule(page, body.top + 13.0)
    top = body.top + 14.0
    half = 0.5 * (body.width - 6.0)
    left = Box(body.left, top, half, 0.0)
    right = Box(body.left + half + 6.0, top, half, 0.0)
    y = _write_facts(page, left, _facts(content))
    y = _write_lines(page, left, y, remarks, FAINT)
    z = _draw_yarns(page, right, content)
    z = _write_notes(page, right, z, draft_notes(content))
    bottom = max(y, z) + 3.0
    draw_rule(page, bottom)
    legend(page)
    return Box(body.left, bottom + 2.0, body.width, body.bottom - bottom - 8.0)


def _facts(content: DraftContent) -> list[tuple[str, str]]:
    loom = content.loom
    ends, picks = content.size
    facts = [("Ends, picks", f"{ends} × {picks}")]
    if content.whole is not None:
        last = [first + count - 1 for first, count in zip(content.first, content.size, strict=True)]
        part = (
            f"{a}–{b} of {n}" for a, b, n in zip(content.first, last, content.whole, strict=True)
        )
        facts[0] = ("Ends, picks", " × ".join(part))
    moved = "rise" if loom.rising else "sink"
    if content.has_treadles:
        facts.append(("Shafts, treadles", f"{loom.shafts}, {loom.treadles} (tied shafts {moved})"))
    else:
        facts.append(("Shafts", f"{loom.shafts}, liftplan (marked shafts {moved})"))
    repeat = repeat_size(content.draft.drawdown)
    whole = " (the whole draft)" if repeat == content.size else ""
    facts.append(("Repeat of the weave", "{} × {}".format(*repeat) + whole))
    for name, threads in zip(
        ("Sett of the warp", "Sett of the weft"), content.threads, strict=True
    ):
        facts.append((name, write_sett(threads.spacing)))
    for face, name in ((True, "face"), (False, "reverse")):
        for family, yarn in enumerate(("warp", "weft")):
            text = _write_floats(content, family, face)
            facts.append((f"Longest {yarn} float", f"{name}: {text}"))
    return facts


def write_sett(spacing: float | np.ndarray | None) -> str:
    """Write threads per cm and per inch, or the spacings if they differ."""
    if spacing is None:
        return "not in the draft"
    low, high = float(np.min(spacing)), float(np.max(spacing))
    mean = float(np.mean(spacing))
    text = f"{0.01 / mean:.3g} per cm, {0.0254 / mean:.3g} per inch"
    if high - low > 1e-6 * high:
        text += f" (mean; {1e3 * low:.3g} to {1e3 * high:.3g} mm apart)"
    return text


def _write_floats(content: DraftContent, family: int, face: bool) -> str:
    floats = content.floats(family, face)
    longest = floats.longest
    if not longest:
        return "none"
    which = np.flatnonzero(floats.length == longest)
    own, other = THREADS[family], THREADS[1 - family]
    places = []
    for k in which[: _MOST_PLACES if len(which) <= _MOST_PLACES else 1]:
        yarn = content.first[family] + floats.yarn[k]
        begin = content.first[1 - family] + floats.begin[k]
        passed = f"{other}s {begin}–{begin + longest - 1}" if longest > 1 else f"{other} {begin}"
        places.append(f"{own} {yarn} over {passed}")
    more = f" and {len(which) - len(places)} more" if len(which) > len(places) else ""
    spacing = content.threads[1 - family].spacing
    length = "" if spacing is None else f" ({1e3 * longest * float(np.mean(spacing)):.2g} mm)"
    marked = len(content.long_floats(family, face).yarn)
    count = f"; {marked} marked" if marked else ""
    return f"{longest}{length}: {', '.join(places)}{more}{count}"


def _write_facts(page: Page, box: Box, facts: list[tuple[str, str]]) -> float:
    y = box.top
    for label, value in facts:
        page.write(box.left, y + 0.75 * ROW, label, color=FAINT)
        for line in wrap_words(value.split(" "), box.width - _LABELS):
            page.write(box.left + _LABELS, y + 0.75 * ROW, line)
            y += 0.87 * ROW
        y += 0.13 * ROW
    return y


def _write_lines(page: Page, box: Box, y: float, lines: Sequence[str], color: str = INK) -> float:
    for text in lines:
        for line in wrap_words(text.split(" "), box.width):
            page.write(box.left, y + 0.75 * ROW, line, color=color)
            y += 0.87 * ROW
        y += 0.13 * ROW
    return y


def _draw_yarns(page: Page, box: Box, content: DraftContent) -> float:
    """List the yarns with swatch, letter, and the numbers of their ends and picks."""
    y = box.top
    ends, picks = content.color_numbers
    uncolored = [
        name
        for name, threads in zip(("warp", "weft"), content.threads, strict=True)
        if threads.colors is None
    ]
    label = f"Yarns (the draft has no colours for the {' and '.join(uncolored)})"
    page.write(box.left, y + 0.75 * ROW, label if uncolored else "Yarns", color=FAINT)
    y += ROW
    for number, color in enumerate(content.color_table[:_MOST_YARNS]):
        page.fill([(box.left, y + 0.4, 7.0, ROW - 0.8)], color / 255.0)
        page.draw_box(Box(box.left, y + 0.4, 7.0, ROW - 0.8), 0.3, FAINT)
        counts = [
            f"{count} {thread}{'s' if count != 1 else ''}"
            for thread, count in zip(
                THREADS, (np.sum(ends == number), np.sum(picks == number)), strict=True
            )
            if count
        ]
        letter, code = color_letter(number), bytes(color).hex()
        text = f"{letter}   #{code}   {', '.join(counts)}"
        page.write(box.left + 9.0, y + 0.75 * ROW, text)
        y += ROW
    if (more := len(content.color_table) - _MOST_YARNS) > 0:
        page.write(box.left, y + 0.75 * ROW, f"and {more} more colours", color=FAINT)
        y += ROW
    return y


def _write_notes(page: Page, box: Box, y: float, notes: list[str]) -> float:
    if not notes:
        return y
    y += 0.4 * ROW
    page.write(box.left, y + 0.75 * ROW, "Notes", color=FAINT)
    y += ROW
    rows = [line for note in notes for line in wrap_words(note.split(" "), box.width)]
    if len(rows) > MOST_NOTES:
        rows = [*rows[: MOST_NOTES - 1], "… continued after the groups"]
    return _write_lines(page, box, y, rows)


def has_more_notes(content: DraftContent, width: float) -> bool:
    """Return whether the notes are too long for the first page."""
    half = 0.5 * (width - 6.0)
    notes = draft_notes(content)
    return sum(len(wrap_words(note.split(" "), half)) for note in notes) > MOST_NOTES


def draw_whole_draft(
    page: Page, content: DraftContent, charts: Sequence[tuple[Chart, Box]], style: ChartStyle
) -> None:
    """Draw the faces of a small draft on the first page."""
    for chart, box in charts:
        page.write(box.left, box.top - 1.5, face_name(chart.face), bold=True)
        draw_chart(page, content, chart, (box.left, box.top), style)


def face_name(face: bool) -> str:
    """Return the caption of a face."""
    return "Face" if face else "Reverse (turned over left to right)"


def draw_overview(
    page: Page,
    content: DraftContent,
    box: Box,
    grids: Sequence[ChartGrid],
    first_pages: Sequence[int],
    style: ChartStyle,
) -> None:
    """Draw both faces in reduced form, and where their pages are."""
    width = 0.5 * (box.width - 6.0)
    overview = Box(box.left, box.top, box.width, 0.56 * box.height)
    _draw_reduced(page, content, overview, grids[0], first_pages[0], style)
    top = overview.bottom + 3.0
    for number, grid in enumerate(grids):
        place = Box(box.left + number * (width + 6.0), top, width, box.bottom - top)
        numbers = f"pages {first_pages[number]}–{first_pages[number] + grid.count - 1}"
        if grid.count == 1:
            numbers = f"page {first_pages[number]}"
        caption = f"{face_name(grid.face)}: {numbers}"
        page.write(place.left, place.top + 2.5, caption, bold=True)
        inner = fit_box(
            Box(place.left, place.top + 4.0, width, place.height - 4.0), *content.size, 2.0
        )
        inner = inner._replace(left=place.left)
        page.draw_cells(_cell_colors(content, grid.face, style), inner)
        page.draw_box(inner, 0.4)
        if number:
            pages = PageMap(grid, content.size, inner, style.from_top)
            draw_page_map(page, pages, first_pages[number], style)


def _cell_colors(content: DraftContent, face: bool, style: ChartStyle) -> Bytes:
    """Return the colour of each cell as seen on a face, the first row at the top."""
    up = content.on_face(face)
    if style.mono or all(threads.colors is None for threads in content.threads):
        cells = np.where(up[..., None], _rgb(MARK), np.uint8(255))
    else:
        warp, weft = content.thread_colors
        cells = np.where(up[..., None], warp[None], weft[:, None])
    if not style.from_top:
        cells = cells[::-1]
    return np.ascontiguousarray(cells if face != style.from_top else cells[:, ::-1])


def _rgb(color: str) -> Bytes:
    return np.frombuffer(bytes.fromhex(color[1:]), np.uint8)


def _draw_reduced(
    page: Page, content: DraftContent, box: Box, grid: ChartGrid, first_page: int, style: ChartStyle
) -> None:
    """Draw threading, tie-up, treadling and drawdown as an image, with the map of the pages."""
    (ends, picks), loom = content.size, content.loom
    has_loom = content.shows_loom
    columns, shafts = (content.columns, loom.shafts) if has_loom else (0, 0)
    gap = 3
    size = picks + (shafts + gap) * has_loom, ends + (columns + gap) * has_loom
    pixels = np.full((*size, 3), 255, np.uint8)
    up = content.draft.drawdown[:: 1 if style.from_top else -1, :: -1 if style.from_top else 1]
    pixels[size[0] - picks :, :ends][up] = _rgb(MARK)
    if has_loom:
        dark = _rgb(INK)
        for end, row in enumerate(loom.threading):
            for shaft in row:
                pixels[shafts - shaft, ends - 1 - end if style.from_top else end] = dark
        for pick, row in enumerate(content.treadling):
            y = shafts + gap + (pick if style.from_top else picks - 1 - pick)
            for treadle in row:
                pixels[y, ends + gap + treadle - 1] = dark
        for treadle, row in enumerate(loom.tieup if content.has_treadles else ()):
            for shaft in row:
                pixels[shafts - shaft, ends + gap + treadle] = dark
    inner = fit_box(box, size[1], size[0], 2.0)
    page.draw_cells(pixels, inner)
    cell = inner.width / size[1]
    cloth = Box(inner.left, inner.bottom - picks * cell, ends * cell, picks * cell)
    page.draw_box(cloth, 0.5)
    if has_loom:
        page.draw_box(Box(inner.left, inner.top, ends * cell, shafts * cell), 0.3, FAINT)
        left = inner.left + (ends + gap) * cell
        page.draw_box(Box(left, cloth.top, columns * cell, cloth.height), 0.3, FAINT)
        if content.has_treadles:
            page.draw_box(Box(left, inner.top, columns * cell, shafts * cell), 0.3, FAINT)
    pages = PageMap(grid, content.size, cloth, style.from_top)
    draw_page_map(page, pages, first_page, style)


def describe_limit(limit: int | float) -> str:
    """Describe which floats are marked: over more threads, or longer in m."""
    if isinstance(limit, int):
        return f"floats over more than {limit} thread{'s' if limit > 1 else ''} are marked"
    return f"floats longer than {format_quantity(limit, 'm', 3)} are marked"
