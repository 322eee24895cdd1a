"""Compute and draw the face that a plane cuts through a closed surface, so that it looks solid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkTriangleFilter
from vtkmodules.vtkFiltersGeneral import vtkContourTriangulator

from spacemap_vtk.datasets.arrays import add_array, copy_rows, points_of, to_points, to_rings
from spacemap_vtk.draw.actors.glyphs import Cut
from spacemap_vtk.draw.actors.surface_actor import STUDIO, Span, SurfaceActor
from spacemap_vtk.ndarrays import Bools, Floats, Ints
from spacemap_vtk.scenes.styles import WHITE, Style

#: Corners that are nearer than this are merged, as a share of the face's extent.
_MERGE_DISTANCE = 1e-6
#: An outline continues in another patch that begins nearer than this, as a share of the extent.
_SEAM_DISTANCE = 1e-3
#: A part of the face with less than this share of the largest part's area is rounding.
_NEGLIGIBLE_AREA = 1e-5
#: Distance between the plane and the actual cut, as a share of the surface's diagonal.
_OFFSET = 1e-6
#: Distance at which a face is drawn in front of the plane, as a share of the surface's diagonal.
_FRONT_DISTANCE = 2e-4
#: Brightness of a face, as a share of its colour: slightly darker than a lit surface.
BRIGHTNESS = 0.78


class CutFaceActor(SurfaceActor):
    """The face of a cut, in the colours of the cut surface, without directed light."""

    def __init__(self) -> None:
        super().__init__()
        self.SetPickable(False)

    def _apply_style(self, surface: vtkPolyData, style: Style, point: float) -> None:
        light = (BRIGHTNESS**2,) * 3 if style.lamps else WHITE
        flat = replace(style.for_numbers, sky=light, earth=light, facing=0.0)
        super()._apply_style(surface, flat, point)

    def fill(
        self,
        surface: vtkPolyData,
        cut: Cut | None,
        color: str,
        plain_color: Sequence[int],
        span: Span | None,
        style: Style = STUDIO,
    ) -> None:
        """Draw the face of a cut; hide the actor if there is none."""
        face = vtkPolyData() if cut is None else compute_cut_face(surface, cut)
        self.SetVisibility(face.GetNumberOfCells() > 0)
        if cut is not None and face.GetNumberOfCells():
            self.show(face, color, plain_color, span, style=replace(style, outline=0.0, sheen=0.0))
            # The plane that the user drags lies in the same place and would hide the face.
            normal = np.array(cut[0]) / np.linalg.norm(cut[0])
            self.SetPosition(*(-_FRONT_DISTANCE * surface.GetLength() * normal).tolist())


def compute_cut_face(surface: vtkPolyData, cut: Cut) -> vtkPolyData:
    """Return the face that a plane cuts through the inside of a surface."""
    face = vtkPolyData()
    if not surface.GetNumberOfPolys():
        return face
    points = points_of(surface).astype(np.float64)
    normal = np.array(cut[0], np.float64)
    normal /= np.linalg.norm(normal)
    # Planes often pass through a centre, where patches meet whose points differ by rounding. With a
    # small offset all these points are on the same side.
    height = (points - cut[1]) @ normal + _OFFSET * surface.GetLength()
    triangles, cells = _crossing_triangles(surface, height >= 0.0)
    if not len(triangles):
        return face
    ends, segments = _segments(triangles, height >= 0.0)
    share = height[ends[:, 0]] / (height[ends[:, 0]] - height[ends[:, 1]])
    corners = points[ends[:, 0]] * (1 - share[:, None]) + points[ends[:, 1]] * share[:, None]
    yarns = surface.GetCellData().GetArray("yarn")
    parts = np.zeros(len(cells)) if yarns is None else vtk_to_numpy(yarns)[cells]
    loops, first = _loops(segments, corners, parts)
    areas = np.array([_area(corners[loop], normal) for loop in loops])
    kept = np.nonzero(np.abs(areas) > _NEGLIGIBLE_AREA * np.abs(areas).max(initial=0.0))[0]
    if not len(kept):
        return face
    loops = [loops[k] for k in kept]
    face.SetPoints(to_points(corners))
    _interpolate(surface, face, ends, share)
    if areas[kept].min() < 0.0:
        return _fill_with_holes(face, loops)
    face.SetPolys(to_rings(loops))
    copy_rows(surface.GetCellData(), face.GetCellData(), cells[first[kept]])
    triangulated = vtkTriangleFilter()
    triangulated.SetInputData(face)
    # The executive's Update keeps Python's global lock: see `Stage.update`.
    triangulated.GetExecutive().Update()
    return triangulated.GetOutput()


def _crossing_triangles(surface: vtkPolyData, above: Bools) -> tuple[Ints, Ints]:
    """Return the triangles that cross the plane, (n, 3), and the cell of each."""
    polygons = surface.GetPolys()
    offsets = vtk_to_numpy(polygons.GetOffsetsArray()).astype(np.int64)
    numbers = vtk_to_numpy(polygons.GetConnectivityArray())
    sizes, count = np.diff(offsets), np.add.reduceat(above[numbers], offsets[:-1], dtype=np.int64)
    cut = np.nonzero((count > 0) & (count < sizes))[0]
    triangles, cells = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for size in np.unique(sizes[cut]):
        of_this_size = cut[sizes[cut] == size]
        corners = numbers[offsets[of_this_size][:, None] + np.arange(size)]
        for k in range(1, int(size) - 1):
            triangles.append(corners[:, [0, k, k + 1]].astype(np.int64))
            cells.append(of_this_size)
    all_triangles, all_cells = np.concatenate(triangles), np.concatenate(cells)
    crossing = np.ptp(above[all_triangles].astype(np.int8), axis=1) > 0
    # Cell data begins with the vertices and lines, if there are any.
    before = surface.GetNumberOfVerts() + surface.GetNumberOfLines()
    return all_triangles[crossing], all_cells[crossing] + before


def _segments(triangles: Ints, above: Bools) -> tuple[Ints, Ints]:
    """Return the cut edges (n, 2), and for each triangle the edge where it begins and ends."""
    side = above[triangles]
    single = np.argmax(side != (side.sum(axis=1) > 1)[:, None], axis=1)
    rows = np.arange(len(triangles))
    rotated = triangles[rows[:, None], (single[:, None] + [0, 1, 2]) % 3]
    edges = np.stack([rotated[:, [0, 1]], rotated[:, [0, 2]]], axis=1)
    # Around each triangle, the outline crosses one edge downwards and another upwards. A neighbour
    # that shares an edge crosses it in the opposite direction.
    rising = ~side[rows, single]
    edges[rising] = edges[rising][:, ::-1]
    pairs, number = np.unique(np.sort(edges, axis=2).reshape(-1, 2), axis=0, return_inverse=True)
    return pairs, number.reshape(-1, 2)


def _loops(segments: Ints, corners: Floats, parts: NDArray[Any]) -> tuple[list[Ints], Ints]:
    """Return the closed outlines of the face, and the index of one segment of each."""
    follower = dict(zip(segments[:, 0].tolist(), segments[:, 1].tolist(), strict=True))
    segment_of = dict(zip(segments[:, 0].tolist(), range(len(segments)), strict=True))
    extent = float(np.ptp(corners, axis=0).max())
    follower.update(_seams(segments, corners / extent, parts))
    loops, first = [], []
    while follower:
        start, next_corner = follower.popitem()
        loop = [start]
        while next_corner != start and next_corner in follower:
            loop.append(next_corner)
            next_corner = follower.pop(next_corner)
        if next_corner != start:
            continue
        ring = np.array(loop, np.int64)
        steps = np.abs(corners[ring] - corners[np.roll(ring, 1)]).max(axis=1)
        ring = ring[steps > _MERGE_DISTANCE * extent]
        if len(ring) > 2:
            loops.append(ring)
            first.append(next(segment_of[corner] for corner in loop if corner in segment_of))
    return loops, np.array(first, np.int64)


def _seams(segments: Ints, corners: Floats, parts: NDArray[Any]) -> dict[int, int]:
    """Return pairs of corners where the outline continues from one patch into another."""
    from scipy.spatial import KDTree  # imported here because it takes long

    last = np.nonzero(~np.isin(segments[:, 1], segments[:, 0]))[0]
    next_ = np.nonzero(~np.isin(segments[:, 0], segments[:, 1]))[0]
    found: dict[int, int] = {}
    # Yarns touch, but an outline never continues in another yarn: the yarn is a fourth coordinate.
    places = [
        np.column_stack([corners[segments[rows, end]], parts[rows]])
        for rows, end in ((last, 1), (next_, 0))
    ]
    while len(last) and len(next_):
        distance, nearest = KDTree(places[1]).query(places[0])
        order = np.argsort(distance, kind="stable")
        taken, which = np.unique(nearest[order], return_index=True)
        joined = order[which]
        joined, taken = (rows[distance[joined] < _SEAM_DISTANCE] for rows in (joined, taken))
        if not len(joined):
            break
        ends, starts = segments[last[joined], 1], segments[next_[taken], 0]
        found.update(zip(ends.tolist(), starts.tolist(), strict=True))
        last, places[0] = np.delete(last, joined), np.delete(places[0], joined, axis=0)
        next_, places[1] = np.delete(next_, taken), np.delete(places[1], taken, axis=0)
    return found


def _area(ring: Floats, normal: Floats) -> float:
    """Return the area inside a ring of points, negative if it is clockwise."""
    seen = ring - ring.mean(axis=0)
    return float(np.cross(seen, np.roll(seen, -1, axis=0)).sum(axis=0) @ normal) / 2


def _fill_with_holes(face: vtkPolyData, loops: list[Ints]) -> vtkPolyData:
    """Return the face of a hollow object, without cell arrays."""
    face.SetLines(to_rings([np.append(loop, loop[0]) for loop in loops]))
    filled = vtkContourTriangulator()
    filled.SetInputData(face)
    filled.GetExecutive().Update()
    return filled.GetOutput()


def _interpolate(surface: vtkPolyData, face: vtkPolyData, ends: Ints, share: Floats) -> None:
    """Interpolate a surface's point arrays, except normals, at the corners of a face."""
    source = surface.GetPointData()
    for i in range(source.GetNumberOfArrays()):
        array: Any = source.GetArray(i)
        if array is None or not array.GetName() or array is source.GetNormals():
            continue
        values = vtk_to_numpy(array)
        part = share.reshape(-1, *[1] * (values.ndim - 1))
        mean = values[ends[:, 0]] * (1 - part) + values[ends[:, 1]] * part
        add_array(face.GetPointData(), array.GetName(), mean.astype(values.dtype))
