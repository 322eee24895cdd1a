"""Pictures from what OpenGL has drawn larger: shaded, reduced, and laid over a background.

The background is no part of what is drawn: software OpenGL takes as long for one as for yarns.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageChops

from spacemap_vtk.ndarrays import Bytes, Singles

Background = Image.Image
#: A part of a picture, in rows and columns from the top, and by what its light is multiplied.
Shaded = tuple[tuple[slice, slice], Singles]
#: Shares of a step between two colours, in an order that no eye finds again (Bayer 1973).
_DITHER = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]]) / 16 + 1 / 32


def gradient(size: tuple[int, int], below: Sequence[int], above: Sequence[int]) -> Background:
    """Return a background that goes from one colour to another."""
    width, height = size
    share = (np.arange(height)[::-1, None, None] + 0.5) / height
    colors = np.array(below) + share * (np.array(above) - np.array(below))
    pattern = np.tile(_DITHER, (-(-height // 4), -(-width // 4)))[:height, :width, None]
    return Image.fromarray((colors + pattern).astype(np.uint8))


def composed(pixels: Bytes, behind: Background, shade: Shaded | None = None) -> Bytes:
    """Return a picture of a background's size; with the share covered, over one of that size."""
    # Red, green and blue are multiplied by the fourth number, how much of a pixel is covered.
    size = pixels.shape[1], pixels.shape[0]
    if shade is not None:
        box, light = pixels[shade[0]], Image.fromarray((shade[1] * 255 + 0.5).astype(np.uint8))
        whole = Image.new("L", light.size, 255)
        lit = Image.frombuffer("RGBX", light.size, np.ascontiguousarray(box), "raw", "RGBX", 0, 1)
        shades = Image.merge("RGBX", (light, light, light, whole))
        box[:] = np.asarray(ImageChops.multiply(lit, shades))
    # Upside down, as OpenGL has it, until it is smaller.
    turned = np.ascontiguousarray(pixels[::-1])
    drawn = Image.frombuffer("RGBX", size, turned, "raw", "RGBX", 0, 1)
    small = drawn.reduce(size[0] // behind.width).transpose(Image.Transpose.FLIP_TOP_BOTTOM)
    if behind.mode == "RGBA":  # what is behind it is not known yet
        return _uncovered(np.asarray(small))
    red, green, blue, cover = small.split()
    left = Image.composite(Image.new("RGB", behind.size), behind, cover)
    return np.asarray(ImageChops.add(Image.merge("RGB", (red, green, blue)), left))


def nothing(size: tuple[int, int]) -> Background:
    """Return a background for what is laid over something else."""
    return Image.new("RGBA", size)


def _uncovered(pixels: Bytes) -> Bytes:
    """Return the colours of what is drawn, which were multiplied by how much it covers."""
    cover = pixels[..., 3:].astype(np.uint16)
    colors = (pixels[..., :3] * np.uint16(255) + cover // 2) // np.maximum(cover, 1)
    return np.concatenate([np.minimum(colors, 255), cover], axis=2).astype(np.uint8)
