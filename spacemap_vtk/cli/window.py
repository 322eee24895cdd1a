"""The commands that show a scene live: in a window, in a browser, or in ParaView."""

from __future__ import annotations

import gc
import shlex
from typing import Annotated

from cyclopts import Parameter

from spacemap_vtk.app.requirements import require_window
from spacemap_vtk.cli import completers
from spacemap_vtk.cli.options import Set, flag
from spacemap_vtk.paraview import environment
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
    import spacemap_vtk.app.qt  # noqa: F401  before all else that imports Qt
    from spacemap_vtk.app.splash import Splash

    splash = Splash(scene)
    from spacemap_vtk.app.launch import launch

    # A frame of a drag makes some thousand small objects, and hardly any of them in cycles. With
    # Python's own thresholds a tenth of its time would go into looking at them.
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()
    launch(scene, splash.give_way_to)


def serve(
    scene: Annotated[
        str,
        Parameter(
            help="Scene file, draft, mesh, or name of a scene.",
            completer=completers.scenes_and_files,
        ),
    ] = "plain_weave",
    /,
    *,
    set_: Set = (),
    port: Annotated[int, Parameter(help="Where to listen; 0: any port that is free.")] = 0,
    host: Annotated[
        str, Parameter(help="An address of this machine that only this machine reaches.")
    ] = "127.0.0.1",
    browser: Annotated[bool, Parameter(help="Open a browser, where there is a screen.")] = True,
) -> None:
    """Show a scene in a browser: it moves, turns, and its parameters can be changed.

    Prints an address with a token, which changes at each start; who has not that gets nothing.
    Pictures are drawn here, so that the browser's machine needs no graphics, and no screen is
    needed here. Ctrl-C ends it. Needs the extra [web].

    From another machine, let ssh carry it. There:

        ssh -t -L 8080:127.0.0.1:8080 HERE spacemap serve plain_weave --port 8080

    and open the address that this prints.
    """
    from spacemap_vtk.app.web import server

    def told(address: str, once: str) -> None:
        print(address, flush=True)
        if browser:
            server.open_browser(once)

    server.serve(scene, set_, host, port, told)


def paraview(
    *,
    check: Annotated[bool, flag("Try the plugin in pvpython.")] = False,
) -> None:
    """Print how to start ParaView with the plugin, or --check it.

    The plugin's place, and the environment for it. The lines are for a shell:
    eval "$(spacemap paraview)" and then paraview.
    """
    if check:
        print(environment.check())
        return
    print(f"# plugin: {environment.PLUGIN}")
    for name, value in environment.variables().items():
        rest = f'"${{{name}:+:${name}}}"' if name == "PYTHONPATH" else ""
        print(f"export {name}={shlex.quote(value)}{rest}")
