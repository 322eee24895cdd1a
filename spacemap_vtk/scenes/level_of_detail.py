"""How the yarns of a cloth are drawn: decided here, and obeyed by window, picture, film and figure.

A picture asks `choose_level` before anything is made, and `LevelOfDetail.at_scale` once its camera
is placed. The window asks `choose_level`, too; if that is a sheet, it asks `choose_near` whenever
the camera has come to rest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from math import ceil, isqrt, prod

import numpy as np

from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.filters.patch_tessellator import AUTOMATIC_SIDES, MOST_SIDES, sides_seen
from spacemap_vtk.memory import fits
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.face import face_of, face_scale
from spacemap_vtk.scenes.footprint import (
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


class Form(Enum):
    """What is drawn of a cloth."""

    #: All yarns, in memory together.
    WHOLE = "whole"
    #: The yarns in view, made and drawn one piece after another.
    PIECES = "pieces"
    #: As PIECES, in tiles with their neighbours beside them: clearances are measured.
    TILES = "tiles"
    #: In the window, the yarns in view in place of that part of the sheet.
    NEAR = "near"
    #: A sheet whose shader draws each yarn, a few pixels wide.
    SHADER = "shader"
    #: A sheet in the mean colours of its yarns, which are too thin to be seen.
    SHEET = "sheet"


# Distances from yarn to yarn, in pixels.

#: Nearer yarns are not seen as yarns.
SMALLEST_YARN = 2.0
#: The same in the window, which takes one sample of each pixel: finer yarns make moiré.
SMALLEST_IN_WINDOW = 3.0
#: Nearer yarns fill the picture with edges, which need more samples.
_FINE = 4.0
#: Nearer yarns show no more than their places, their light and their colours.
_RESOLVED_YARN = 8.0

# Widths of yarns, in pixels.

#: Wider yarns show their fibres.
_FIBRES = 10.0
#: Wider yarns show the outlines of their plies.
_PLIES = 16.0

# Numbers of patches, and of quadrilaterals (facets) that they are divided into.

#: Most patches that a picture draws together however small they are: that takes no time.
MANY_PATCHES = 300_000
#: Most patches that the window draws together.
WINDOW_PATCHES = 60_000
#: More patches take 5 s and more to draw: the shader draws what it can of them.
SHADER_PATCHES = 1_500_000
#: Most patches and quadrilaterals of a piece: some hundred megabytes. Each piece costs as much as
#: an empty picture, 0.2 s for 1920 x 1080.
PIECE_PATCHES = 300_000
_PIECE_QUADS = 800_000
#: Most patches and quadrilaterals in view in the window: made in two seconds, drawn in one.
NEAR_PATCHES = 1_500_000
_NEAR_QUADS = 2_000_000
#: More quadrilaterals are a mistake in `surface.subdivisions`: they take minutes to draw.
MOST_QUADS = 500_000_000
#: Quadrilaterals that patches in view may have: so many, or one for so many pixels.
_VIEW_QUADS = 600_000
_PIXELS_OF_QUAD = 4
#: Points of a moving surface in a file, about, unless more are asked for.
FILE_POINTS = 500_000
#: Quadrilaterals along each side of a patch out of view.
LEAST_SIDES = AUTOMATIC_SIDES

# What the sheet's shader can draw.

#: Most crossings in a row of its texture, a power of 2: older graphics cards take no more.
LONGEST_ROW = 8192
#: Share by which yarns of a family may differ: it knows one diameter and one spacing of each.
_ALIKE = 0.1


@dataclass(frozen=True)
class DrawnCloth:
    """The numbers of a scene's cloth that decide how it is drawn."""

    ends: int
    picks: int
    patches: int
    #: Mean distance from yarn to yarn in m, of the family where that is larger.
    spacing: float
    #: Height of the thickest yarn in m.
    height: float
    #: Width of the widest yarn in m.
    width: float
    #: Plies of the yarn that has most.
    plies: int = 1
    #: Quadrilaterals along each side of a patch that the scene asks for; None: as many as are seen.
    subdivisions: int | None = None
    #: Whether colours show clearances, which belong to the quadrilaterals they are measured on.
    clearance: bool = False
    #: Whether the sheet's shader can draw each yarn.
    shadable: bool = False

    @property
    def follows_camera(self) -> bool:
        """Whether patches near the camera may have more quadrilaterals than others."""
        return self.subdivisions is None and not self.clearance

    @classmethod
    def of(cls, scene: Scene) -> DrawnCloth | None:
        """Return the numbers of a scene; None if it has no cloth, or one that cannot be woven."""
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
            shadable=_is_shadable(scene, cloth),
        )


