"""The command ``serve``, which shows a scene in a browser."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from spacemap_vtk.cli import completers
from spacemap_vtk.cli.options import Motion, Set, open_scene


def serve(
    scene: Annotated[
        str,
        Parameter(
            help='Scene file, draft, mesh, or name of a built-in scene (see "spacemap scenes").',
            completer=completers.scenes_and_files,
        ),
    ] = "plain_weave",
    /,
    *,
    motion: Motion | None = None,
    set_: Set = (),
    port: Annotated[int, Parameter(help="Port to listen on; 0: any free port.")] = 0,
    host: Annotated[
        str, Parameter(help="Address to listen on, which only this machine can reach.")
    ] = "127.0.0.1",
    browser: Annotated[bool, Parameter(help="Open a browser if there is a display.")] = True,
) -> None:
    """Show a scene in a browser, with its motion and parameters.

    Prints an address with a token that changes at each start; requests without it are refused.
    The pictures are drawn by this program: the browser needs no graphics card, and this machine no
    display. Press Ctrl-C to stop. Needs the extra [web].

    To use the browser of another machine, run there:

        ssh -t -L 8080:127.0.0.1:8080 HOST spacemap serve plain_weave --port 8080

    and open the address that this command prints.
    """
    from spacemap_vtk.app.web import server

    def show(address: str, once: str) -> None:
        print(address, flush=True)
        if browser:
            server.open_browser(once)

    if motion is not None and motion.save_scene is not None:
        open_scene(scene, set_, motion)
    server.serve(scene, set_, host, port, show, None if motion is None else motion.planner)
