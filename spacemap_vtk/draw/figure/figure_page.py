"""Lay out a figure of a scene on a page: pictures, draft, cloth and sections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from vtkmodules.vtkRenderingCore import vtkCamera

from spacemap_vtk.draw.annotate.view_scale import ViewScale, draw_key, view_axes, view_scale
from spacemap_vtk.draw.camera import Aim, Viewpoint, aim_camera
from spacemap_vtk.draw.figure.contact_sheet import sweep_label
from spacemap_vtk.draw.figure.draft_sheet import LARGEST, draft_tile
from spacemap_vtk.draw.figure.page import PageStyle, Tile, lay_out_page
from spacemap_vtk.draw.figure.section_drawing import section_tile
from spacemap_vtk.draw.figure.sheets import period_times
from spacemap_vtk.draw.frame import camera_of
from spacemap_vtk.draw.picture import Extent, Picture, combine_extents, motion_extent
from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Floats, StepProgress
from spacemap_vtk.scenes.editable_draft import make_editable_draft
from spacemap_vtk.scenes.flat_picture import cloth_lengths
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.scene_record import scene_values
from spacemap_vtk.scenes.sweep import Run, Sweep, make_sweep
from spacemap_vtk.textile.geometry.cross_section import cut_cloth
from spacemap_vtk.units import format_quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Panels that a page can have, with their descriptions.
PANELS = {
    "pictures": "the scene at each time and with each value",
    "draft": "threading, tie-up, treadling and drawdown",
    "cloth": "the undeformed cloth from the front, next to its draft",
    "section": "the cloth cut along an end and along a pick, with Peirce's dimensions",
}
#: Largest number of pictures on a page.
_MAX_PICTURES = 60
#: Largest number of ends or picks in a draft; more would be too small to see.
_MAX_THREADS = 160
#: Least and largest height of a picture over its width.
_ASPECTS = (0.3, 1.5)
#: Height of the key below the pictures, in mm.
_KEY_HEIGHT = 9.5

#: Empty tile that fills the last row of pictures. Its height is not 0, because axes need a height.
_BLANK = Tile(lambda axes, page_style: None, lambda width: 1.0, has_letter=False)


@dataclass(frozen=True, kw_only=True)
class FigurePage(PageStyle):
    """The contents of a figure's page, and its paper."""

    #: Keys of `PANELS`. By default: pictures; for a still cloth, the other panels.
    panels: Sequence[str] = ()
    #: Times of the pictures [s]. By default: the beginning, a quarter and a half of a period.
    times: Sequence[float] = ()
    #: Swept values, ``section.key=value,value``.
    lists: Sequence[str] = ()
    #: Whether the lists are used in parallel (first values, second values, …) instead of in all
    #: combinations.
    paired: bool = False
    #: Whether the cage is drawn too, in a row above each row of pictures.
    cage: bool = False
    #: Number of pictures in a row; None: automatic.
    columns: int | None = None
    #: Number, from 1, of the end along which the cloth is cut; None: the middle one.
    end: int | None = None
    #: Number, from 1, of the pick along which the cloth is cut; None: the middle one.
    pick: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if unknown := [name for name in self.panels if name not in PANELS]:
            raise InputError(
                "unknown panel",
                key="--panels",
                value=unknown[0],
                allowed=", ".join(f"{name} ({words})" for name, words in PANELS.items()),
            )
        if self.columns is not None and self.columns < 1:
            raise InputError("columns must be at least 1", key="--columns", value=self.columns)


