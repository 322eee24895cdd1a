"""A scene's data as the writers of files take them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from spacemap_vtk.io.registry import Writer

if TYPE_CHECKING:
    from spacemap_vtk.scenes.scene import Scene


def times_of(scene: Scene, writer: Writer, time: float) -> list[float]:
    """Return the times that a file holds: those of all frames of the film, or one."""
    return scene.animation.frame_times() if writer.times and scene.moves else [time]


def content(
    scene: Scene, kind: str, writer: Writer, times: list[float], tell: Callable[[int], None]
) -> Any:
    """Return what a writer takes of a scene; `tell` is told how many times are done."""
    if writer.times:
        return _steps(scene, kind, times, tell)
    if kind != "draft":  # which needs no room for its yarns
        scene.update(times[0])
    tell(1)
    return scene.data(kind)


def _steps(
    scene: Scene, kind: str, times: list[float], tell: Callable[[int], None]
) -> Iterator[tuple[float, Any]]:
    # One after another: all together need not fit into memory.
    for done, time in enumerate(times, 1):
        if kind != "draft":
            scene.update(time)
        yield time, scene.data(kind)
        tell(done)
