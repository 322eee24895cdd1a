"""Estimate the memory of pictures, and of files of moving surfaces, before any is allocated.

If a machine runs out of memory, it ends the program without a message. Therefore work that clearly
does not fit is refused. The estimates hold within a factor of two, for all versions of VTK and
OpenGL. Work that is accepted but does not fit raises Python's MemoryError, or is killed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, prod

from spacemap_vtk.errors import add_section_to_errors
from spacemap_vtk.filters.crimp_interchange import CrimpInterchange
from spacemap_vtk.memory import require_memory
from spacemap_vtk.scenes.colorings import COLORINGS
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.stage_memory import suggest_fewer

# The table: bytes for each item of a kind.

#: Once: OpenGL's libraries, compiled loops and solvers.
_PROGRAM = 200_000_000
#: Each drawn pixel, with its depth, samples, shading and position in the picture.
_PIXEL = 60
#: Each pixel of a panel that shows only a sheet, which is drawn with `SAMPLES` samples per pixel.
_SHEET_PIXEL = 80
#: Each patch at rest: control points and labels.
_PATCH = 300
#: Each patch that moves, in addition: its rest shape, its tetrahedra and their weights.
_MOVED_PATCH = 600
#: Each patch in addition, if its cage is quadratic or smooth.
_CURVED_PATCH = 1200
#: The same of a patch whose yarns exchange crimp, in any cage: only their rings lie in it.
_CRIMPED_PATCH = 1250
#: Each point of a surface in OpenGL, including the facets of that point.
DRAWN_POINT = 90
#: Each point of a surface, including OpenGL's copy.
_SURFACE_POINT = 2 * DRAWN_POINT
#: Each point of a surface that is converted to triangles with colours in a file.
_MESH_POINT = 300
#: Each point of such triangles, in the frames that are compared, and in writers.
_FRAME_POINT = 125
#: Each crossing of a sheet: its drawdown.
_CROSSING = 2
#: Each texel of a sheet: its colours in four textures.
_TEXEL = 50
#: Each crossing in addition, if clearances are measured.
_MEASURED_CROSSING = 150
#: Each crossing in addition, if the state of its yarns is solved.
_SOLVED_CROSSING = 800

# A pixel of the picture is the mean of a block of drawn pixels.

#: Width of the block with contact shadows, which know one depth for each drawn pixel. The result is
#: as good as with four OpenGL samples per drawn pixel, in a third of the time.
_BLOCK_SHADED = 2
#: Width of the block without contact shadows.
_BLOCK_PLAIN = 3
#: Width of the block for a cage's thin lines.
_BLOCK_LINES = 4
#: OpenGL samples of a drawn pixel, if it takes any: it does for lines in front of yarns.
SAMPLES = 4
#: Longest side of a picture that is drawn in the larger blocks: graphics cards limit image sizes.
_LARGE = 2048


@dataclass(frozen=True)
class PictureRequest:
    """The pictures of a scene that are to be drawn."""

    #: Width and height in pixels.
    size: tuple[int, int]
    frames: int = 1
    #: Contents of each panel: "fabric", "cage" or "both"; empty: as the scene says.
    panels: Sequence[str] = ()
    #: Whether only the edges of facets are drawn.
    wireframe: bool = False


def panel_contents(scene: Scene, show: Sequence[str] = ()) -> Sequence[str]:
    """Return the contents of a picture's panels, by default as the scene says."""
    chosen = scene.view.show if scene.moves else "fabric"
    return show or (["cage", "fabric"] if chosen == "side by side" else [chosen])


