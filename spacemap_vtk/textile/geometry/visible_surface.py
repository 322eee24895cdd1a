"""What is visible of a cloth's yarns from a direction: normals, exposure and families.

Each patch is divided into facets smaller than a pixel, and each pixel shows the nearest facet at
its centre. Nothing here depends on the shape of sections or axes: all comes from the patches that
pictures of single yarns show.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk import cancel
from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Floats, Ints, Singles
from spacemap_vtk.textile.geometry.cloth_axes import YarnSelection
from spacemap_vtk.textile.geometry.exposure import ClothExposure
from spacemap_vtk.textile.geometry.partition import crop_cloth
from spacemap_vtk.textile.geometry.plies import Strands
from spacemap_vtk.textile.geometry.weave import build_weave
from spacemap_vtk.textile.patches.bezier import bernstein, bernstein_derivative, quadrilateral_order
from spacemap_vtk.textile.weave.cloth import Cloth

#: Largest size of a facet in pixels: it then covers the centres of at most 2 x 2 pixels.
_FACET = 0.7
#: Numbers of facets along a side of a patch: few, because patches with equal numbers are evaluated
#: together.
_COUNTS = np.array([1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64])
#: Reach of a facet from its middle along its sides, as a share of them: half, and some rounding.
_HALF = np.float32(0.5 + 1e-3)


class SurfaceFacets(NamedTuple):
    """Small parallelograms on the yarns of a part of a cloth, (n, 3) or (n,)."""

    # Distances along the cloth are counted in mean spacings, so that all crossings are equally
    # large.

    middle: Singles
    """Along the picks, along the ends, and up, in m; a corner of the part is the origin."""
    side_u: Singles
    """Vectors of the sides, in m."""
    side_v: Singles
    exposure: Singles
    """Exposure to light from all sides; see `spacemap_vtk.textile.geometry.exposure`."""
    family: NDArray[np.uint8]
    """0 warp, 1 weft."""
    yarn: NDArray[np.int32]
    """Number of the end or the pick in the part."""
    size: tuple[int, int]
    """Ends and picks of the part."""
    spacing: tuple[float, float]
    """Mean distance between ends, and between picks, in m."""


class VisibleSurface(NamedTuple):
    """The pixels of a view, (rows, columns)."""

    normals: Singles
    """Unit normals, (rows, columns, 3); 0 where nothing is."""
    exposure: Singles
    """Exposure to light from all sides."""
    family: NDArray[np.int8]
    """0 warp, 1 weft, -1 where nothing is."""
    yarn: NDArray[np.int32]
    """Number of the end or the pick in the part."""
    crossing: Ints
    """Number of the crossing, pick by pick; where nothing is, that in the middle plane; -1 outside
    the part."""
    place: Floats
    """Places in the middle plane, in crossings, (rows, columns, 2)."""
    pixel: float
    """Size of a pixel, in m."""


def sample_surface(cloth: Cloth, part: YarnSelection, pixels: float) -> SurfaceFacets:
    """Divide the yarns of a part of a cloth into facets for views of `pixels` pixels per crossing.

    Parameters
    ----------
    cloth : Cloth
        There must be room for its yarns.
    part : YarnSelection
        Slices of neighbouring yarns.
    pixels : float
        Pixels of a view along each side of a crossing.

    Returns
    -------
    SurfaceFacets
        Without the caps of cut ends.
    """
    cancel.check()
    crop = crop_cloth(cloth, part)
    weave = build_weave(crop)
    patches = weave.patches[: weave.tube_patches, quadrilateral_order(3, 3)]
    spacing = crop.families[0].spacing, crop.families[1].spacing
    step = _FACET * min(spacing) / pixels
    net = weave.points[patches].reshape(-1, 4, 4, 3)
    counts = [_count_facets(net, axis, step) for axis in (1, 2)]
    strands, exposed = Strands(weave.patches, crop, weave.places, 1), ClothExposure(crop)
    found, exposure, yarn = [], [], []
    for rows, columns in np.unique(np.stack(counts, axis=1), axis=0).tolist():
        (chosen,) = np.nonzero((counts[0] == rows) & (counts[1] == columns))
        weights = None if weave.weights is None else weave.weights[patches[chosen]]
        found.append(_evaluate(net[chosen].reshape(-1, 16, 3), weights, rows, columns))
        face = strands.face(chosen, (np.arange(rows) + 0.5) / rows).T.repeat(columns, axis=1)
        exposure.append(exposed.evaluate(found[-1][0], face.ravel(), np.zeros(face.size)))
        yarn.append(np.repeat(weave.yarn[chosen], rows * columns))
    middle, side_u, side_v = (np.concatenate(each) for each in zip(*found, strict=True))
    for number in (0, 1):
        borders = _borders(crop, number)
        numbers = np.arange(len(borders))
        middle[:, number] = np.interp(middle[:, number], borders, numbers, -1.0, len(borders))
    yarns = np.concatenate(yarn)
    family = yarns >= crop.size[0]
    inside = ((middle[:, :2] >= 0.0) & (middle[:, :2] <= crop.size)).all(axis=1)
    middle[:, :2] *= spacing
    return SurfaceFacets(
        middle[inside].astype(np.float32),
        side_u[inside].astype(np.float32),
        side_v[inside].astype(np.float32),
        np.minimum(np.concatenate(exposure)[inside], np.float32(1.0)),
        family[inside].astype(np.uint8),
        (yarns - crop.size[0] * family)[inside].astype(np.int32),
        crop.size,
        spacing,
    )


def view_surface(surface: SurfaceFacets, toward_eye: Floats, pixels: float) -> VisibleSurface:
    """Find the visible points of a part of a cloth, in parallel projection.

    Parameters
    ----------
    surface : SurfaceFacets
        Sampled for at least as many pixels.
    toward_eye : (3,) float64
        Unit vector to the eye, not in the plane of the cloth.
    pixels : float
        Pixels along each side of a crossing that is seen from its face. There, columns follow the
        picks and rows the ends, on both faces. With a fraction, the pixels of the crossings differ,
        so that their mean is more exact.

    Returns
    -------
    VisibleSurface
        All of the part.
    """
    cancel.check()
    size = np.array(surface.spacing)
    pixel = np.full(2, size.min() / pixels)
    up = np.array([0.0, 1.0, 0.0]) - toward_eye[1] * toward_eye
    up /= np.linalg.norm(up)
    frame = np.stack([np.cross(up, toward_eye) * np.sign(toward_eye[2]), up, -toward_eye])
    corners = np.array([[x, y, 0.0] for x in (0, 1) for y in (0, 1)])
    corners[:, :2] *= size * surface.size
    flat = (corners @ frame.T)[:, :2] / pixel
    low = np.floor(flat.min(axis=0) + 1e-6)
    columns, rows = np.maximum(np.ceil(flat.max(axis=0) - 1e-6) - low, 1).astype(int)
    normals = np.cross(surface.side_u, surface.side_v)
    (toward,) = np.nonzero(normals @ toward_eye.astype(np.float32) > 0.0)
    scale = (frame / [[pixel[0]], [pixel[1]], [1.0]]).astype(np.float32)
    middle, u, v = (
        part[toward] @ scale.T for part in (surface.middle, surface.side_u, surface.side_v)
    )
    middle[:, :2] -= low
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    area = np.where(np.abs(area) > 1e-9, area, np.float32(np.inf))
    reach = 0.5 * (np.abs(u[:, :2]) + np.abs(v[:, :2]))
    first = np.ceil(middle[:, :2] - reach - 0.5).astype(np.int32)
    depth = np.full(rows * columns, np.inf, np.float32)
    hits = []
    for i, j in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = first[:, 0] + i, first[:, 1] + j
        x, y = (
            each.astype(np.float32) + np.float32(0.5) - middle[:, k]
            for k, each in enumerate((column, row))
        )
        along_u, along_v = (x * v[:, 1] - y * v[:, 0]) / area, (y * u[:, 0] - x * u[:, 1]) / area
        inside = (np.abs(along_u) <= _HALF) & (np.abs(along_v) <= _HALF)
        inside &= (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        (hit,) = np.nonzero(inside)
        at = row[hit] * columns + column[hit]
        behind = middle[hit, 2] + along_u[hit] * u[hit, 2] + along_v[hit] * v[hit, 2]
        np.minimum.at(depth, at, behind)
        hits.append((at, behind, toward[hit]))
    nearest = np.full(rows * columns, -1)
    for at, behind, facet in hits:
        visible = behind == depth[at]
        nearest[at[visible]] = facet[visible]
    empty = nearest < 0
    # Where nothing is, the line of sight crosses the middle plane.
    across, along = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5)
    seen = (np.stack([across, along], axis=-1).reshape(-1, 2) + low) * pixel
    place = seen @ np.linalg.inv(frame[:2, :2]).T
    own = place.copy()
    own[~empty] = surface.middle[nearest[~empty], :2]
    end, pick = np.floor(own / size).astype(int).T
    outside = (end < 0) | (end >= surface.size[0]) | (pick < 0) | (pick >= surface.size[1])
    shown = normals[nearest]
    shown /= np.maximum(np.linalg.norm(shown, axis=1, keepdims=True), np.float32(1e-30))
    shown[empty] = 0.0
    return VisibleSurface(
        shown.reshape(rows, columns, 3),
        surface.exposure[nearest].reshape(rows, columns),
        np.where(empty, -1, surface.family[nearest]).astype(np.int8).reshape(rows, columns),
        surface.yarn[nearest].reshape(rows, columns),
        np.where(outside, -1, pick * surface.size[0] + end).reshape(rows, columns),
        (place / size).reshape(rows, columns, 2),
        float(pixel[0]),
    )


def _count_facets(net: AnyFloats, axis: int, step: float) -> Ints:
    """Return the number of facets along an axis of each patch."""
    lengths = np.linalg.norm(np.diff(net, axis=axis), axis=-1).sum(axis=axis).max(axis=1)
    return _COUNTS[np.minimum(np.searchsorted(_COUNTS, lengths / step), len(_COUNTS) - 1)]


def _evaluate(
    net: AnyFloats, weights: Floats | None, rows: int, columns: int
) -> tuple[Floats, Floats, Floats]:
    """Return middles and sides of rows x columns facets of each patch."""
    u, v = ((np.arange(count) + 0.5) / count for count in (columns, rows))
    along_u, along_v = ((bernstein(3, each), bernstein_derivative(3, each)) for each in (u, v))
    bases = [
        np.einsum("vj,ui->vuji", along_v[j], along_u[i]).reshape(-1, 16)
        for i, j in ((0, 0), (1, 0), (0, 1))
    ]
    if weights is None:
        point, du, dv = (basis @ net for basis in bases)
    else:
        weighted = net * weights[..., None]
        value, slope_u, slope_v = (basis @ weighted for basis in bases)
        weight, weight_u, weight_v = (basis @ weights[..., None] for basis in bases)
        point = value / weight
        du, dv = (slope_u - point * weight_u) / weight, (slope_v - point * weight_v) / weight
    made = point, du / columns, dv / rows
    return made[0].reshape(-1, 3), made[1].reshape(-1, 3), made[2].reshape(-1, 3)


def _borders(cloth: Cloth, number: int) -> Floats:
    """Return the borders between the crossings of a family's yarns, in m."""
    place = cloth.yarns[number].position
    half = 0.5 * cloth.families[number].spacing
    middle = 0.5 * (place[1:] + place[:-1])
    return np.concatenate([[place[0] - half], middle, [place[-1] + half]])