def make_figure(
    scene: Scene, page: FigurePage, report_progress: StepProgress = lambda *_: None
) -> Figure:
    """Return a scene's figure; with swept values, only pictures show more than the first one."""
    sweep = make_sweep(
        scene,
        scene_values(scene),
        page.lists,
        file=(scene.file or Path("scene")).absolute(),
        paired=page.paired,
        times=page.times,
    )
    sweep.check()
    if page.cage and not scene.moves:
        raise InputError(
            f"{scene.title}: this scene has no moving cage",
            key="--cage",
            cure="Omit it, or add a section [response].",
        )
    first = sweep.runs[0].scene()
    panels = page.panels
    if not panels:
        is_still_cloth = not scene.moves and scene.woven is not None and len(sweep.runs) == 1
        panels = ("draft", "cloth", "section") if is_still_cloth else ("pictures",)
    if scene.woven is None and (unavailable := [name for name in panels if name != "pictures"]):
        raise InputError(
            f"{scene.title}: this scene is not woven",
            key="--panels",
            value=unavailable[0],
            allowed="pictures",
        )
    rows: list[list[Tile]] = []
    scenes = [first]
    for name in panels:
        if name == "pictures":
            pictures = _PictureTiles(sweep, page)
            rows += pictures.rows
            scenes += pictures.scenes
            continue
        woven = first.woven
        assert woven is not None  # checked above: other panels need a woven scene
        if name == "section":
            for family, number in enumerate((page.end, page.pick)):
                yarn = None if number is None else number - 1
                rows.append([section_tile(cut_cloth(woven.cloth, family, yarn))])
        elif name == "draft" or "draft" not in panels:
            scenes.append(_cloth_scene(sweep.runs[0]))
            rows.append(
                _weave_row(
                    scenes[-1],
                    [k for k in ("draft", "cloth") if k in panels],
                    page.dark,
                    woven.cloth.size,
                )
            )
    figure = lay_out_page(rows, page, report_progress)
    for text in dict.fromkeys(text for each in scenes for text in each.warnings):
        scene.warn(text)
    return figure


def _cloth_scene(run: Run) -> Scene:
    """Return a scene with the cloth alone, cut to the ends and picks that can be seen."""
    full_scene = run.scene()
    source = full_scene.source.section
    scene = Scene({"title": full_scene.title, source: run.scene_values.get(source, {})}, run.file)
    assert scene.woven is not None
    ends, picks = scene.woven.cloth.size
    if max(ends, picks) > _MAX_THREADS:
        scene.assign(source, "ends", min(ends, _MAX_THREADS))
        scene.assign(source, "picks", min(picks, _MAX_THREADS))
        scene.warn(
            f"only the first {_MAX_THREADS} of {ends} ends and {picks} picks are drawn; "
            '"spacemap print" draws all of them, on several pages'
        )
    return scene


def _weave_row(scene: Scene, kinds: Sequence[str], dark: bool, size: tuple[int, int]) -> list[Tile]:
    """Return draft and cloth side by side, with each pick beside its row of the draft."""
    assert scene.woven is not None
    draft = make_editable_draft(scene.woven)
    ends, picks = draft.size
    sides = cloth_lengths(scene.woven.cloth)
    aspect = sides[1] / sides[0]

    def draw(axes: Axes, page_style: PageStyle) -> None:
        _match_background(scene, page_style)
        viewpoint = Viewpoint(
            (0.0, 0.0, 10 * max(sides)), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), sides[1] / 2
        )
        _draw_picture(axes, page_style, scene, 0.0, "fabric", viewpoint=viewpoint)

    # Only the first ends and picks of a large cloth are drawn.
    part = "" if (ends, picks) == size else f", of {size[0]} × {size[1]}"
    tiles = []
    if "draft" in kinds:
        mark = "light" if dark else "black"
        caption = f"Draft{part and ', first part'} ({mark}: end over pick)"
        tiles.append(draft_tile(draft, caption))
    if "cloth" in kinds:
        weight = picks / aspect
        dimensions = " × ".join(format_quantity(side, "m", 3) for side in sides)
        caption = f"Cloth, {ends} × {picks}{part}, {dimensions}"
        tiles.append(Tile(draw, lambda width: aspect * width, caption, weight, weight * LARGEST))
    return tiles