def panel_widths(width: int, panels: int) -> list[int]:
    """Return the widths of a picture's panels; the last one gets the remainder."""
    widths = [width // panels] * panels
    widths[-1] += width - sum(widths)
    return widths


def supersampling(panel: str, shaded: bool, size: tuple[int, int]) -> tuple[int, int]:
    """Return the width of the block that is drawn for a pixel, and OpenGL's samples of each."""
    if panel == "fabric" and shaded:
        return _BLOCK_SHADED, 0
    if panel != "both" and max(size) <= _LARGE:
        return (_BLOCK_PLAIN if panel == "fabric" else _BLOCK_LINES), 0
    return _BLOCK_SHADED, SAMPLES


def pixel_bytes(scene: Scene, request: PictureRequest, sheet: bool = False) -> int:
    """Return the memory of windows and pictures, of yarns or a sheet; including the program's."""
    view, panels = scene.view, panel_contents(scene, request.panels)
    shadows = (
        view.shadows
        and view.resolved_style.occlusion > 0.0
        and not COLORINGS[view.color].shows_numbers
    )
    found = _PROGRAM
    for panel, width in zip(panels, panel_widths(request.size[0], len(panels)), strict=True):
        size = width, request.size[1]
        if sheet and panel == "fabric":
            found += _SHEET_PIXEL * prod(size)
        else:
            block, _ = supersampling(panel, shadows and panel != "cage", size)
            found += _PIXEL * block**2 * prod(size)
    return found


def yarn_bytes(scene: Scene, request: PictureRequest, patches: int, sides: int) -> int:
    """Return the memory of a picture of patches with `sides` facets along each side."""
    surface = _SURFACE_POINT * patches * (sides + 1) ** 2
    return pixel_bytes(scene, request) + patch_bytes(scene, patches) + surface


def patch_bytes(scene: Scene, patches: int) -> int:
    """Return the memory of a scene's patches and of the data that move them."""
    each = _PATCH
    if scene.moves:
        curved = scene.cage.order == 2 or scene.warp.smooth
        if scene.stage("crimp") is not None:
            each += _CRIMPED_PATCH
        else:
            each += _MOVED_PATCH + _CURVED_PATCH * curved
    return each * patches


def mesh_bytes(points: int) -> int:
    """Return the memory for converting a surface to triangles with colours."""
    return _MESH_POINT * points


def frame_bytes(points: int) -> int:
    """Return the memory of the frames of a motion, in addition to its targets."""
    return _FRAME_POINT * points


def sheet_bytes(scene: Scene, request: PictureRequest, crossings: int, halvings: int) -> int:
    """Return the memory of a picture of a sheet, whose textures are halved some times."""
    measured = scene.view.color == "clearance"
    solved = COLORINGS[scene.view.color].array in CrimpInterchange.provides
    solved |= measured and scene.stage("crimp") is not None
    each = _CROSSING + _MEASURED_CROSSING * measured + _SOLVED_CROSSING * solved
    texels = crossings // 4**halvings
    return pixel_bytes(scene, request, sheet=True) + crossings * each + texels * _TEXEL


def require_pixels(scene: Scene, request: PictureRequest) -> None:
    """Refuse a picture whose pixels alone do not fit into memory."""
    what = f"a picture of {prod(request.size):,} pixels"
    require_memory(pixel_bytes(scene, request), what, key="size", cure="Reduce the size.")


def require_sheet(scene: Scene, counts: tuple[int, int], size: int) -> None:
    """Refuse a sheet of `counts` ends and picks that does not fit into memory."""
    with scene.add_file_to_errors(), add_section_to_errors("view"):
        require_memory(
            size,
            "a picture of {} x {} yarns as a sheet".format(*counts),
            key="size",
            cure="Reduce the size, or use fewer ends and picks.",
        )


def require_piece(scene: Scene, counts: tuple[int, int], patches: int, sides: int) -> None:
    """Refuse yarns of which a piece does not fit into memory; windows and the sheet exist."""
    # Twice, because the previous piece is still in memory while a piece is made.
    size = 2 * (patch_bytes(scene, patches) + _SURFACE_POINT * patches * (sides + 1) ** 2)
    with scene.add_file_to_errors(), add_section_to_errors("view"):
        require_memory(
            size,
            "a picture of {} x {} yarns in pieces".format(*counts),
            key="size",
            cure="Reduce the size, lower surface.subdivisions, or use fewer ends and picks.",
        )


def require_yarns(
    scene: Scene,
    request: PictureRequest,
    counts: tuple[int, int],
    patches: int,
    sides: int,
) -> None:
    """Refuse yarns that do not fit into memory together, and suggest numbers that do."""

    def needed(sides: int, share: float) -> int:
        return yarn_bytes(scene, request, ceil(share**2 * patches), sides)

    auto = ""
    if scene.surface.subdivisions is not None:
        auto = 'Set surface.subdivisions to "auto", so that only visible yarns are built. '

    noun = "picture" if request.frames == 1 else "film"
    with scene.add_file_to_errors(), add_section_to_errors(scene.surface.section):
        require_memory(
            needed(sides, 1.0),
            f"a {noun} of {counts[0]} x {counts[1]} yarns",
            key="subdivisions",
            value=sides,
            cure=lambda free: auto + suggest_fewer(needed, free, sides, counts),
        )
