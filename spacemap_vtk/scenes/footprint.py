"""What pictures take of memory, estimated before any is taken: a machine that lacks it kills.

All that a picture needs is alive together: the control points, what moves them, the surface and
what draws it. The figures here are of whole runs, peaks of the resident set on VTK 9.7 with
software OpenGL (Mesa 22.3): with a graphics card less is taken.
"""

from __future__ import annotations

from math import exp

from spacemap_vtk.errors import SizeError, SpacemapError, naming_section
from spacemap_vtk.fabric.weave import Counts
from spacemap_vtk.filters import barycentric_warp, crimp_interchange, patch_tessellator
from spacemap_vtk.memory import require
from spacemap_vtk.parallel import WORTHWHILE
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.scene import Scene

#: What the mapper and OpenGL hold of a quadrilateral and of a point of the surface, and what a
#: pixel takes: it is drawn as four, or lines as sixteen, and shaded.
_QUAD, _POINT, _PIXEL = 80, 25, 260
#: Software OpenGL sorts triangles into tiles ahead of the threads that fill these: it takes up to
#: so much for those that wait, and nearly all of it from some times this many quadrilaterals on. In
#: a film it comes to more than in its first picture.
_QUEUE, _QUEUE_QUADS, _QUEUE_FILM = 1.9e9, 8e6, 1.25
#: Compiled loops, and what solves.
_LOOPS, _SOLVER = 125_000_000, 25_000_000
#: Of a point that is drawn at rest, too; whose colour is a number; whose clearance is measured;
#: that is cut.
_GHOST, _NUMBER, _CLEARANCE, _CUT = 45, 8, 170, 35
#: A sheet in place of yarns: a crossing's texels, and graphics with what solves and moves it; what
#: is solved of a crossing, where that is shown; what tiles take in which clearances are measured,
#: and a crossing then.
_TEXELS, _SHEET, _MOVED, _CROSSED = 40, 167_000_000, 70_000_000, 800
_TILES, _MEASURED = 350_000_000, 240
#: What rides along with three numbers a point.
_VECTORS = ("velocity", "acceleration", "equilibrium", "linear_displacement")
#: Runs of the same picture differ by a tenth, and it is better to refuse than to be killed.
_MARGIN = 1.1


def drawing_bytes(quads: int, points: int, pixels: int = 0, frames: int = 1) -> int:
    """Return what drawing a surface takes, beside the surface itself."""
    queue = _QUEUE * (1.0 - exp(-quads / _QUEUE_QUADS)) * (_QUEUE_FILM if frames > 1 else 1.0)
    return round(_QUAD * quads + _POINT * points + _PIXEL * pixels + queue)


def picture_bytes(scene: Scene, pixels: int, frames: int = 1) -> int:
    """Return what it takes to draw the fabric of a scene, from the weave to the picture."""
    return _picture_bytes(scene, scene.weave.counts, scene.surface.sides, pixels, frames)


def _picture_bytes(scene: Scene, counts: Counts, n: int, pixels: int, frames: int) -> int:
    quads, points = counts.patches * n**2, counts.patches * (n + 1) ** 2
    warp, columns = scene.warp, 0
    if scene.moves:
        columns = 3 + _columns(warp.carried)
    total = counts.bytes(scene.weave.exact, scene.weave.single)
    total += patch_tessellator.estimate_bytes(counts.patches, n, columns)
    total += drawing_bytes(quads, points, pixels, frames)
    if points > WORTHWHILE:
        total += _LOOPS
    view = scene.view
    if scene.moves:
        nodes = 10 if scene.cage.order == 2 else 4
        total += _SOLVER
        total += barycentric_warp.estimate_bytes(
            counts.points, nodes, warp.smooth, columns - 3, scene.weave.single
        )
        if scene.stage("crimp") is not None:
            total += crimp_interchange.estimate_bytes(counts.points)
        if frames > 1:
            total += (24 if scene.weave.single else 48) * counts.points
            total += (24 + 4 * columns) * points
        total += _GHOST * points * view.ghost
    total += _NUMBER * points * COLORINGS[view.color].scaled
    total += _CLEARANCE * points * (view.color == "clearance")
    total += _CUT * points * (view.clip_normal is not None)
    return total


def fits_picture(scene: Scene, pixels: int, frames: int = 1) -> bool:
    """Return whether pictures fit into memory if all yarns are there together."""
    try:
        require_picture(scene, pixels, frames)
    except SizeError:
        return False
    return True


def require_picture(scene: Scene, pixels: int, frames: int = 1, pieces: int = 1) -> None:
    """Refuse pictures that would not fit into memory, before any is taken."""
    if scene.woven:
        with scene.naming_file():
            _require_picture(scene, pixels, frames, pieces)
    else:
        what, cure = f"a picture of {pixels:,} pixels", "Take a smaller one."
        require(round(_MARGIN * _PIXEL * pixels), what, key="size", cure=cure)


def sheet_bytes(scene: Scene, pixels: int) -> int:
    """Return what it takes to draw a scene's cloth as a sheet."""
    ends, picks = scene.weave.cloth.size
    solved = COLORINGS[scene.view.color].array in crimp_interchange.CrimpInterchange.provides
    gaps = scene.view.color == "clearance"
    solved |= gaps and scene.stage("crimp") is not None
    each = _TEXELS + _CROSSED * solved + _MEASURED * gaps
    fixed = _SHEET + _MOVED * scene.moves + _TILES * gaps
    return fixed + each * ends * picks + _PIXEL * pixels


def require_sheet(scene: Scene, pixels: int) -> None:
    """Refuse a picture of a sheet that would not fit into memory, before any is taken."""
    with scene.naming_file(), naming_section("view"):
        require(
            round(_MARGIN * sheet_bytes(scene, pixels)),
            "a picture of {} x {} yarns, as a sheet,".format(*scene.weave.cloth.size),
            key="size",
            cure="Take a smaller one, or fewer ends and picks.",
        )


def _require_picture(scene: Scene, pixels: int, frames: int, pieces: int) -> None:
    now = scene.surface.sides
    try:
        with naming_section(scene.weave.section):
            ends, picks = scene.weave.cloth.size
            counts = scene.weave.counts
    except SizeError:
        raise
    except SpacemapError:
        return  # what cannot be woven has no size; the stage says why

    def needed(subdivisions: int, share: float = 1.0) -> int:
        part = Counts(*(round(share**2 * number / pieces) for number in counts))
        return round(_MARGIN * _picture_bytes(scene, part, subdivisions, pixels, frames))

    def cure(free: int) -> str:
        share = next((k / 100 for k in range(99, 0, -1) if needed(now, k / 100) <= free), 0.01)
        few = max(1, int(share * ends)), max(1, int(share * picks))
        fewer = "use fewer ends and picks, about {} x {}".format(*few)
        for n in range(now - 1, 0, -1):
            if needed(n) <= free:
                return f"Lower surface.subdivisions to {n}, or {fewer}."
        return f"{fewer.capitalize()}."

    with naming_section(scene.surface.section):
        require(
            needed(now),
            f"a {'picture' if frames == 1 else 'film'} of {ends} x {picks} yarns",
            key="subdivisions",
            value=now,
            cure=cure,
        )


def _columns(carried: str) -> int:
    """Return how many numbers ride along at each point, at most."""
    sizes = {"von_mises": 1, "strain": 6, "stress": 6, **dict.fromkeys(_VECTORS, 3)}
    return sum(sizes.get(name, 9) for name in carried.replace(",", " ").split())
