"""Choose how the yarns of a cloth are drawn, for window, pictures, films and figures alike.

A picture calls `choose_level` before anything is made, and `LevelOfDetail.at_scale` once its camera
is placed. The window also calls `choose_level`; if the result is a sheet, it calls `choose_near`
each time the camera comes to rest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from math import ceil, isqrt, prod

import numpy as np

from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.filters.patch_tessellator import AUTOMATIC_SIDES, MOST_SIDES, sides_for_pixels
from spacemap_vtk.memory import fits_in_memory
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.flat_picture import flat_cloth, pixels_per_metre
from spacemap_vtk.scenes.memory_estimates import (
    PictureRequest,
    require_pixels,
    require_sheet,
    require_yarns,
    sheet_bytes,
    yarn_bytes,
)
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.textile.geometry.weave import estimate_counts
from spacemap_vtk.textile.weave.cloth import Cloth


class DrawingMethod(Enum):
    """Ways to draw a cloth."""

    #: All yarns, in memory together.
    WHOLE = "whole"
    #: The yarns in view, made and drawn one piece after another.
    PIECES = "pieces"
    #: Like PIECES, in tiles with their neighbours, because clearances are measured.
    TILES = "tiles"
    #: In the window: the yarns in view, which replace that part of the sheet.
    NEAR = "near"
    #: A sheet with the mean colours of its yarns, or with tiles of them a few pixels wide.
    SHEET = "sheet"


# Distances from yarn to yarn, in pixels.

#: Yarns closer than this cannot be seen separately.
SMALLEST_YARN = 2.0
#: The same limit in the window, which has one sample per pixel: finer yarns cause moiré patterns.
SMALLEST_IN_WINDOW = 3.0
#: Yarns closer than this fill the picture with edges, which need more samples.
_FINE = 4.0
#: Of yarns closer than this, a sheet shows all that can be seen: position, shading and colour.
TILED_YARN = 5.0

# Widths of yarns, in pixels.

#: Wider yarns show their fibres.
_FIBRES = 10.0
#: Wider yarns show the outlines of their plies.
_PLIES = 16.0

# Numbers of patches, and of quadrilaterals (facets) that they are divided into.

#: Up to this number a picture draws all patches together, however small: that takes no time.
MANY_PATCHES = 300_000
#: Up to this number the window draws all patches together.
WINDOW_PATCHES = 60_000
#: Most patches and quadrilaterals of a piece, which need some hundred megabytes. Each piece takes
#: as long to draw as an empty picture, 0.2 s for 1920 x 1080.
PIECE_PATCHES = 300_000
_PIECE_QUADS = 800_000
#: Most patches and quadrilaterals in view in the window: two seconds to make, one to draw.
NEAR_PATCHES = 1_500_000
_NEAR_QUADS = 2_000_000
#: More quadrilaterals are a mistake in `surface.subdivisions`: they take minutes to draw.
MOST_QUADS = 500_000_000
#: Most quadrilaterals of the patches in view: this number, or one for this many pixels.
_VIEW_QUADS = 600_000
_PIXELS_OF_QUAD = 4
#: Approximate number of points of a moving surface in a file, unless more are asked for.
FILE_POINTS = 500_000
#: Quadrilaterals along each side of a patch out of view.
LEAST_SIDES = AUTOMATIC_SIDES

#: Most crossings in a row of a sheet's texture, a power of 2: older graphics cards take no more.
LONGEST_ROW = 8192


@dataclass(frozen=True)
class DrawnCloth:
    """The figures of a scene's cloth that decide how it is drawn."""

    ends: int
    picks: int
    patches: int
    #: Mean distance from yarn to yarn in m, of the family with the larger one.
    spacing: float
    #: Height of the thickest yarn in m.
    height: float
    #: Width of the widest yarn in m.
    width: float
    #: Largest number of plies of a yarn.
    plies: int = 1
    #: Quadrilaterals along each side of a patch, if the scene gives them; None: automatic.
    subdivisions: int | None = None
    #: Whether colours show clearances, which belong to the quadrilaterals that are measured.
    clearance: bool = False
    #: Yarns closer than this number of pixels are not drawn one by one, if there are many.
    least_pixels: float = SMALLEST_YARN

    @property
    def follows_camera(self) -> bool:
        """Whether patches near the camera may have more quadrilaterals than others."""
        return self.subdivisions is None and not self.clearance

    @classmethod
    def from_scene(cls, scene: Scene) -> DrawnCloth | None:
        """Return the figures of a scene; None if it has no cloth, or an impossible one."""
        if scene.woven is None:
            return None
        try:
            cloth = scene.woven.cloth
            patches = estimate_counts(cloth).patches
        except SpacemapError:
            return None  # the stage raises this error when it runs
        return cls(
            *cloth.size,
            patches,
            spacing=max(family.mean_spacing(0.0) for family in cloth.threads),
            height=max(float(np.max(family.diameter)) for family in cloth.threads),
            width=max(float(np.max(family.diameter)) * family.aspect for family in cloth.threads),
            plies=max(int(np.max(family.plies)) for family in cloth.threads),
            subdivisions=scene.surface.subdivisions,
            clearance=scene.view.color == "clearance",
            least_pixels=_least_pixels(scene, cloth),
        )


