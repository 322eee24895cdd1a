"""The command ``gui``, which opens the window."""

from __future__ import annotations

import gc
from typing import Annotated

from cyclopts import Parameter

from spacemap_vtk.app.requirements import require_window
from spacemap_vtk.cli import completers
from spacemap_vtk.cli.options import Motion
from spacemap_vtk.scenes import library


def gui(
    scene: Annotated[
        str | None,
        Parameter(
            help="Scene file, draft, mesh, or name of a built-in scene. Default: plain_weave.",
            completer=completers.scenes_and_files,
        ),
    ] = None,
    /,
    *,
    motion: Motion | None = None,
) -> None:
    """Open the window, to see a scene move and to change it.

    For example:

        spacemap gui
        spacemap gui cloth.wif
        spacemap gui cloth.wif --drape
    """
    if scene is not None:
        library.find(scene)
    preset = None
    if motion is not None and (name := motion.preset) is not None:
        preset = {"preset": name, "yarn": motion.yarn, "size": motion.size}
    require_window()
    # Imports leave no garbage: collecting it, now or while a slider is dragged, only takes time.
    gc.disable()
    # Qt and VTK's window take a second to import, so only this command imports them. Meanwhile a
    # splash screen shows what is loading.
    from spacemap_vtk.app.splash import Splash

    splash = Splash(scene)
    from spacemap_vtk.app.launch import launch

    # Each frame of a drag makes some thousand small objects, hardly any of them in reference
    # cycles. With Python's default thresholds the collector would take a tenth of the time.
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()
    launch(scene, splash.close_after_first_frame, preset)