@dataclass(frozen=True)
class LevelOfDetail:
    """How the yarns of a cloth are drawn."""

    form: Form = Form.WHOLE
    #: Quadrilaterals along each side of a patch; if there are `near_quads`, of one out of view.
    sides: int = AUTOMATIC_SIDES
    #: Quadrilaterals that patches in view share as they are near or far; 0: all have `sides`.
    near_quads: int = 0
    #: Plies of which outlines are made.
    plies: int = 1
    #: Whether fibres are shaded.
    fibres: bool = False
    #: Number of pieces that the yarns are made in.
    pieces: int = 1
    #: Pixels from yarn to yarn.
    pixels: float = 0.0
    #: Memory that drawing takes, within a factor of two.
    bytes: int = 0

    @property
    def shows_yarns(self) -> bool:
        """Whether yarns are wide enough to be seen."""
        return self.pixels >= SMALLEST_YARN

    @property
    def is_sampled(self) -> bool:
        """Whether OpenGL takes samples of each drawn pixel, since nearly all are edges."""
        return self.pixels < _FINE

    @property
    def has_sheet(self) -> bool:
        """Whether a sheet stands in for yarns that are not in memory together."""
        return self.form is not Form.WHOLE

    def at_scale(self, cloth: DrawnCloth, scale: float, size: tuple[int, int]) -> LevelOfDetail:
        """Return the level for a camera that is placed."""
        # `cloth` is what this level was chosen for, `scale` the pixels of a metre where it is
        # nearest to the camera, `size` that of the fabric's picture. If yarns are seen, pieces of
        # them take the sheet's place.
        seen = facets_seen(cloth, scale, size)
        seen = replace(seen, form=self.form, bytes=self.bytes)
        made = cloth.subdivisions is not None or seen.shows_yarns
        if self.form is not Form.SHEET or not made:
            return seen
        quads = cloth.patches * (cloth.subdivisions or seen.sides) ** 2
        pieces = ceil(max(cloth.patches / PIECE_PATCHES, quads / _PIECE_QUADS))
        return replace(
            seen,
            form=Form.TILES if cloth.clearance else Form.PIECES,
            pieces=min(pieces, cloth.ends + cloth.picks),
        )


def choose_level(
    scene: Scene,
    request: PictureRequest | None = None,
    *,
    opengl: bool = True,
    window: bool = False,
) -> LevelOfDetail:
    """Return how a scene's yarns are drawn, before any is made: WHOLE, SHADER or SHEET."""
    # Without a request neither pixels nor memory count; with one, SizeError is raised if what
    # would be drawn does not fit into memory.
    cloth = DrawnCloth.of(scene)
    if cloth is None or scene.woven is None:
        if request is not None:
            require_pixels(scene, request)
        return LevelOfDetail()
    if request is None:
        return LevelOfDetail(choose_form(cloth, window=window))
    counts = cloth.ends, cloth.picks
    scale = face_scale(scene, scene.woven.cloth, request.size)
    sides = cloth.subdivisions or sides_seen(scale * cloth.height)
    size = yarn_bytes(scene, request, cloth.patches, sides)
    face = scale * cloth.spacing if face_of(scene) else None
    shader = opengl and not request.wireframe
    form = choose_form(cloth, face, fits(size), opengl=opengl, shader=shader, window=window)
    if form is Form.WHOLE:
        require_yarns(scene, request, counts, cloth.patches, sides)
        return LevelOfDetail(form, sides, bytes=size)
    size = sheet_bytes(scene, request, cloth.ends * cloth.picks)
    require_sheet(scene, counts, size)
    return LevelOfDetail(form, bytes=size)