@dataclass(frozen=True)
class LevelOfDetail:
    """How the yarns of a cloth are drawn."""

    method: DrawingMethod = DrawingMethod.WHOLE
    #: Quadrilaterals along each side of a patch; with `near_quads`, of a patch out of view.
    sides: int = AUTOMATIC_SIDES
    #: Quadrilaterals that the patches in view share by distance; 0: all patches have `sides`.
    near_quads: int = 0
    #: Number of plies whose outlines are made.
    plies: int = 1
    #: Whether fibres are shaded.
    fibres: bool = False
    #: Number of pieces in which the yarns are made.
    pieces: int = 1
    #: Pixels from yarn to yarn.
    pixels: float = 0.0
    #: Whether yarns are wide enough to be drawn one by one, however many they are.
    shows_yarns: bool = False
    #: Memory for drawing, within a factor of two.
    bytes: int = 0

    @property
    def is_sampled(self) -> bool:
        """Whether OpenGL takes samples of each drawn pixel, because nearly all are edges."""
        return self.pixels < _FINE

    @property
    def has_sheet(self) -> bool:
        """Whether a sheet replaces yarns, which are not all in memory together."""
        return self.method is not DrawingMethod.WHOLE

    def at_scale(self, cloth: DrawnCloth, scale: float, size: tuple[int, int]) -> LevelOfDetail:
        """Return the level for the camera's position."""
        # `cloth` is the cloth for which this level was chosen, `scale` the pixels per metre where
        # it is nearest to the camera, and `size` the size of the fabric's picture. If yarns can be
        # seen, pieces of them replace the sheet.
        seen = facets_at_scale(cloth, scale, size)
        seen = replace(seen, method=self.method, bytes=self.bytes)
        made = cloth.subdivisions is not None or seen.shows_yarns
        if self.method is not DrawingMethod.SHEET or not made:
            return seen
        quads = cloth.patches * (cloth.subdivisions or seen.sides) ** 2
        pieces = ceil(max(cloth.patches / PIECE_PATCHES, quads / _PIECE_QUADS))
        return replace(
            seen,
            method=DrawingMethod.TILES if cloth.clearance else DrawingMethod.PIECES,
            pieces=min(pieces, cloth.ends + cloth.picks),
        )


def choose_level(
    scene: Scene,
    request: PictureRequest | None = None,
    *,
    opengl: bool = True,
    window: bool = False,
) -> LevelOfDetail:
    """Choose how a scene's yarns are drawn, before any is made: WHOLE or SHEET."""
    # Without a request neither pixels nor memory matter. With one, SizeError is raised if the
    # result would not fit into memory.
    cloth = DrawnCloth.from_scene(scene)
    if cloth is None or scene.woven is None:
        if request is not None:
            require_pixels(scene, request)
        return LevelOfDetail()
    if request is None:
        return LevelOfDetail(choose_method(cloth, window=window))
    counts = cloth.ends, cloth.picks
    scale = pixels_per_metre(scene, scene.woven.cloth, request.size)
    sides = cloth.subdivisions or sides_for_pixels(scale * cloth.height)
    size = yarn_bytes(scene, request, cloth.patches, sides)
    face = scale * cloth.spacing if flat_cloth(scene) else None
    # The estimate holds within a factor of two. A large cloth can also be drawn as a sheet.
    fit = fits_in_memory(2 * size if cloth.patches > MANY_PATCHES else size)
    form = choose_method(cloth, face, fit, opengl=opengl, window=window)
    if form is DrawingMethod.WHOLE:
        require_yarns(scene, request, counts, cloth.patches, sides)
        return LevelOfDetail(form, sides, bytes=size)
    size = sheet_bytes(scene, request, cloth.ends * cloth.picks, texture_halvings(counts))
    require_sheet(scene, counts, size)
    return LevelOfDetail(form, bytes=size)


