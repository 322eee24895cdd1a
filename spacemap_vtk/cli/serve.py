"""The command ``serve``, which shows a scene in a browser."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from spacemap_vtk.cli import completers
from spacemap_vtk.cli.options import Set


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
    """Show a scene in a browser on this machine, live.

    The scene moves, turns, and its parameters can be changed.

    Prints an address with a token, which changes at each start; who has not that gets nothing.
    Pictures are drawn here, so that the browser's machine needs no graphics, and no screen is
    needed here. Ctrl-C ends it. Needs the extra [web].

    From another machine, let ssh carry it. There:

        ssh -t -L 8080:127.0.0.1:8080 HERE spacemap serve plain_weave --port 8080

    and open the address that this prints.
    """
    from spacemap_vtk.app.web import server

    def show(address: str, once: str) -> None:
        print(address, flush=True)
        if browser:
            server.open_browser(once)

    server.serve(scene, set_, host, port, show)
