"""Soft contact shadows, made from the depth buffer.

OpenGL's shadow maps are hard-edged and its screen-space ambient occlusion is noisy and shows every
facet, so the shading is done here: a pixel darkens by how far it lies behind the mean depth of its
surroundings ("unsharp masking the depth buffer", T. Luft, C. Colditz, O. Deussen, ACM Trans.
Graph. 25, 2006). The result depends on no driver.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Radii of the surroundings in yarn diameters, and how dark each can make a pixel.
SCALES = ((0.35, 0.55), (1.0, 0.5))
#: The depth is blurred at a lower resolution: a blurred image has no detail to lose.
_COARSER = 4


def contact_shade(
    depth: NDArray[np.float32], diameter: float, diameter_pixels: float
) -> NDArray[np.float32]:
    """Return the factor by which each pixel keeps its light.

    Parameters
    ----------
    depth : ndarray of float32, shape (height, width)
        Distance from the camera in m; NaN where nothing is.
    diameter : float
        Yarn diameter in m: the depth step that shades fully.
    diameter_pixels : float
        The same in pixels of `depth`.

    Returns
    -------
    ndarray of float32, shape (height, width)
        From 0 to 1; 1 where nothing is.
    """
    from scipy import ndimage  # with all it brings: a tenth of a second

    there = np.isfinite(depth)
    filled = np.where(there, depth, np.float32(0.0))
    coarse, weight = _reduced(filled), _reduced(there.astype(np.float32))
    light = np.ones(depth.shape, dtype=np.float32)
    for radius, darkness in SCALES:
        sigma = max(0.7, radius * diameter_pixels / _COARSER)
        near = ndimage.gaussian_filter(coarse, sigma, mode="nearest", truncate=2.5)
        share = ndimage.gaussian_filter(weight, sigma, mode="nearest", truncate=2.5)
        mean = near / np.maximum(share, 1e-6)
        behind = (filled - _enlarged(mean, depth.shape)) / np.float32(radius * diameter)
        light *= 1.0 - np.float32(darkness) * np.clip(behind, 0.0, 1.0)
    light[~there] = 1.0
    return light


def averaged(image: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """Return an image reduced by averaging blocks of pixels.

    Parameters
    ----------
    image : ndarray, shape (height, width, channels)
        Height and width multiples of `factor`.
    factor : int
        Side of a block, at least 2.

    Returns
    -------
    ndarray of float32, shape (height / factor, width / factor, channels)
        The means.
    """
    # Sums of strided views: five times as fast as a mean over two axes of a reshaped array.
    views = [
        image[row::factor, column::factor] for row in range(factor) for column in range(factor)
    ]
    total = views[0] + views[1]
    for view in views[2:]:
        total += view
    return total / np.float32(factor**2)


def _reduced(image: NDArray[np.float32]) -> NDArray[np.float32]:
    rows, columns = (-size % _COARSER for size in image.shape)
    padded = np.pad(image, ((0, rows), (0, columns)), mode="edge")
    return averaged(padded[:, :, None], _COARSER)[:, :, 0]


def _enlarged(image: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    """Return a coarse image on the fine grid, linear between the coarse pixels' centres."""
    result = image
    for axis, size in enumerate(shape):
        at = np.clip((np.arange(size) + 0.5) / _COARSER - 0.5, 0, image.shape[axis] - 1)
        low = np.minimum(at.astype(int), max(image.shape[axis] - 2, 0))
        high = np.minimum(low + 1, image.shape[axis] - 1)
        part = (at - low).astype(np.float32)
        part = part[:, None] if axis == 0 else part[None, :]
        result = np.take(result, low, axis) * (1 - part) + np.take(result, high, axis) * part
    return result