def weights_of_crossings(
    weaves: AnyInts, parts: list[tuple[slice, slice]], margin: int
) -> list[Floats]:
    """Return the share of the cloth that each crossing of some parts stands for.

    Parameters
    ----------
    weaves : (picks, ends) ndarray of int
        Number of the local weave of each crossing.
    parts : list of (slice, slice)
        Ends and picks of each part.
    margin : int
        Crossings at the borders of a part that stand for nothing, because their neighbours are
        missing.

    Returns
    -------
    list of (picks, ends) float64
        Together they have the sum 1.
    """
    counts = np.bincount(weaves.ravel()).astype(np.float64)
    sampled = np.zeros(len(counts))
    inner = []
    for ends, picks in parts:
        mask = np.zeros((picks.stop - picks.start, ends.stop - ends.start))
        mask[_inner(picks, weaves.shape[0], margin), _inner(ends, weaves.shape[1], margin)] = 1.0
        sampled += np.bincount(weaves[picks, ends].ravel(), mask.ravel(), len(counts))
        inner.append(mask)
    share = counts / np.maximum(sampled, 1.0)
    made = [
        mask * share[weaves[picks, ends]] for mask, (ends, picks) in zip(inner, parts, strict=True)
    ]
    total = sum(float(each.sum()) for each in made)
    return [each / total for each in made]


def _inner(yarns: slice, count: int, margin: int) -> slice:
    """Return the part of a slice away from its borders, except at the edges of the cloth."""
    length = yarns.stop - yarns.start
    start = margin if yarns.start > 0 else 0
    stop = length - (margin if yarns.stop < count else 0)
    return slice(start, stop) if stop > start else slice(0, length)