def choose_method(
    cloth: DrawnCloth,
    face: float | None = None,
    fit: bool = True,
    *,
    opengl: bool = True,
    window: bool = False,
) -> DrawingMethod:
    """Choose WHOLE or SHEET."""
    # `face`: pixels from yarn to yarn of a still cloth that is seen from its face, else None.
    # `fit`: whether all yarns together fit into memory.
    if cloth.subdivisions is not None:
        # A request that takes hours is refused, not drawn in pieces.
        refused = cloth.patches * cloth.subdivisions**2 >= MOST_QUADS
        return DrawingMethod.WHOLE if fit or refused else DrawingMethod.SHEET
    # Only a sheet has the exact mean colour of everything in a pixel. Therefore a sheet also
    # replaces few yarns if they are too thin to be seen. Without OpenGL they are drawn, less
    # exactly.
    thin = face is not None and face < SMALLEST_YARN and opengl
    many = WINDOW_PATCHES if window else MANY_PATCHES
    if fit and cloth.patches <= many and not thin:
        return DrawingMethod.WHOLE
    return DrawingMethod.SHEET


def choose_near(
    cloth: DrawnCloth, scale: float, patches: int, size: tuple[int, int]
) -> LevelOfDetail:
    """Choose NEAR or SHEET for the yarns in the window's view, which have this many patches."""
    least = max(SMALLEST_IN_WINDOW, cloth.least_pixels)
    if scale * cloth.spacing < least or patches > NEAR_PATCHES:
        return LevelOfDetail(DrawingMethod.SHEET)
    most = max(1, isqrt(_NEAR_QUADS // max(1, patches)))
    seen = facets_at_scale(cloth, scale, size)
    return replace(seen, method=DrawingMethod.NEAR, sides=min(seen.sides, most))


def facets_at_scale(cloth: DrawnCloth, scale: float, size: tuple[int, int]) -> LevelOfDetail:
    """Choose facets that look round, where a metre has at most `scale` pixels."""
    plies = cloth.plies if cloth.width * scale > _PLIES else 1
    sides = sides_for_pixels(cloth.height * scale, plies)
    level = LevelOfDetail(
        sides=sides,
        plies=plies,
        fibres=shows_fibres(cloth, scale),
        pixels=cloth.spacing * scale,
        shows_yarns=cloth.spacing * scale >= cloth.least_pixels,
    )
    if sides < MOST_SIDES or not cloth.follows_camera:
        return level
    return replace(level, sides=LEAST_SIDES, near_quads=quads_in_view(size))


def shows_fibres(cloth: DrawnCloth, scale: float) -> bool:
    """Return whether a picture shows fibres, where a metre has at most `scale` pixels."""
    return cloth.width * scale > _FIBRES


def sides_in_file(cloth: DrawnCloth, usual: int) -> int:
    """Return the quadrilaterals along each side of a patch in a file of a moving surface."""
    return max(1, min(usual, int((FILE_POINTS / cloth.patches) ** 0.5)))


def texture_halvings(counts: tuple[int, int]) -> int:
    """Return how often a texture of these ends and picks is halved to fit into OpenGL's limits."""
    return max(0, (max(counts) - 1).bit_length() - LONGEST_ROW.bit_length() + 1)


def quads_in_view(size: tuple[int, int]) -> int:
    """Return the largest number of quadrilaterals in view for the size of a picture."""
    return max(_VIEW_QUADS, prod(size) // _PIXELS_OF_QUAD)


def _least_pixels(scene: Scene, cloth: Cloth) -> float:
    """Return the pixels from yarn to yarn below which a sheet shows all that can be seen."""
    # Lines around yarns and numbers on them are not on the tiles, and a texture of halved size has
    # no tiles.
    lined = scene.view.resolved_style.outline > 0.0
    numbers = COLORINGS[scene.view.color].shows_numbers
    return SMALLEST_YARN if lined or numbers or max(cloth.size) > LONGEST_ROW else TILED_YARN
