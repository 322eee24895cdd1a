"""Choose the facets of each patch so that outline and shading are smooth for a camera.

The distance between a patch and its n × n facets is bounded by the second derivatives of the patch
(D. Filip, R. Magedson, R. Markot, "Surface algorithms using bounds on derivatives", Computer Aided
Geometric Design 3, 1986). The control points bound the derivatives. The point of the patch that is
nearest to the camera gives the pixels per metre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spacemap_vtk.draw.camera import CameraView, pixels_per_metre_at_focus, project_points
from spacemap_vtk.filters.patch_tessellator import PatchTessellator
from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Bools, Floats, Ints
from spacemap_vtk.scenes.level_of_detail import LEAST_SIDES, LevelOfDetail
from spacemap_vtk.textile.geometry.irregularity import Irregularity
from spacemap_vtk.textile.geometry.plies import outline_curvature
from spacemap_vtk.textile.patches.bezier import quadrilateral_order

#: Largest distance between facets and their patch in pixels; more is visible in an outline.
_ERROR = 0.25
#: Largest number of facets along each side of a patch.
_MOST_SIDES = 128
#: Size of the area that counts as in sight, as a share of the picture. Without the margin, edges of
#: coarse patches outside would reach into the picture.
_BEYOND = 1.03
#: Least distance from the camera that is assumed, as a share of the distance to the focus.
_NEAREST = 1e-3
#: Number of patches that are sampled for the largest curvature of all.
_SAMPLE = 4000
_ORDER = quadrilateral_order(3, 3)


@dataclass(frozen=True)
class FacetChooser:
    """Computes the number of facets along each side of each patch, for one view."""

    view: CameraView
    #: Facets along each side of patches that are out of sight or need no more.
    least: int
    #: Largest number of facets of all patches in sight together.
    most_quads: int
    #: Number of plies: plied yarns are more curved than their patches.
    plies: int

    def __call__(self, points: AnyFloats, patches: AnyInts) -> Ints:
        """Return the subdivisions of each patch; each number is a multiple of all smaller ones."""
        needed = self.needed_subdivisions(points, patches)
        levels = self._round_up(needed)
        visible = needed > 0.0
        for _ in range(4):
            quads = float(np.square(levels[visible]).sum())
            if quads <= self.most_quads:
                break
            needed *= 0.95 * math.sqrt(self.most_quads / quads)
            levels = self._round_up(needed)
        return levels

    def _round_up(self, needed: Floats) -> Ints:
        """Round subdivisions up to one lowest number times powers of two."""
        top = math.ceil(min(float(needed.max(initial=0.0)), _MOST_SIDES))
        if top <= self.least:
            return np.full(len(needed), self.least)
        doublings = math.ceil(math.log2(top / self.least))
        lowest = math.ceil(top / 2**doublings)
        steps = np.ceil(np.log2(np.maximum(needed, lowest) / lowest) - 1e-9)
        return lowest * 2 ** np.minimum(steps, doublings).astype(np.int64)

    def needed_subdivisions(self, points: AnyFloats, patches: AnyInts) -> Floats:
        """Return the subdivisions that each patch needs; 0 out of sight."""
        needed = np.zeros(len(patches))
        if patches.shape[1] != 16:
            return needed
        camera = self.view.camera
        visible, nearest = self._visible_patches(points, patches)
        scale = pixels_per_metre_at_focus(camera, self.view.size[1])
        if not camera.GetParallelProjection():
            far = camera.GetDistance()
            scale = scale * far / np.maximum(nearest, _NEAREST * far)
        bounds = outline_curvature(self.plies) * _curvature_bounds(points, patches[visible])
        needed[visible] = np.sqrt(bounds * scale / (8 * _ERROR))
        return needed

    def _visible_patches(self, points: AnyFloats, patches: AnyInts) -> tuple[Bools, Floats]:
        """Return which patches are in sight, and the least distance of each of these."""
        width, height = self.view.size
        x, y, _, w = project_points(self.view.camera, points, width / height).T
        visible = np.ones(len(patches), bool)
        w = _BEYOND * w
        for beyond in (x < -w, x > w, y < -w, y > w):
            visible &= ~beyond[patches].all(axis=1)
        return visible, w[patches[visible]].min(axis=1, initial=np.inf) / _BEYOND


def choose_facets(
    stage: PatchTessellator,
    level: LevelOfDetail,
    view: CameraView,
    look: Irregularity | None = None,
) -> None:
    """Set the subdivisions of a stage to those of a level of detail, for a view."""
    facets = FacetChooser(view, level.sides, level.near_quads, level.plies)
    stage.set_detail(level.sides, level.fibres, facets if level.near_quads else None, look)


def coarse_scale(plies: int, points: AnyFloats, patches: AnyInts) -> float:
    """Return the pixels per metre up to which patches of plied yarns need only LEAST_SIDES."""
    sample = patches[:: 1 + len(patches) // _SAMPLE]
    bound = outline_curvature(plies) * _curvature_bounds(points, sample).max(initial=0.0)
    return 8 * _ERROR * LEAST_SIDES**2 / max(float(bound), 1e-30)


def _curvature_bounds(points: AnyFloats, patches: AnyInts) -> Floats:
    """Return bounds of |S_uu| + |S_vv| + 2 |S_uv| of patches, which bounds their facets' error."""
    bounds = np.empty(len(patches))
    for begin in range(0, len(patches), 20_000):
        part = slice(begin, begin + 20_000)
        net = points[patches[part][:, _ORDER]].reshape(-1, 4, 4, 3)
        across, along = (np.diff(net, 2, axis=axis) for axis in (1, 2))
        mixed = np.diff(np.diff(net, axis=1), axis=2)
        sizes = [
            np.sqrt(np.einsum("pijk,pijk->pij", each, each).max(axis=(1, 2)))
            for each in (across, along, mixed)
        ]
        bounds[part] = 6.0 * (sizes[0] + sizes[1]) + 2.0 * 9.0 * sizes[2]
    return bounds