def choose_form(
    cloth: DrawnCloth,
    face: float | None = None,
    fit: bool = True,
    *,
    opengl: bool = True,
    shader: bool = True,
    window: bool = False,
) -> Form:
    """Return WHOLE, SHADER or SHEET."""
    # `face`: pixels from yarn to yarn of a still cloth that is seen from its face, else None.
    # `fit`: whether all yarns fit into memory together. `shader`: whether the sheet's may be used.
    if cloth.subdivisions is not None:
        # What takes hours is refused, not drawn in pieces.
        refused = cloth.patches * cloth.subdivisions**2 >= MOST_QUADS
        return Form.WHOLE if fit or refused else Form.SHEET
    # Only a sheet has the exact mean colour of all that a pixel shows, so that few yarns that are
    # too thin to be seen become one, too. Without OpenGL they are drawn, if less exactly.
    thin = face is not None and face < SMALLEST_YARN and opengl
    many = WINDOW_PATCHES if window else MANY_PATCHES
    if fit and cloth.patches <= many and not thin:
        return Form.WHOLE
    resolved = face is not None and SMALLEST_YARN <= face < _RESOLVED_YARN
    if resolved and shader and cloth.shadable and cloth.patches >= SHADER_PATCHES:
        return Form.SHADER
    return Form.SHEET


def choose_near(
    cloth: DrawnCloth, scale: float, patches: int, size: tuple[int, int]
) -> LevelOfDetail:
    """Return how the window draws the yarns in view, which have so many patches: NEAR or SHEET."""
    if scale * cloth.spacing < SMALLEST_IN_WINDOW or patches > NEAR_PATCHES:
        return LevelOfDetail(Form.SHEET)
    most = max(1, isqrt(_NEAR_QUADS // max(1, patches)))
    seen = facets_seen(cloth, scale, size)
    return replace(seen, form=Form.NEAR, sides=min(seen.sides, most))


def facets_seen(cloth: DrawnCloth, scale: float, size: tuple[int, int]) -> LevelOfDetail:
    """Return the quadrilaterals that look round where a metre is at most so many pixels."""
    plies = cloth.plies if cloth.width * scale > _PLIES else 1
    sides = sides_seen(cloth.height * scale, plies)
    level = LevelOfDetail(
        sides=sides,
        plies=plies,
        fibres=cloth.width * scale > _FIBRES,
        pixels=cloth.spacing * scale,
    )
    if sides < MOST_SIDES or not cloth.follows_camera:
        return level
    return replace(level, sides=LEAST_SIDES, near_quads=quads_in_view(size))


def sides_in_file(cloth: DrawnCloth, usual: int) -> int:
    """Return the quadrilaterals along each side of a patch in a file of a moving surface."""
    return max(1, min(usual, int((FILE_POINTS / cloth.patches) ** 0.5)))


def quads_in_view(size: tuple[int, int]) -> int:
    """Return how many quadrilaterals patches in view may have in a picture of some size."""
    return max(_VIEW_QUADS, prod(size) // _PIXELS_OF_QUAD)


def _is_shadable(scene: Scene, cloth: Cloth) -> bool:
    """Return whether the sheet's shader can draw each yarn."""
    # It compares the heights of end and pick at each place, so that nothing may hide behind
    # anything else.
    if cloth.layers is not None or cloth.axis == "spline" or max(cloth.size) > LONGEST_ROW:
        return False
    if COLORINGS[scene.view.color].numbers or scene.view.look.outline:
        return False
    measures = [m for yarns in cloth.yarns for m in (yarns.diameter, np.diff(yarns.position))]
    return all(np.ptp(m) <= _ALIKE * np.mean(m) for m in measures if len(m))
