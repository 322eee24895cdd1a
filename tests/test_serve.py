"""The command serve: the page in a browser, and requests that are refused."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import time
import types
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from browser import Page, browser

from spacemap_vtk.app.web.session import Session
from spacemap_vtk.cancel import Cancelled
from spacemap_vtk.cli.main import main
from spacemap_vtk.draw.graphics import prepare_offscreen

aiohttp = pytest.importorskip("aiohttp")
msgpack = pytest.importorskip("msgpack")
pytest.importorskip("trame")

#: Resolves when no new picture has arrived for a while.
_QUIET = """new Promise(done => {
  let last = "", since = performance.now();
  const look = () => {
    const image = document.querySelector(".picture img");
    if (image.src !== last || !image.complete || document.querySelector(".work")) {
      last = image.src;
      since = performance.now();
    }
    performance.now() - since > 330 ? done(true) : setTimeout(look, 20);
  };
  look();
})"""


@pytest.fixture(scope="module")
def opened(tmp_path_factory) -> Path:
    """Return the file in which a fake browser stores its arguments."""
    return tmp_path_factory.mktemp("browser") / "opened"


@pytest.fixture(scope="module")
def served(opened) -> Iterator[tuple[subprocess.Popen[str], str]]:
    prepare_offscreen()  # in this process, so that the tests are skipped if it cannot draw
    arguments = ["serve", "plain_weave", "--set", "surface.subdivisions=2"]
    script = opened.with_name("browser")
    script.write_text(f'#!/bin/sh\necho "$1" >"{opened}.new" && mv "{opened}.new" "{opened}"\n')
    script.chmod(0o755)
    bare = {k: v for k, v in os.environ.items() if k != "DISPLAY"}
    bare |= {"WAYLAND_DISPLAY": "none", "BROWSER": f"{script} %s"}
    process = subprocess.Popen(
        [sys.executable, "-m", "spacemap_vtk", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=bare,
    )
    assert process.stdout is not None
    try:
        yield process, process.stdout.readline().strip()
    finally:
        process.kill()
        process.communicate()


def test_requests_without_the_token_are_refused(served, opened):
    _, address = served
    while not opened.exists():
        time.sleep(0.01)
    once = opened.read_text().strip()
    assert urlsplit(address).path.strip("/") not in once
    host, token = urlsplit(address).netloc, urlsplit(address).path.strip("/")
    assert len(token) >= 32
    root, wrong = f"http://{host}/", token[:-1] + ("0" if token[-1] != "0" else "1")
    name = {"Host": "elsewhere.example:80"}
    origin = {"Origin": "http://elsewhere.example"}

    async def ask() -> None:
        async with aiohttp.ClientSession() as client:
            for path in ("", "index.html", "ws", "picture.jpg", "page/page.js", "vue.global.js"):
                for where, headers in (
                    (root + path, {}),
                    (f"{root}{wrong}/{path}", {}),
                    (address + path, name),
                    (address + path, origin),
                ):
                    async with client.get(where, headers=headers) as answer:
                        assert answer.status == 403, where
                        assert token not in await answer.text()
            for path in ("ws", f"{wrong}/ws"):
                with pytest.raises(aiohttp.WSServerHandshakeError, match="403"):
                    await client.ws_connect(root + path)
            with pytest.raises(aiohttp.WSServerHandshakeError, match="403"):
                await client.ws_connect(address + "ws", headers=origin)
            # The one-time address works once.
            for status in (302, 403):
                async with client.get(once, allow_redirects=False) as answer:
                    assert answer.status == status
            async with client.get(root + "open") as answer:
                assert answer.status == 403
            async with client.get(address) as answer:
                assert answer.status == 200
                assert "default-src 'self'" in answer.headers["Content-Security-Policy"]
            # A socket must send the token again in its first message.
            for secret, allowed in ((wrong, False), (token, True)):
                async with client.ws_connect(address + "ws") as socket:
                    hello = ("system:c0:0", "wslink.hello", [{"secret": secret}])
                    assert ("result" in await _call(socket, *hello)) == allowed
                    state = await _call(socket, "rpc:c0:1", "trame.state.get", [])
                    assert ("result" in state) == allowed

    asyncio.run(ask())


async def _call(socket, number, method, args):
    """Send a message like trame's script, and return the answer."""
    chunking = pytest.importorskip("wslink.chunking")
    message = msgpack.packb({"wslink": "1.0", "id": number, "method": method, "args": args})
    for chunk in chunking.generate_chunks(message, 0):
        await socket.send_bytes(chunk)
    heard = chunking.UnChunker()
    heard.set_max_message_size(1 << 30)
    while (found := heard.process_chunk(await socket.receive_bytes(timeout=300))) is None:
        pass
    return found


def test_used_port_and_public_address_are_refused(served, capsys):
    port = str(urlsplit(served[1]).port)
    for option, value, message in (
        ("--host", "0.0.0.0", "reachable from this machine only"),
        ("--port", port, "another program uses this port"),
        ("--port", "70000", "cannot be opened"),
    ):
        with pytest.raises(SystemExit, match="2"):
            main(["serve", "plain_weave", option, value])
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert f"{option} = " in error
        assert message in error


