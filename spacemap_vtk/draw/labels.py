"""Words on pictures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from spacemap_vtk.units import format_quantity

_INK, _PAPER = (40, 46, 54), (255, 255, 255)


def label_storyboard(image: NDArray[np.uint8], times: Sequence[float]) -> NDArray[np.uint8]:
    """Add the rows' letters on the left and the columns' times below."""
    height, width = image.shape[:2]
    size = max(14, height // 32)
    font = ImageFont.load_default(size)
    sheet = Image.new("RGB", (width + 3 * size, height + 2 * size), _PAPER)
    sheet.paste(Image.fromarray(image), (3 * size, 0))
    pen = ImageDraw.Draw(sheet)
    for row, letter in enumerate("ab"):
        middle = height // 4 + row * height // 2
        pen.text((1.5 * size, middle), f"({letter})", _INK, font, anchor="mm")
    for column, time in enumerate(times):
        middle = 3 * size + (column + 0.5) * width / len(times)
        pen.text(
            (middle, height + size),
            format_quantity(float(f"{time:.4g}"), "s"),
            _INK,
            font,
            anchor="mm",
        )
    return np.asarray(sheet)
