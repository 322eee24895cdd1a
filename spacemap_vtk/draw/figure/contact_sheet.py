"""Draw a contact sheet: the pictures of a sweep side by side, labelled with their values."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain, islice, product, repeat
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from spacemap_vtk.ndarrays import Bytes
from spacemap_vtk.scenes.sweep import Sweep
from spacemap_vtk.units import format_quantity

#: Approximate width of a sheet, in pixels.
_SHEET_WIDTH = 2200
#: Least width of a cell, in pixels.
_LEAST_WIDTH = 150
#: Largest width of a cell, in pixels.
_LARGEST_WIDTH = 520
#: Up to this number, all cells of a single list are in one row.
_MAX_ROW = 4
#: Largest side of a sheet in pixels.
_LARGEST_SIDE = 16_000
_INK = (40, 46, 54)
_FAINT = (118, 126, 138)
_PAPER = (255, 255, 255)
_EMPTY = (244, 245, 247)
_LINE = (214, 219, 226)
_FAILED = (150, 70, 40)
_Font = ImageFont.FreeTypeFont | ImageFont.ImageFont


@dataclass(frozen=True)
class _Axis:
    """The names that label an axis of the sheet, and their values for each cell."""

    names: tuple[str, ...]
    values: list[tuple[str, ...]]


def contact_sheet(
    sweep: Sweep, title: str, files: Mapping[str, list[Path]], errors: Mapping[str, str]
) -> Bytes:
    """Draw the pictures of runs: two or more lists as a table, a single list row by row."""
    axes = _axes(sweep)
    pictures_per_run = max((len(each) for each in files.values()), default=1)
    cells = [
        (path, errors.get(run.name, "not run"))
        for run in sweep.runs
        for path in islice(chain(files.get(run.name, ()), repeat(None)), pictures_per_run)
    ]
    if len(axes) < 2:
        return _draw_sheet(title, None, axes[0] if axes else None, cells)
    *outer, column_axis = axes
    rows = [sum(each, ()) for each in product(*(axis.values for axis in outer))]
    row_axis = _Axis(sum((axis.names for axis in outer), ()), rows)
    return _draw_sheet(title, row_axis, column_axis, cells)


def _axes(sweep: Sweep) -> list[_Axis]:
    lists = [
        (sweep_label(sweep, k), [e.label(v) for v in e.values]) for k, e in enumerate(sweep.axes)
    ]
    if sweep.paired and lists:
        names, values = zip(*lists, strict=True)
        axes = [_Axis(names, list(zip(*values, strict=True)))]
    else:
        axes = [_Axis((name,), [(value,) for value in values]) for name, values in lists]
    times = sweep.runs[0].times
    if len(times) > 1:
        axes.append(_Axis(("Time",), [(format_quantity(time, "s"),) for time in times]))
    return axes


def sweep_label(sweep: Sweep, number: int) -> str:
    """Return the label of a swept parameter; its full name if two parameters have the same."""
    labels = [each.parameter.label for each in sweep.axes]
    return labels[number] if labels.count(labels[number]) == 1 else sweep.axes[number].name


def _draw_sheet(
    title: str,
    row_axis: _Axis | None,
    column_axis: _Axis | None,
    cells: list[tuple[Path | None, str]],
) -> Bytes:
    sizes = [_picture_size(path) for path, _ in cells if path is not None] or [(4, 3)]
    aspect = max(height / width for width, height in sizes)
    count = len(cells)
    if row_axis and column_axis:
        columns = len(column_axis.values)
    else:
        columns = count if count <= _MAX_ROW else math.ceil(math.sqrt(count * 1.5 * aspect))
    rows = math.ceil(count / columns)
    width = min(
        max(_SHEET_WIDTH // columns, _LEAST_WIDTH), _LARGEST_WIDTH, max(size[0] for size in sizes)
    )
    width = min(width, _LARGEST_SIDE // columns, int(_LARGEST_SIDE / (rows * aspect)) - 40)
    height = round(width * aspect)
    size = max(12, width // 20)
    font, small = ImageFont.load_default(size), ImageFont.load_default(max(11, size * 3 // 4))
    gap, line = size, round(1.35 * size)
    names = len(column_axis.names) if column_axis else 0
    label = names * 2 * line if row_axis else names * line
    left = gap
    if row_axis:
        texts = [*row_axis.names, *(word for row in row_axis.values for word in row)]
        left = round(max(font.getlength(word) for word in texts)) + 2 * gap
    header = 2 * line + gap
    top = header + (label if row_axis else 0)
    step = height + gap + (0 if row_axis else label)
    sheet = Image.new("RGB", (left + columns * (width + gap), top + rows * step + gap // 2), _PAPER)
    pen = ImageDraw.Draw(sheet)
    pen.text((gap, gap), title, _INK, ImageFont.load_default(round(1.2 * size)), anchor="la")
    for number, (path, error) in enumerate(cells):
        row, column = divmod(number, columns)
        x, y = left + column * (width + gap), top + row * step
        if path is None:
            _draw_missing(pen, (x, y, x + width, y + height), error, small)
        else:
            thumbnail = _shrink(path, (width, height))
            sheet.paste(
                thumbnail,
                (x + (width - thumbnail.width) // 2, y + (height - thumbnail.height) // 2),
            )
        pen.rectangle((x, y, x + width - 1, y + height - 1), outline=_LINE)
        if column_axis and not row_axis:
            labels = zip(column_axis.names, column_axis.values[number], strict=True)
            for k, (name, value) in enumerate(labels):
                place = x + width / 2, y + height + gap // 3 + k * line
                _write_pair(pen, place, name, value, font, small)
    if row_axis and column_axis:
        for column, values in enumerate(column_axis.values):
            middle = left + column * (width + gap) + width / 2
            for k, (name, value) in enumerate(zip(column_axis.names, values, strict=True)):
                pen.text((middle, header + 2 * k * line), name, _FAINT, small, anchor="ma")
                pen.text((middle, header + (2 * k + 0.8) * line), value, _INK, font, anchor="ma")
        for row, values in enumerate(row_axis.values):
            start = top + row * step + height / 2 - len(values) * line
            for k, (name, value) in enumerate(zip(row_axis.names, values, strict=True)):
                high = start + 2 * k * line
                pen.text((left - gap, high), name, _FAINT, small, anchor="ra")
                pen.text((left - gap, high + 0.8 * line), value, _INK, font, anchor="ra")
    return np.asarray(sheet)


def _picture_size(path: Path) -> tuple[int, int]:
    with Image.open(path) as picture:
        return picture.size


def _shrink(path: Path, cell: tuple[int, int]) -> Image.Image:
    """Return a picture scaled to fit into a cell."""
    with Image.open(path) as picture:
        share = min(cell[0] / picture.width, cell[1] / picture.height)
        size = max(1, round(share * picture.width)), max(1, round(share * picture.height))
        return picture.convert("RGB").resize(size, Image.Resampling.LANCZOS, reducing_gap=3.0)


def _write_pair(
    pen: ImageDraw.ImageDraw,
    place: tuple[float, float],
    name: str,
    value: str,
    font: _Font,
    small: _Font,
) -> None:
    """Write a name and its value side by side, centred together."""
    size = getattr(font, "size", 12)
    before, after = small.getlength(name) + size / 2, font.getlength(value)
    x, base = place[0] - (before + after) / 2, place[1] + size
    pen.text((x, base), name, _FAINT, small, anchor="ls")
    pen.text((x + before, base), value, _INK, font, anchor="ls")


def _draw_missing(
    pen: ImageDraw.ImageDraw, box: tuple[int, int, int, int], error: str, font: _Font
) -> None:
    """Draw a cell without a picture, with the error."""
    pen.rectangle(box, fill=_EMPTY)
    size = getattr(font, "size", 12)
    characters = max(8, int((box[2] - box[0]) / (0.56 * size)))
    lines = textwrap.wrap(error, characters)
    most = max(1, int((box[3] - box[1]) / (1.5 * size)) - 1)
    text = "\n".join(lines[:most]) + (" …" if len(lines) > most else "")
    middle = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
    pen.multiline_text(middle, text, _FAILED, font, anchor="mm", align="center", spacing=size // 3)
