"""A scene's data as files have them: at a time, at the times of a series, piece by piece."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from spacemap_vtk.errors import InputError
from spacemap_vtk.scenes.colorings import COLORINGS

if TYPE_CHECKING:
    from spacemap_vtk.draw.surface_actor import Span
    from spacemap_vtk.ndarrays import Tell
    from spacemap_vtk.scenes.scene import Scene

#: Data that are one moment of what moves.
MOMENTS = ("painted", "yarns")


def data_at(
    scene: Scene, what: str, time: float, tolerance: float | None, span: Span | None = None
) -> Any:
    """Return what is a key of `spacemap_vtk.io.registry.DATA`, at a time."""
    moved = scene.stage("warp") or scene.source  # without a surface, which takes most
    if what == "yarns":
        from spacemap_vtk.draw.seen_yarns import SeenYarns

        scene.update_stage(moved, time)
        seen = SeenYarns(scene, 1)
        seen.see(0)
        return seen.curves
    if what in ("moving", "painted"):
        from spacemap_vtk.draw.moving import moving

        # a .ply, unlike a .glb, has the facets that the scene asks for
        sides = 0 if what == "moving" else None
        return moving(scene, [time], tolerance, lambda *_: None, span, sides=sides)
    if what in ("draft", "analysis"):  # a draft needs no room for its yarns
        return scene.data(what)
    from spacemap_vtk.datasets.arrays import copied

    # Of a cage nothing below it is needed.
    last = moved if what == "patches" else scene.stages[-1]
    scene.update_stage(scene.deforming if what == "cage" else last, time)
    data = copied(scene.data(what))  # what the pipeline has it would take for up to date
    if scene.moves:
        data.GetInformation().Set(data.DATA_TIME_STEP(), time)  # VTK's formats tell it
    return data


def moments(scene: Scene, times: Sequence[float]) -> Sequence[float]:
    """Return the times of what lasts: those that are ordered, or of the scene's film."""
    if not times:
        return scene.animation.frame_times() if scene.moves else [scene.view.time]
    if len(times) > 1 and not scene.moves:
        raise InputError(
            "this scene does not move: it is the same at all of them",
            key="times",
            cure="Add a section [response], or leave them out.",
        )
    for before, after in pairwise(times):
        if not before < after:
            raise InputError(
                f"{after:g} s follows {before:g} s", key="times", allowed="times that ascend"
            )
    return times


def common_scale(scene: Scene, what: str, times: Sequence[float]) -> Span | None:
    """Return the ends of the scale that the colours of all files have, where there is one."""
    if what not in ("moving", "painted") or not COLORINGS[scene.view.color].numbers:
        return None
    from spacemap_vtk.draw.picture import over_motion

    return over_motion(scene, times)[1]


def pieces_of(scene: Scene, what: str, time: float, count: int, tell: Tell) -> Iterator[Any]:
    """Yield the pieces of a surface or of patches, each made when it is asked for."""
    from spacemap_vtk.datasets.processes import WHOLE, Piece
    from spacemap_vtk.filters.algorithm import PIECE

    try:
        for number in range(count):
            tell(number, count)
            scene.update(time, Piece(number, count))
            yield scene.data(what)
        tell(count, count)
    finally:
        for key, value in zip(PIECE, WHOLE, strict=True):  # for whoever updates the scene next
            scene.stages[-1].GetOutputInformation(0).Set(key, value)