class _State(types.SimpleNamespace):
    """A stand-in for trame's state without a page."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None


def test_the_page_goes_to_a_saved_camera() -> None:
    camera = '{name = "hem", position = [0.1, 0, 0.2], focal_point = [0, 0, 0], height = 0.03}'

    async def ask() -> None:
        state = _State()
        session = Session("plain_weave", [f"view.cameras=[{camera}]"], state)
        work = asyncio.create_task(session.run())
        try:
            assert {"name": "hem", "label": "hem"} in state.cameras
            while session.screen.frame is None:
                await asyncio.sleep(0.002)
            session.aim("hem")
            shown = session.screen.window.camera
            assert shown.GetPosition() == (0.1, 0.0, 0.2)
            assert (shown.GetParallelProjection(), shown.GetParallelScale()) == (1, 0.015)
            session.aim("front")
            assert not shown.GetParallelProjection()
        finally:
            work.cancel()
            session.close()

    asyncio.run(ask())


def test_outdated_run_is_cancelled_for_the_newest_request(monkeypatch):
    monkeypatch.setattr("spacemap_vtk.app.web.session.CANCEL_AFTER", 0.0)

    async def ask() -> None:
        state = _State()
        session = Session("plain_weave", ["surface.subdivisions=2"], state)
        run, ran = session.pipeline.run, []

        def slow(job):
            """Run the last request; earlier ones run until they are cancelled."""
            ran.append(job.values["weave"].get("ends"))
            while ran[-1] != 5:
                time.sleep(0.002)
                if session.pipeline.token.cancelled:
                    raise Cancelled("the run was stopped")
            return run(job)

        session.pipeline.run = slow
        work = asyncio.create_task(session.run())
        try:
            while not ran:
                await asyncio.sleep(0.002)
            for ends in ("3", "4", "5"):
                session.set("weave.ends", ends)
            while session.screen.frame is None:
                await asyncio.sleep(0.002)
            assert ran == [7, 5]  # neither 3 nor 4 was started
            assert session.screen.frame.values["weave"]["ends"] == 5
            shown = session.screen.frame
            session.set("weave.ends", "6")
            while len(ran) < 3:
                await asyncio.sleep(0.002)
            session.cancel()
            while not state.failure:
                await asyncio.sleep(0.002)
            assert state.failure.startswith("The run was cancelled")
            assert session.screen.frame is shown
            # Files have no rows, and keys without a row are ignored.
            session.set("weave.draft", "/etc/passwd")
            assert session.scene.source.draft is None
        finally:
            work.cancel()
            session.close()

    asyncio.run(ask())


def test_browser_page_moves_and_follows_changes(served):
    process, address = served
    with browser(900, 600) as page:
        page.open(address)
        page.wait_until("document.querySelector('.picture img')?.naturalWidth > 500")
        first = page.screenshot()[60:500, :500]
        assert len(np.unique(first.reshape(-1, 3), axis=0)) > 500  # a cloth, not a plain background
        _play(page)
        before = _still_picture(page)
        _type(page, "weave.ends", "3")
        page.wait_until("document.getElementById('weave.ends').value === '3'")
        narrower = _changed_picture(page, before)
        _type(page, "weave.ends", "0")
        page.wait_until("document.querySelector('.bad .note') !== null")
        note = page.evaluate("document.querySelector('.bad .note').textContent")
        assert "out of range; allowed: a whole number at least 1" in note
        assert np.array_equal(_still_picture(page), narrower)
        page.drag((200, 300), (300, 250))
        while not _differ(page.screenshot()[60:500, :500], narrower):
            time.sleep(0.02)
        # The page requests only this address, and logs no errors.
        assert {a for a in page.addresses if not a.startswith((address, "data:"))} == set()
        assert page.complaints == []
        process.send_signal(signal.SIGINT)
        assert process.wait(300) == 0
        page.wait_until("document.querySelector('#closed') !== null")
    assert process.stdout is not None
    assert process.stdout.read() == ""


def _play(page: Page) -> None:
    now = "document.getElementById('now').value"
    assert page.evaluate(now) == "20 ms"
    page.click("#play")
    page.wait_until(f"{now} !== '20 ms'")
    page.click("#play")
    page.wait_until("document.getElementById('play').textContent.trim() === '▶'")


def _type(page: Page, row: str, text: str) -> None:
    page.evaluate(
        f"(line => {{ line.focus(); line.value = '{text}'; "
        f"line.dispatchEvent(new Event('change')); line.blur(); }})"
        f"(document.getElementById('{row}'))"
    )


def _still_picture(page: Page):
    """Return the picture when it no longer changes."""
    now, before = None, None
    # On a busy machine the fine picture may follow after the page has been quiet for a while.
    while before is None or not np.array_equal(now, before):
        page.evaluate(_QUIET)
        now, before = page.screenshot()[60:500, :500], now
        time.sleep(0.3)
    return now


def _changed_picture(page: Page, before):
    now = _still_picture(page)
    assert _differ(now, before)
    return now


def _differ(one, other) -> bool:
    return bool(np.mean((one != other).any(axis=2)) > 0.05)
