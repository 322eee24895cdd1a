"""Compute soft contact shadows from the depth buffer.

A pixel is darkened in proportion to its distance behind the mean depth of its surroundings ("Image
enhancement by unsharp masking the depth buffer", T. Luft, C. Colditz, O. Deussen, ACM Trans. Graph.
25, 2006). OpenGL's shadow maps have hard edges, and its screen-space ambient occlusion is noisy and
shows every facet. The result here does not depend on the driver.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.ndarrays import Bools, Floats, Singles

#: Radius of the surroundings in yarn diameters, and largest darkening by it, for two radii.
SCALES = ((0.35, 0.55), (1.0, 0.5))
#: Distances behind the surroundings, in yarn diameters, at which shadows begin and end to fade,
#: and the share that fades.
_FLAP = (0.8, 3.0)
_FLAP_SHARE = 0.6
#: Least factor by which the resolution is reduced before blurring: a blurred image has no detail.
_COARSER = 4
#: The factor is doubled as long as the blur radius keeps at least this many pixels.
_LEAST_RADIUS = 3.0
#: Number of rows or columns that are processed at a time.
STRIP = 64


def contact_shadows(
    depth: Singles,
    diameter: float,
    diameter_pixels: float,
    strength: float = 1.0,
    line_width: int = 0,
) -> Singles:
    """Return each pixel's brightness factor; lines up to 2 `line_width` pixels wide cast none."""
    height, width = depth.shape
    covered = np.isfinite(depth)
    filled = np.where(covered, depth, np.float32(0.0))
    casting = [filled, covered.astype(np.float32)]
    if line_width:
        dilated = _dilate(np.where(covered, depth, np.float32(np.inf)), line_width)
        solid = np.isfinite(dilated)
        casting = [np.where(solid, dilated, np.float32(0.0)), solid.astype(np.float32)]
        covered &= _dilate(solid, line_width)  # pixels that only lines cover stay unshaded
    coarse = [_downsample(part, _COARSER) for part in casting]
    factor, shades = _COARSER, []
    for radius, darkest in SCALES:
        darkness = strength * darkest
        spread = radius * diameter_pixels
        while spread >= 2 * _LEAST_RADIUS * factor:
            coarse, factor = [_downsample(part, 2) for part in coarse], 2 * factor
        near, weight = (blur(part, max(0.7, spread / factor)) for part in coarse)
        slope = np.float32(darkness / (radius * diameter))
        # The factor is 1 - slope * (depth - mean depth), but never less than 1 - darkness.
        mean = 1 + slope * near / np.maximum(weight, np.float32(1e-6))
        tall = np.ascontiguousarray(_upsample(np.ascontiguousarray(mean.T), factor, height).T)
        shades.append((tall, factor, slope, np.float32(1.0 - darkness)))
    light = np.ones(depth.shape, dtype=np.float32)
    for rows in row_strips(height):
        part = light[rows]
        for tall, factor, slope, least in shades:
            shade = _upsample(tall[rows], factor, width)
            shade -= slope * filled[rows]
            # A pixel far behind its surroundings is behind the edge of a flap, which is no fold.
            behind = (np.float32(1.0) - shade) / (slope * np.float32(diameter))
            np.clip(shade, least, np.float32(1.0), out=shade)
            shade += _faded(behind) * (np.float32(1.0) - shade)
            part *= shade
        part[~covered[rows]] = 1.0
    return light


def _faded(behind: Singles) -> Singles:
    """Return the share by which shadows fade at distances behind an edge, in yarn diameters."""
    begin, end = _FLAP
    share = np.clip((behind - np.float32(begin)) / np.float32(end - begin), 0.0, 1.0)
    return np.asarray(np.float32(_FLAP_SHARE) * share * share * (3.0 - 2.0 * share), np.float32)


def covered_part(covered: Bools, diameter_pixels: float) -> tuple[slice, slice] | None:
    """Return rows and columns around all covered pixels, in whole coarse pixels; None if empty."""
    block = _COARSER
    while max(SCALES)[0] * diameter_pixels >= 2 * _LEAST_RADIUS * block:
        block *= 2
    sides = []
    for axis in (1, 0):
        indices = np.flatnonzero(covered.any(axis=axis))
        if not len(indices):
            return None
        begin, end = indices[0] // block - 1, indices[-1] // block + 2
        sides.append(slice(max(0, begin * block), min(end * block, covered.shape[1 - axis])))
    return sides[0], sides[1]


def soften(image: Singles) -> Singles:
    """Return an image whose edges are as soft as those of smooth lines."""
    for _ in range(2):
        image = np.ascontiguousarray(image.T)
        image[1:-1] = 0.25 * (image[:-2] + image[2:]) + 0.5 * image[1:-1]
    return image


def _dilate(image: NDArray[Any], radius: int) -> NDArray[Any]:
    """Return the maximum of the pixels within a radius around each pixel."""
    for _ in range(2):
        image = np.ascontiguousarray(image.T)
        for _ in range(radius):
            image[1:-1] = np.maximum(np.maximum(image[:-2], image[2:]), image[1:-1])
    return image


def row_strips(height: int) -> list[slice]:
    """Divide a picture into strips of rows that fit into the processor's cache."""
    return [slice(top, min(top + STRIP, height)) for top in range(0, height, STRIP)]


def blur(image: Singles, sigma: float) -> Singles:
    """Return an image blurred by a Gaussian that is cut off at 2.5 sigma."""
    radius = int(2.5 * sigma + 0.5)
    weights = np.exp(-0.5 / sigma**2 * np.arange(-radius, radius + 1) ** 2)
    weights /= weights.sum()
    down = _blur_columns(image, weights)
    across = _blur_columns(np.ascontiguousarray(down.T), weights)
    return np.ascontiguousarray(across.T)


def _blur_columns(image: Singles, weights: Floats) -> Singles:
    """Blur an image along its columns, strip by strip."""
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


def _downsample(image: Singles, factor: int) -> Singles:
    """Return an image reduced to the means of blocks of `factor` x `factor` pixels."""
    rows, columns = (-size % factor for size in image.shape)
    if rows or columns:
        image = np.pad(image, ((0, rows), (0, columns)), mode="edge")
    # Sums of strided views are five times as fast as a mean over two axes of a reshaped array.
    total = image[::factor].copy()
    for row in range(1, factor):
        total += image[row::factor]
    mean = total[:, ::factor] / np.float32(factor**2)
    for column in range(1, factor):
        mean += total[:, column::factor] / np.float32(factor**2)
    return mean


def _upsample(image: Singles, factor: int, length: int) -> Singles:
    """Return rows enlarged to a length, interpolated between the centres of coarse pixels."""
    most = image.shape[1] - 1
    places = np.clip((np.arange(length) + 0.5) / factor - 0.5, 0, most)
    low = np.minimum(places.astype(int), max(most - 1, 0))
    left, fine = (np.take(image, at, axis=1) for at in (low, np.minimum(low + 1, most)))
    fine -= left
    fine *= (places - low).astype(np.float32)
    fine += left
    return fine
