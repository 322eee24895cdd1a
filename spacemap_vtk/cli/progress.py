"""Progress on anything that takes over a second, on stderr and only for people."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from spacemap_vtk.filters.base import Stage
    from spacemap_vtk.scenes.scene import Scene

#: Seconds before a bar appears.
_PATIENCE = 1.0


@contextmanager
def progress(scene: Scene | None, what: str, quiet: bool) -> Iterator[Callable[[int, int], object]]:
    """Show a bar while a scene is worked on, and the running stage beside it."""
    if quiet or not sys.stderr.isatty():
        yield lambda done, of: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("[dim]{task.fields[stage]}"),
        console=Console(stderr=True),
        transient=True,
    )
    task = bar.add_task(what, total=1, stage="")

    def tell(stage: Stage, event: str) -> None:
        words = [type(stage).__name__]
        if event == "ProgressEvent":
            words += [stage.GetProgressText() or "", f"{stage.GetProgress():.0%}"]
        bar.update(task, stage="" if event == "EndEvent" else " ".join(filter(None, words)))

    observers = [
        (stage, stage.AddObserver(event, tell))
        for stage in (scene.stages if scene else ())
        for event in ("StartEvent", "ProgressEvent", "EndEvent")
    ]
    timer = threading.Timer(_PATIENCE, bar.start)
    timer.daemon = True
    timer.start()
    try:
        yield lambda done, of: bar.update(task, completed=done, total=of)
    finally:
        timer.cancel()
        bar.stop()
        for stage, observer in observers:
            stage.RemoveObserver(observer)
