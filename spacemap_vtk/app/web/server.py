"""Serve a scene with trame to browsers on this machine, protected by a token.

- All resources are below ``/TOKEN/``. wslink requires the token again in the first message of a
  socket.
- A request for a host name that is not this machine's is refused (DNS rebinding), and so is a
  socket that another page opens.
- The page may load nothing from other hosts.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import ipaddress
import os
import re
import secrets
import signal
import socket
import sys
import threading
import webbrowser
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit

from spacemap_vtk.app.requirements import require_packages
from spacemap_vtk.app.web import uploads
from spacemap_vtk.app.web.session import TIME_STEPS, Session
from spacemap_vtk.draw import thumbnails
from spacemap_vtk.errors import InputError, SizeError, SpacemapError
from spacemap_vtk.scenes.presets import Plan
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.temporary_files import END_SIGNALS

#: Packages of the extra ``[web]``, by their import names.
PACKAGES = ("trame", "trame_client", "aiohttp")
_HEADERS = {
    # Vue compiles the page's templates to functions, which needs "unsafe-eval".
    "Content-Security-Policy": "default-src 'self' 'unsafe-inline' 'unsafe-eval'; "
    "img-src 'self' data: blob:; frame-ancestors 'none'; base-uri 'self'; form-action 'none'",
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
}
_REFUSED = "Refused: open the complete address that the program printed, including the token.\n"
_HERE = Path(__file__).parent
#: Least and largest side of a saved picture, and most pixels.
_MIN_SIDE = 64
_MAX_SIDE = 8192
_MAX_PIXELS = 34_000_000


def serve(
    name: str,
    assignments: Sequence[str],
    host: str,
    port: int,
    on_ready: Callable[[str, str], object],
    preset: Callable[[Scene], Plan] | None = None,
) -> None:
    """Serve a scene until Ctrl-C; `on_ready` receives the address and a one-time address."""
    require_local(host)
    require_free_port(host, port)
    require_packages("the page in a browser", PACKAGES, "web")
    asyncio.run(_serve(name, assignments, host, port, on_ready, preset))


def require_local(host: str) -> None:
    """Raise an error for an address that other machines can reach."""
    if _is_local(host):
        return
    raise InputError(
        "the address must be reachable from this machine only",
        key="--host",
        value=host,
        allowed="127.0.0.1, ::1 or localhost",
        cure='From another machine, use "ssh -t -L 8080:127.0.0.1:8080 HOST" and --port 8080.',
    )


async def _serve(
    name: str,
    assignments: Sequence[str],
    host: str,
    port: int,
    on_ready: Callable[[str, str], object],
    preset: Callable[[Scene], Plan] | None,
) -> None:
    from trame.app import get_server

    # In lower case, because trame's script converts the address of the socket to lower case.
    token = secrets.token_hex(24)
    # One-time tickets: all users of this machine can read the command line of a browser, which
    # must not contain the token.
    tickets = [secrets.token_hex(16)]
    server: Any = get_server("spacemap", client_type="vue3")
    session = Session(name, assignments, server.state, preset)
    try:
        _set_up_page(server, session, token)
        server.controller.on_server_bind.add(
            lambda web: _add_guard(web.app, session, token, tickets)
        )
        work = asyncio.create_task(session.run())
        served = asyncio.create_task(_run_server(server, host, port, token))
        ended = _end_signal()
        await asyncio.wait([served, server.ready], return_when=asyncio.FIRST_COMPLETED)
        if served.done():
            served.result()  # raises the error of the server
        at = f"[{host}]" if ":" in host else host
        root = f"http://{at}:{server.port}"
        on_ready(f"{root}/{token}/", f"{root}/open/{tickets[0]}")
        await asyncio.wait([ended, served, work], return_when=asyncio.FIRST_COMPLETED)
        if work.done():
            work.result()
        work.cancel()
        await server.stop()
        await served
    finally:
        session.close()


def _set_up_page(server: Any, session: Session, token: str) -> None:
    """Give the server its page and the functions that the page can call."""
    from trame_client.module import vue3

    server.enable_module(vue3)
    server.enable_module(
        {
            "scripts": ["page/page.js"],
            "styles": ["page/page.css"],
            "vue_use": ["spacemap"],
            "serve": {
                "page": str(_HERE / "page"),
                "thumbnails": str(thumbnails.file_of("").parent),
            },
        }
    )
    # Put everything below the token. Longer names come first, because they are matched first.
    server.serve = {f"{token}/{name}": folder for name, folder in server.serve.items()}
    server.serve[token] = vue3.www
    state = server.state
    state.trame__favicon = "page/icon.svg"
    state.trame__template_main = (_HERE / "page" / "page.html").read_text(encoding="utf-8")
    state.trame__template_error = (_HERE / "page" / "closed.html").read_text(encoding="utf-8")
    state.time_steps = TIME_STEPS
    state.file_endings, state.max_bytes = uploads.endings(), uploads.MAX_BYTES
    for name in (
        *("set", "switch", "slide", "reset", "color", "seek", "go", "play", "cancel"),
        *("resize", "aim", "steer", "preset", "pattern", "undo", "redo", "open"),
    ):
        server.trigger(name)(getattr(session, name))


def _add_guard(app: Any, session: Session, token: str, tickets: list[str]) -> None:
    """Accept only requests with the token and with a host name of this machine."""
    from aiohttp import web
    from trame_client.module import vue3

    @web.middleware
    async def guarded(request: Any, handler: Any) -> Any:
        _, first, *rest = request.path.split("/")
        origin = request.headers.get("Origin")
        is_same_origin = origin is None or urlsplit(origin).netloc == request.host
        has_token = secrets.compare_digest(first.encode(), token.encode())
        given = "/".join(rest).encode()
        ticket = first == "open" and any(
            secrets.compare_digest(given, valid.encode()) for valid in tickets
        )
        name = urlsplit(f"//{request.host}").hostname or ""
        if not (is_same_origin and (has_token or ticket) and _is_local(name)):
            raise web.HTTPForbidden(text=_REFUSED, headers=_HEADERS)
        if ticket:
            tickets.clear()  # valid only once
        if ticket or not rest:
            raise web.HTTPFound(f"/{token}/", headers=_HEADERS)
        response = await handler(request)
        if not response.prepared:
            response.headers.update(_HEADERS)
        return response

    async def picture(_request: Any) -> Any:
        data = session.screen.picture
        session.fetched.set()
        return web.Response(body=data, content_type="image/jpeg")

    async def picture_file(request: Any) -> Any:
        try:
            size = _read_size(request.query)
            data = await session.save_picture(size)
        except SpacemapError as error:
            return web.Response(status=409, text=error.text_for_window)
        name = re.sub(r"[^\w.-]+", "_", session.scene.title).strip("_") or "picture"
        return web.Response(
            body=data,
            content_type="image/png",
            headers={"Content-Disposition": f"attachment; filename*=UTF-8''{quote(name)}.png"},
        )

    async def upload(request: Any) -> Any:
        name, data = request.query.get("name", ""), bytearray()
        try:
            name = session.uploads.check_name(name)
            async for part in request.content.iter_any():
                data += part
                if len(data) > uploads.MAX_BYTES:
                    raise uploads.too_large_error(name)
            session.open_file(session.uploads.save(name, bytes(data)))
        except SpacemapError as error:
            return web.Response(
                status=413 if isinstance(error, SizeError) else 415, text=str(error)
            )
        return web.Response(status=204)

    async def page(_request: Any) -> Any:
        return web.FileResponse(Path(vue3.www) / "index.html")

    async def launcher(_request: Any) -> Any:
        # trame's script asks here for the address of its socket; otherwise these data would have
        # to be in the page's address.
        return web.json_response({"sessionURL": f"ws://USE_HOST/{token}/ws", "secret": token})

    app.middlewares.append(guarded)
    app.router.add_get(f"/{token}/", page)
    app.router.add_post(f"/{token}/paraview/", launcher)
    app.router.add_get(f"/{token}/picture.jpg", picture)
    app.router.add_get(f"/{token}/picture.png", picture_file)
    app.router.add_post(f"/{token}/upload", upload)


def _read_size(query: Mapping[str, str]) -> tuple[int, int] | None:
    """Return the size that a request asks for, in pixels; None for that of the page."""
    if not query:
        return None
    width, height = (query.get(key, "") for key in ("width", "height"))
    sides = [int(side) if re.fullmatch(r"\d{1,5}", side) else 0 for side in (width, height)]
    if min(sides) < _MIN_SIDE or max(sides) > _MAX_SIDE or sides[0] * sides[1] > _MAX_PIXELS:
        raise InputError(
            "the picture cannot have this size",
            key="size",
            value=f"{width} x {height}",
            allowed=f"sides from {_MIN_SIDE} to {_MAX_SIDE} pixels, "
            f"together at most {_MAX_PIXELS // 10**6} million pixels",
        )
    return sides[0], sides[1]


def _is_local(name: str) -> bool:
    with contextlib.suppress(ValueError):
        return name == "localhost" or ipaddress.ip_address(name).is_loopback
    return False


async def _run_server(server: Any, host: str, port: int, token: str) -> None:
    """Serve until the server is stopped."""
    # trame parses the command line, whose options have the same names as some of trame's.
    server.cli.set_defaults(
        ws=f"{token}/ws", authKey=token, host=host, nosignalhandlers=True, server=True
    )
    arguments, sys.argv = sys.argv, sys.argv[:1]
    try:
        running = server.start(
            port=port,
            host=host,
            timeout=0,
            exec_mode="coroutine",
            open_browser=False,
            show_connection_info=False,
            disable_logging=True,
        )
    finally:
        sys.argv = arguments
    await running


def require_free_port(host: str, port: int) -> None:
    """Raise an error if a port is not available, before any other work."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        # As the server does: otherwise the port of a server that has just ended is blocked for a
        # minute.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, os.name == "posix")
        try:
            probe.bind((host, port))
        except (OSError, OverflowError) as error:
            in_use = getattr(error, "errno", 0) == errno.EADDRINUSE
            raise InputError(
                "another program uses this port"
                if in_use
                else f"the port cannot be opened ({error})",
                key="--port",
                value=port,
                cure="Choose another port, or omit it to use a free one.",
            ) from None


def _end_signal() -> asyncio.Future[None]:
    """Return a future that is done when a signal ends the program."""
    loop = asyncio.get_running_loop()
    ended: asyncio.Future[None] = loop.create_future()

    def end() -> None:
        if not ended.done():
            ended.set_result(None)

    with contextlib.suppress(NotImplementedError):  # on Windows Ctrl-C raises KeyboardInterrupt
        for number in (signal.SIGINT, *END_SIGNALS):
            loop.add_signal_handler(number, end)
    return ended


def open_browser(address: str) -> None:
    """Open the user's browser, if there is a screen for one."""
    if sys.platform.startswith("linux") and not {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
        return
    # In a thread, because for some browsers `webbrowser.open` waits until they are closed.
    threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
