"""As many facets of each patch as keep its outline and its shading smooth where a camera stands.

A patch of which n × n facets are made is nowhere farther from them than the second derivatives of
its parameters allow (D. Filip, R. Magedson, R. Markot, "Surface algorithms using bounds on
derivatives", Computer Aided Geometric Design 3, 1986): these come from its control points, and what
a metre is in pixels from its point that is nearest to the camera.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from spacemap_vtk.draw.camera import Seen, pixels_of, projected
from spacemap_vtk.filters.patch_tessellator import PatchTessellator
from spacemap_vtk.ndarrays import AnyFloats, AnyInts, Bools, Floats, Ints
from spacemap_vtk.scenes.level_of_detail import LEAST_SIDES, LevelOfDetail
from spacemap_vtk.textile.geometry.plies import sharpness
from spacemap_vtk.textile.patches.bezier import quadrilateral_order

#: How far facets may be from their patch, in pixels. An eye finds half a pixel in an outline.
_ERROR = 0.4
#: Most facets along each side of a patch.
_MOST_SIDES = 128
#: Sight, as a share of the picture: edges of coarse patches beside it must not reach into it.
_BEYOND = 1.03
#: The nearest that anything is taken to be, as a share of the distance to the focus.
_NEAREST = 1e-3
#: Patches that tell how curved all are.
_SAMPLE = 4000
_ORDER = quadrilateral_order(3, 3)


@dataclass(frozen=True)
class Facets:
    """The number of facets along each side of each patch, seen from one place."""

    seen: Seen
    #: Out of sight, and where nobody needs more.
    least: int
    #: Of all patches in sight together, at most.
    most_quads: int
    #: Plied yarns are more curved than their patches.
    plies: int

    def __call__(self, points: AnyFloats, patches: AnyInts) -> Ints:
        """Return the subdivisions of each patch, each a multiple of those below it."""
        needed = self.needed(points, patches)
        levels = self._levels(needed)
        sight = needed > 0.0
        for _ in range(4):
            many = float(np.square(levels[sight]).sum())
            if many <= self.most_quads:
                break
            needed *= 0.95 * math.sqrt(self.most_quads / many)
            levels = self._levels(needed)
        return levels

    def _levels(self, needed: Floats) -> Ints:
        """Return at least as many subdivisions, in steps of two."""
        top = math.ceil(min(float(needed.max(initial=0.0)), _MOST_SIDES))
        if top <= self.least:
            return np.full(len(needed), self.least)
        doublings = math.ceil(math.log2(top / self.least))
        lowest = math.ceil(top / 2**doublings)
        steps = np.ceil(np.log2(np.maximum(needed, lowest) / lowest) - 1e-9)
        return lowest * 2 ** np.minimum(steps, doublings).astype(np.int64)

    def needed(self, points: AnyFloats, patches: AnyInts) -> Floats:
        """Return how many subdivisions each patch needs; 0 out of sight."""
        found = np.zeros(len(patches))
        if patches.shape[1] != 16:
            return found
        camera = self.seen.camera
        sight, nearest = self._sight(points, patches)
        scale = pixels_of(camera, self.seen.size[1])
        if not camera.GetParallelProjection():
            far = camera.GetDistance()
            scale = scale * far / np.maximum(nearest, _NEAREST * far)
        bent = sharpness(self.plies) * _bending(points, patches[sight])
        found[sight] = np.sqrt(bent * scale / (8 * _ERROR))
        return found

    def _sight(self, points: AnyFloats, patches: AnyInts) -> tuple[Bools, Floats]:
        """Return which patches are in sight, and how near each of them is."""
        width, height = self.seen.size
        x, y, _, w = projected(self.seen.camera, points, width / height).T
        seen = np.ones(len(patches), bool)
        w = _BEYOND * w
        for beyond in (x < -w, x > w, y < -w, y > w):
            seen &= ~beyond[patches].all(axis=1)
        return seen, w[patches[seen]].min(axis=1, initial=np.inf) / _BEYOND


def choose_facets(stage: PatchTessellator, level: LevelOfDetail, seen: Seen) -> None:
    """Let a stage make the facets of a level of detail."""
    facets = Facets(seen, level.sides, level.near_quads, level.plies)
    stage.choose(level.sides, level.fibres, facets if level.near_quads else None)


def pixels_enough(plies: int, points: AnyFloats, patches: AnyInts) -> float:
    """Return the pixels of a metre up to which patches of plied yarns need no more facets."""
    some = patches[:: 1 + len(patches) // _SAMPLE]
    bent = sharpness(plies) * _bending(points, some).max(initial=0.0)
    return 8 * _ERROR * LEAST_SIDES**2 / max(float(bent), 1e-30)


def _bending(points: AnyFloats, patches: AnyInts) -> Floats:
    """Return bounds of the second derivatives of patches, weighed as they move facets off."""
    found = np.empty(len(patches))
    for begin in range(0, len(patches), 20_000):
        some = slice(begin, begin + 20_000)
        net = points[patches[some][:, _ORDER]].reshape(-1, 4, 4, 3)
        across, along = (np.diff(net, 2, axis=axis) for axis in (1, 2))
        mixed = np.diff(np.diff(net, axis=1), axis=2)
        sizes = [
            np.sqrt(np.einsum("pijk,pijk->pij", each, each).max(axis=(1, 2)))
            for each in (across, along, mixed)
        ]
        found[some] = 6.0 * (sizes[0] + sizes[1]) + 2.0 * 9.0 * sizes[2]
    return found
