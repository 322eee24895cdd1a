"""What pictures take of memory, estimated before any is taken: a machine that lacks it kills.

All that a picture needs is alive together: the control points, what moves them, the surface and
what draws it. The figures here are of whole runs, peaks of the resident set on VTK 9.7 with
software OpenGL (Mesa 22.3): with a graphics card less is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import NamedTuple

import numpy as np

from spacemap_vtk.errors import SizeError, SpacemapError, naming_section
from spacemap_vtk.fabric.weave import Counts
from spacemap_vtk.filters import barycentric_warp, crimp_interchange, patch_tessellator
from spacemap_vtk.memory import require
from spacemap_vtk.parallel import WORTHWHILE
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.settings import View

#: A pixel of the picture is the mean of a block of drawn ones, this many wide and high. Two show
#: yarns in shadows, which know one depth for each, as well as with four of OpenGL's samples in
#: each, and in a third of the time; so do three without shadows, and four a cage's thin lines.
#: Lines before yarns are drawn with samples.
_BLOCK, _BLOCK_UNSHADED, _BLOCK_OF_LINES, SAMPLES = 2, 3, 4, 4
#: Longest side of what is drawn so large, in pixels of the picture: graphics cards know a largest.
_LARGE = 2048
#: OpenGL's libraries, and what compiles shaders; what a pixel takes that is drawn, read and made
#: part of a smaller picture; its shade; and its colour and depth once more for each sample.
_GRAPHICS, _DRAWN, _SHADE, _SAMPLE = 100_000_000, 42, 15, 8
#: What OpenGL holds of a quadrilateral: two triangles' corners, and whose they are; and of a point
#: of the surface: place and normal, once more in VTK's own copy.
_QUAD, _POINT = 40, 48
#: Software OpenGL sorts triangles into tiles, so many bytes for the two of a quadrilateral, or of
#: the one that faces away, ahead of the threads that fill these: in runs of so many bytes, of which
#: one grows, one is filled, and one may wait. Where these threads starve more do.
_SORTED, _RUN, _RUNS = 200, 37_750_000, 3
#: Compiled loops, and what solves.
_LOOPS, _SOLVER = 125_000_000, 35_000_000
#: Of a point that is drawn at rest, too; whose colour is a number; whose clearance is measured,
#: before it is drawn, but in a film; that is cut.
_GHOST, _NUMBER, _CLEARANCE, _CUT = 45, 20, 195, 35
#: What finds nearest points.
_TREES = 25_000_000
#: A sheet in place of yarns: a crossing's texels, and what makes and moves it; what is solved of a
#: crossing, where that is shown; what tiles take in which clearances are measured, and a crossing
#: then.
_TEXELS, _SHEET, _MOVED, _CROSSED = 40, 75_000_000, 70_000_000, 800
_TILES, _MEASURED = 120_000_000, 145
#: What rides along with three numbers a point.
_VECTORS = ("velocity", "acceleration", "equilibrium", "linear_displacement")
#: Runs of the same picture differ by a tenth, and it is better to refuse than to be killed.
_MARGIN = 1.1
#: What lets a cloth of any size be drawn.
_SEEN = 'Set surface.subdivisions to "auto": only what is seen is made then. '


class PictureAsked(NamedTuple):
    """What pictures are to be."""

    #: In pixels.
    size: tuple[int, int]
    frames: int = 1
    #: What each panel shows, as `panels_of` takes it.
    panels: Sequence[str] = ()
    #: Facets along each side of a patch; 0: as many as the scene says, or as are seen about.
    sides: int = 0
    #: Facets that patches near the camera have beyond these.
    near_quads: int = 0
    #: Whether yarns are so thin that nearly all is edges.
    fine: bool = False
    #: Whether control points have been made and moved, and windows opened: what is there is not
    #: asked for once more.
    begun: bool = False


def panels_of(scene: Scene, show: Sequence[str] = ()) -> Sequence[str]:
    """Return what each panel of a picture shows, by default what the scene says."""
    chosen = scene.view.show if scene.moves else "fabric"
    return show or (["cage", "fabric"] if chosen == "side by side" else [chosen])


def widths_of(width: int, panels: int) -> list[int]:
    """Return the widths of a picture's panels: the last takes what does not divide evenly."""
    widths = [width // panels] * panels
    widths[-1] += width - sum(widths)
    return widths


def grain_of(panel: str, shaded: bool, size: tuple[int, int]) -> tuple[int, int]:
    """Return how wide the block of a pixel is, and how many samples OpenGL takes in each of it."""
    if panel == "fabric" and shaded:
        return _BLOCK, 0
    if panel != "both" and max(size) <= _LARGE:
        return (_BLOCK_UNSHADED if panel == "fabric" else _BLOCK_OF_LINES), 0
    return _BLOCK, SAMPLES


def _pixel_bytes(scene: Scene, asked: PictureAsked) -> int:
    """Return what windows and the pictures in them take."""
    panels, total = panels_of(scene, asked.panels), 0
    for panel, width in zip(panels, widths_of(asked.size[0], len(panels)), strict=True):
        shaded = panel != "cage" and _is_shaded(scene.view)
        block, samples = grain_of(panel, shaded, (width, asked.size[1]))
        samples = SAMPLES if asked.fine and panel == panels[-1] else samples
        each = _DRAWN + _SHADE * shaded + _SAMPLE * samples
        total += block**2 * width * asked.size[1] * each
    return total


def _is_shaded(view: View) -> bool:
    return view.shadows and view.look.occlusion > 0.0 and not COLORINGS[view.color].numbers


def drawing_bytes(quads: int, points: int) -> int:
    """Return what OpenGL takes for a surface, beside the surface itself."""
    return _QUAD * quads + _POINT * points + min(_SORTED * quads, _RUNS * _RUN)


def picture_bytes(scene: Scene, asked: PictureAsked) -> int:
    """Return what it takes to draw the fabric of a scene, from the weave to the picture."""
    assert scene.woven is not None
    return _picture_bytes(scene, scene.woven.counts, _sides(scene, asked), asked)


def _sides(scene: Scene, asked: PictureAsked) -> int:
    """Return how many facets patches have along each side, or about how many can be seen."""
    if asked.sides or scene.surface.subdivisions:
        return asked.sides or scene.surface.sides
    assert scene.woven is not None
    cloth, scale = scene.woven.cloth, np.inf
    for yarns, threads, pixels in zip(cloth.size, cloth.threads, asked.size, strict=True):
        width = float(np.max(threads.diameter)) * threads.aspect
        scale = min(scale, pixels / (yarns * threads.mean_spacing(width)))
    thickest = max(float(np.max(threads.diameter)) for threads in cloth.threads)
    return patch_tessellator.sides_seen(scale * scene.view.zoom * thickest)


def _picture_bytes(scene: Scene, counts: Counts, n: int, asked: PictureAsked) -> int:
    # As patches of the most facets that all may have.
    most = patch_tessellator.MOST_SIDES
    near = -(-asked.near_quads // most**2)
    quads = counts.patches * n**2 + near * most**2
    points = counts.patches * (n + 1) ** 2 + near * (most + 1) ** 2
    view, films = scene.view, asked.frames > 1
    columns = 3 + _columns(scene.warp.carried) if scene.moves else 0
    total = patch_tessellator.estimate_bytes(counts.patches, n, columns)
    total += patch_tessellator.estimate_bytes(near, most, columns)
    if scene.moves and films:
        total += (24 + 4 * columns) * points
    if not asked.begun:
        total += _GRAPHICS + _LOOPS * (points > WORTHWHILE)
        total += _moved_bytes(scene, counts, columns, films)
    drawn = _pixel_bytes(scene, asked) + drawing_bytes(quads, points)
    drawn += _GHOST * points * view.ghost + _CUT * points * (view.clip_normal is not None)
    drawn += _NUMBER * points * COLORINGS[view.color].numbers
    if view.color != "clearance":
        return total + drawn
    measured = _TREES + _CLEARANCE * points
    return total + (drawn + measured if films else max(drawn, measured))


def _moved_bytes(scene: Scene, counts: Counts, columns: int, films: bool) -> int:
    """Return what control points take, and what moves them."""
    assert scene.woven is not None
    warp, single = scene.warp, scene.woven.single
    total = counts.bytes(scene.woven.cloth.exact, single)
    if scene.moves:
        nodes = 10 if scene.cage.order == 2 else 4
        total += _SOLVER + (24 if single else 48) * counts.points * films
        total += barycentric_warp.estimate_bytes(
            counts.points, nodes, warp.smooth, columns - 3, single
        )
        if scene.stage("crimp") is not None:
            total += crimp_interchange.estimate_bytes(counts.points)
    return total


def fits_picture(scene: Scene, asked: PictureAsked) -> bool:
    """Return whether pictures fit into memory if all yarns are there together."""
    try:
        require_picture(scene, asked)
    except SizeError:
        return False
    return True


def require_picture(scene: Scene, asked: PictureAsked, pieces: int = 1) -> None:
    """Refuse pictures that would not fit into memory, before any is taken."""
    if scene.woven is not None:
        with scene.naming_file():
            _require_picture(scene, asked, pieces)
    else:
        size = _GRAPHICS + _pixel_bytes(scene, asked)
        what = f"a picture of {prod(asked.size):,} pixels"
        require(round(_MARGIN * size), what, key="size", cure="Take a smaller one.")


def sheet_bytes(scene: Scene, asked: PictureAsked) -> int:
    """Return what it takes to draw a scene's cloth as a sheet."""
    assert scene.woven is not None
    ends, picks = scene.woven.cloth.size
    solved = COLORINGS[scene.view.color].array in crimp_interchange.CrimpInterchange.provides
    gaps = scene.view.color == "clearance"
    solved |= gaps and scene.stage("crimp") is not None
    each = _TEXELS + _CROSSED * solved + _MEASURED * gaps
    fixed = _SHEET + _MOVED * scene.moves + _TILES * gaps
    pixels = _pixel_bytes(scene, asked._replace(fine=True))
    return _GRAPHICS + fixed + each * ends * picks + pixels


def require_sheet(scene: Scene, asked: PictureAsked) -> None:
    """Refuse a picture of a sheet that would not fit into memory, before any is taken."""
    assert scene.woven is not None
    with scene.naming_file(), naming_section("view"):
        require(
            round(_MARGIN * sheet_bytes(scene, asked)),
            "a picture of {} x {} yarns, as a sheet,".format(*scene.woven.cloth.size),
            key="size",
            cure="Take a smaller one, or fewer ends and picks.",
        )


def _require_picture(scene: Scene, asked: PictureAsked, pieces: int) -> None:
    seen = _SEEN if scene.surface.subdivisions else ""
    woven = scene.woven
    assert woven is not None
    try:
        with naming_section(scene.source.section):
            ends, picks = woven.cloth.size
            counts = woven.counts
            now = _sides(scene, asked)
    except SizeError as error:
        error.cure = f"{seen}{error.cure}"
        raise
    except SpacemapError:
        return  # what cannot be woven has no size; the stage says why

    def needed(subdivisions: int, share: float = 1.0) -> int:
        part = Counts(*(round(share**2 * number / pieces) for number in counts))
        return round(_MARGIN * _picture_bytes(scene, part, subdivisions, asked))

    def cure(free: int) -> str:
        share = next((k / 100 for k in range(99, 0, -1) if needed(now, k / 100) <= free), 0.01)
        few = max(1, int(share * ends)), max(1, int(share * picks))
        fewer = "use fewer ends and picks, about {} x {}".format(*few)
        for n in range(now - 1, 0, -1):
            if needed(n) <= free:
                return f"{seen}Lower surface.subdivisions to {n}, or {fewer}."
        return f"{seen}{fewer.capitalize()}."

    with naming_section(scene.surface.section):
        require(
            needed(now),
            f"a {'picture' if asked.frames == 1 else 'film'} of {ends} x {picks} yarns",
            key="subdivisions",
            value=now,
            cure=cure,
        )


def _columns(carried: str) -> int:
    """Return how many numbers ride along at each point, at most."""
    sizes = {"von_mises": 1, "strain": 6, "stress": 6, **dict.fromkeys(_VECTORS, 3)}
    return sum(sizes.get(name, 9) for name in carried.replace(",", " ").split())
