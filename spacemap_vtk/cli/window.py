"""The command that opens the window."""

from __future__ import annotations

import gc
from typing import Annotated

from cyclopts import Parameter

from spacemap_vtk.app.requirements import require_window
from spacemap_vtk.cli import completers
from spacemap_vtk.scenes import library


def gui(
    scene: Annotated[
        str | None,
        Parameter(
            help="Scene file, draft, mesh, or name of a scene; without, the paper's.",
            completer=completers.scenes_and_files,
        ),
    ] = None,
    /,
) -> None:
    """Open the window: see a fabric move, and change everything about it."""
    if scene is not None:
        library.find(scene)
    require_window()
    # Nothing of what is imported is garbage: to look for it, now or in a drag, only takes time.
    gc.disable()
    # Qt and VTK's window take a second to import: only this command pays for it, and what will
    # come is on the screen meanwhile.
    from spacemap_vtk.app.splash import Splash

    splash = Splash(scene)
    from spacemap_vtk.app.launch import launch

    # A frame of a drag makes some thousand small objects, and hardly any of them in cycles. With
    # Python's own thresholds a tenth of its time would go into looking at them.
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()
    launch(scene, splash.give_way_to)