class _PictureTiles:
    """The tiles of a scene's pictures, with a common camera, colour scale and key."""

    def __init__(self, sweep: Sweep, page: FigurePage) -> None:
        self._sweep = sweep
        self.scenes = [run.scene() for run in sweep.runs]
        first = self.scenes[0]
        times = sweep.runs[0].times or self._times(first)
        pictures = list(product(range(len(self.scenes)), times))
        if len(pictures) * (1 + page.cage) > _MAX_PICTURES:
            raise InputError(
                f"{len(pictures) * (1 + page.cage)} pictures are too many for a page",
                allowed=f"up to {_MAX_PICTURES}",
                cure='Use fewer times or values; "spacemap sweep" can draw more.',
            )
        for scene in self.scenes:
            _match_background(scene, page)
        self._extent: Extent = combine_extents(
            [motion_extent(scene, times) for scene in self.scenes]
        )
        self._aspect = _aspect(self._extent[0], camera_of(first))
        shown = first.view.show if first.moves else "fabric"
        kinds = ["cage", "fabric"] if page.cage else ["fabric" if "side" in shown else shown]
        columns = page.columns or _columns(len(self.scenes), len(times))
        #: Scale and orientation of all pictures; None until the first one is drawn.
        self._scale: ViewScale | None = None
        self.rows: list[list[Tile]] = []
        for start in range(0, len(pictures), columns):
            row_pictures = pictures[start : start + columns]
            for kind in kinds:
                row = [self._tile(number, time, kind) for number, time in row_pictures]
                # Blanks keep the pictures of the last row from becoming larger than the others.
                missing = columns - len(row) if start else 0
                self.rows.append(row + [_BLANK] * missing)
        self.rows.append([self._key()])

    def _times(self, scene: Scene) -> list[float]:
        """Return the beginning, a quarter and a half of a period."""
        if not scene.moves:
            return [scene.view.time]
        times = period_times(scene)
        return [times[0], 0.5 * (times[1] + times[2]), times[3]]

    def _tile(self, number: int, time: float, kind: str) -> Tile:
        def draw(axes: Axes, page_style: PageStyle) -> None:
            scene = self.scenes[number]
            self._scale = _draw_picture(axes, page_style, scene, time, kind, extent=self._extent)

        caption = []
        run = self._sweep.runs[number]
        for k, (each, value) in enumerate(zip(self._sweep.axes, run.chosen, strict=True)):
            caption.append(f"{sweep_label(self._sweep, k)} {each.label(value)}")
        if self.scenes[number].moves:
            caption.append(f"t = {format_quantity(time, 's', 4)}")
        return Tile(draw, lambda width: self._aspect * width, ", ".join(caption))

    def _key(self) -> Tile:
        def draw(axes: Axes, page_style: PageStyle) -> None:
            assert self._scale is not None
            draw_key(axes, page_style, self._scale, self.scenes[0].view.color, self._extent[1])

        return Tile(draw, lambda width: _KEY_HEIGHT, has_letter=False)


def _match_background(scene: Scene, page_style: PageStyle) -> None:
    """Set a scene's background to the paper's colour, so that its lines contrast with the paper."""
    for key in ("background", "background_top"):
        scene.assign("view", key, page_style.color)


def _columns(runs: int, times: int) -> int:
    if runs > 1 and 1 < times <= 5:
        return times
    count = runs * times
    return count if count <= 4 else 4 if count % 4 == 0 else 3


def _aspect(points: Floats, view: Aim) -> float:
    """Return the height over the width of a picture that fits the points."""
    aspect, camera = 1.0, vtkCamera()
    for _ in range(2):
        aim_camera(camera, points, 1.0 / aspect, view, 1.0)
        points_seen = (points - camera.GetPosition()) @ view_axes(camera)
        depth = 1.0 if camera.GetParallelProjection() else -points_seen[:, 2:]
        across, above = np.ptp(points_seen[:, :2] / depth, axis=0)
        aspect = float(np.clip(above / across, *_ASPECTS))
    return aspect


def _draw_picture(
    axes: Axes, page_style: PageStyle, scene: Scene, time: float, kind: str, **camera_settings: Any
) -> ViewScale:
    """Draw a picture into a tile; return its scale and orientation."""
    (_, width), (_, height) = axes.get_xlim(), axes.get_ylim()
    size = page_style.dots(width), page_style.dots(height)
    picture = Picture(scene, [time], size, [kind], for_page=True, **camera_settings)
    image = picture.draw(time)
    camera = picture.panels[0].window.camera
    scale = view_scale(camera, height)
    picture.close()
    axes.imshow(image, extent=(0, width, 0, height), interpolation="none", aspect="auto")
    return scale
