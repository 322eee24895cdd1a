"""Turn enlarged drawings into pictures: shade them, reduce them, and add a background.

OpenGL does not draw the background: software OpenGL would take as long for it as for the yarns.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageChops

from spacemap_vtk.ndarrays import Bytes, Singles

Background = Image.Image
#: Rows and columns of a part of a picture, from the top, and factors for the light of its pixels.
Shadows = tuple[tuple[slice, slice], Singles]
#: Ordered dither: thresholds as shares of a step between two colours, without a visible pattern
#: (Bayer 1973).
_DITHER = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]]) / 16 + 1 / 32


def gradient_background(
    size: tuple[int, int], below: Sequence[int], above: Sequence[int]
) -> Background:
    """Return a background that changes from one colour at the bottom to another at the top."""
    width, height = size
    share = (np.arange(height)[::-1, None, None] + 0.5) / height
    colors = np.array(below) + share * (np.array(above) - np.array(below))
    pattern = np.tile(_DITHER, (-(-height // 4), -(-width // 4)))[:height, :width, None]
    return Image.fromarray((colors + pattern).astype(np.uint8))


def compose(pixels: Bytes, background: Background, shadows: Shadows | None = None) -> Bytes:
    """Return a picture with the background's size; with coverage if the background is RGBA."""
    # The colours in `pixels` are premultiplied by the fourth number, the coverage of a pixel.
    size = pixels.shape[1], pixels.shape[0]
    if shadows is not None:
        box, light = pixels[shadows[0]], Image.fromarray((shadows[1] * 255 + 0.5).astype(np.uint8))
        opaque = Image.new("L", light.size, 255)
        colors = Image.frombuffer(
            "RGBX", light.size, np.ascontiguousarray(box), "raw", "RGBX", 0, 1
        )
        shades = Image.merge("RGBX", (light, light, light, opaque))
        box[:] = np.asarray(ImageChops.multiply(colors, shades))
    # The picture is flipped after the reduction, when it is smaller and the flip takes less time.
    flipped = np.ascontiguousarray(pixels[::-1])
    drawn = Image.frombuffer("RGBX", size, flipped, "raw", "RGBX", 0, 1)
    small = drawn.reduce(size[0] // background.width).transpose(Image.Transpose.FLIP_TOP_BOTTOM)
    if background.mode == "RGBA":  # the picture will be placed over an unknown background
        return _unpremultiply(np.asarray(small))
    red, green, blue, cover = small.split()
    rest = Image.composite(Image.new("RGB", background.size), background, cover)
    return np.asarray(ImageChops.add(Image.merge("RGB", (red, green, blue)), rest))


def transparent_background(size: tuple[int, int]) -> Background:
    """Return a transparent background, for pictures that are placed over something else."""
    return Image.new("RGBA", size)


def _unpremultiply(pixels: Bytes) -> Bytes:
    """Divide premultiplied colours by their coverage."""
    cover = pixels[..., 3:].astype(np.uint16)
    colors = (pixels[..., :3] * np.uint16(255) + cover // 2) // np.maximum(cover, 1)
    return np.concatenate([np.minimum(colors, 255), cover], axis=2).astype(np.uint8)
