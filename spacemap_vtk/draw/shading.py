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
#: Rows, or columns, that are worked on at a time. A multiple of what a pixel is the mean of.
STRIP = 64


def contact_shade(
    depth: NDArray[np.float32], diameter: float, diameter_pixels: float
) -> NDArray[np.float32]:
    """Return the factor by which each pixel keeps its light."""
    there = np.isfinite(depth)
    filled = np.where(there, depth, np.float32(0.0))
    coarse, weight = _reduced(filled), _reduced(there.astype(np.float32))
    means = []
    for radius, _ in SCALES:
        sigma = max(0.7, radius * diameter_pixels / _COARSER)
        means.append(blurred(coarse, sigma) / np.maximum(blurred(weight, sigma), 1e-6))
    light = np.ones(depth.shape, dtype=np.float32)
    for rows in strips(len(light)):
        part = light[rows]
        for (radius, darkness), mean in zip(SCALES, means, strict=True):
            behind = (filled[rows] - _enlarged(mean, rows, depth.shape)) / np.float32(
                radius * diameter
            )
            part *= 1.0 - np.float32(darkness) * np.clip(behind, 0.0, 1.0)
        part[~there[rows]] = 1.0
    return light


def strips(height: int) -> list[slice]:
    """Divide a picture into strips that a processor's cache holds."""
    return [slice(top, min(top + STRIP, height)) for top in range(0, height, STRIP)]


def blurred(image: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    """Return an image blurred by a Gaussian, which is cut off at 2.5 sigma."""
    radius = int(2.5 * sigma + 0.5)
    weights = np.exp(-0.5 / sigma**2 * np.arange(-radius, radius + 1) ** 2)
    weights /= weights.sum()
    down = _blurred_down(image, weights)
    across = _blurred_down(np.ascontiguousarray(down.T), weights)
    return np.ascontiguousarray(across.T)


def _blurred_down(image: NDArray[np.float32], weights: NDArray[np.float64]) -> NDArray[np.float32]:
    """Blur along the columns, some of them at a time."""
    radius, (height, width) = len(weights) // 2, image.shape
    wide = np.pad(image.astype(np.float64), ((radius, radius), (0, 0)), mode="edge")
    result = np.empty_like(image)
    for left in range(0, width, STRIP):
        part = np.ascontiguousarray(wide[:, left : left + STRIP])
        total = weights[radius] * part[radius : radius + height]
        pair = np.empty_like(total)
        for above in range(radius):
            below = 2 * radius - above
            np.add(part[above : above + height], part[below : below + height], out=pair)
            pair *= weights[above]
            total += pair
        result[:, left : left + STRIP] = total
    return result


def averaged(image: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """Return an image reduced by averaging blocks of pixels."""
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


def _enlarged(image: NDArray[Any], rows: slice, shape: tuple[int, ...]) -> NDArray[Any]:
    """Return rows of a coarse image on the fine grid, linear between the coarse pixels' centres."""
    result = image
    for axis, places in enumerate((np.arange(shape[0])[rows], np.arange(shape[1]))):
        at = np.clip((places + 0.5) / _COARSER - 0.5, 0, image.shape[axis] - 1)
        low = np.minimum(at.astype(int), max(image.shape[axis] - 2, 0))
        high = np.minimum(low + 1, image.shape[axis] - 1)
        part = (at - low).astype(np.float32)
        part = part[:, None] if axis == 0 else part[None, :]
        result = np.take(result, low, axis) * (1 - part) + np.take(result, high, axis) * part
    return result
