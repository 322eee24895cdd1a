"""The command serve: the page in a browser, and requests that are refused."""

from __future__ import annotations

import asyncio
import base64
import io
import json
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
from PIL import Image

from spacemap_vtk.app.web.history import History, Opened, Version
from spacemap_vtk.app.web.session import Session
from spacemap_vtk.app.web.uploads import MAX_BYTES, Uploads
from spacemap_vtk.cancel import Cancelled
from spacemap_vtk.cli.main import main
from spacemap_vtk.draw.graphics import prepare_offscreen
from spacemap_vtk.errors import InputError, SizeError
from spacemap_vtk.scenes import library

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


#: The picture on the page, as it was sent.
_AS_BASE64 = """fetch(document.querySelector(".picture img").src)
  .then(answer => answer.blob())
  .then(blob => new Promise(done => {
    const reader = new FileReader();
    reader.onload = () => done(reader.result.split(",")[1]);
    reader.readAsDataURL(blob);
  }))"""
#: Names of elements that a narrow page would cut off.
_OUTSIDE = """[...document.querySelectorAll("header, header > *, main, footer > *, aside")]
  .filter(each => { const box = each.getBoundingClientRect();
    return box.width && (box.left < 0 || box.right > innerWidth + 0.5); })
  .map(each => each.id || each.tagName)"""


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
            paths = "", "index.html", "ws", "picture.jpg", "page/page.js", "vue.global.js"
            for path in (*paths, "picture.png", "thumbnails/tartan.jpg", "upload"):
                for where, headers in (
                    (root + path, {}),
                    (f"{root}{wrong}/{path}", {}),
                    (address + path, name),
                    (address + path, origin),
                ):
                    send = client.post if path == "upload" else client.get
                    async with send(where, headers=headers) as answer:
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


def test_drag_makes_one_step_of_the_history() -> None:
    opened = Opened(0, None, "Cloth", ("plain", None))
    history = History(Version({"weave": {"ends": 7}}, opened))
    for ends in (7, 8, 9):  # the first value of this drag changes nothing
        history.add(Version({"weave": {"ends": ends}}, opened), "Ends", dragging=True)
    history.add(Version({"weave": {"ends": 10}}, opened), "Ends")
    history.add(Version({"weave": {"ends": 11}}, opened), "Ends")
    shown = []
    for step in (history.undo, history.undo, history.undo, history.redo):
        step()
        shown.append(history.version.values["weave"]["ends"])
    assert shown == [10, 7, 7, 10]
    assert (history.undo_name, history.redo_name) == ("Ends", "Ends")
    history.add(Version({"weave": {"ends": 3}}, opened), "Ends")
    assert history.redo_name == ""


def test_patterns_scenes_and_presets_are_undone() -> None:
    async def ask() -> None:
        state = _State()
        session = Session("plain_weave", ["surface.subdivisions=2"], state)
        work = asyncio.create_task(session.run())

        async def until(title: str) -> None:
            while state.title != title:
                assert not work.done()
                await asyncio.sleep(0.002)

        plain = "Plain weave 7 x 7, hung by its top edge"
        try:
            session.pattern("twill 2/2")
            await until("Twill 2/2")
            assert state.trame__title == "Twill 2/2 – spacemap"
            session.pattern("drafts/houndstooth.wif")
            await until("Houndstooth")
            assert session.scene.draft_file == library.folder() / "drafts" / "houndstooth.wif"
            session.set("weave.pattern", "satin 5/2")  # replaces the draft, too
            await until("Satin 5/2")
            assert session.scene.draft_file is None
            session.preset("swing")
            await until("Satin 5/2: swing from edge")
            (note,) = [text for text in session._opened.warnings if "cotton" in text]
            assert "Warp yarn" in note
            assert "--yarn" not in note  # the page has no options
            assert session.scene.parts["modal"].gravity is not None
            session.pattern("twill 2/1")
            await until("Twill 2/1: swing from edge")
            session.pattern("../secret.wif")
            session.open("/etc/passwd")
            session.open("twill_2_2")
            twill = "2/2 twill, 30 tex cotton, 24 x 22 to the centimetre"
            await until(twill)
            session.preset("nonsense")
            back = ["Twill 2/1: swing from edge", "Satin 5/2: swing from edge", "Satin 5/2"]
            back += ["Houndstooth", "Twill 2/2", plain]
            for title in back:
                session.undo()
                assert state.title == title
            assert (state.undo, state.redo) == ("", "Weave source: Pattern")
            for _ in back:
                session.redo()
            assert (state.title, session.scene.source.pattern) == (twill, "twill 2/2")
            session.cancel()
            while session._is_busy:
                await asyncio.sleep(0.002)
        finally:
            work.cancel()
            session.close()

    asyncio.run(ask())


def test_refused_scene_keeps_the_picture_and_says_so(tmp_path: Path) -> None:
    file = tmp_path / "large.toml"
    file.write_text(
        "[weave]\nends = 60\npicks = 60\nwarp_spacing = 1e-3\nweft_spacing = 1e-3\n"
        "[cage]\ndivisions = [6, 6, 1]\n[response]\nalpha = 2.0\n[view]\ntime = 1.0\n"
    )

    async def ask() -> None:
        state = _State()
        session = Session("plain_weave", ["surface.subdivisions=2"], state)
        work = asyncio.create_task(session.run())
        try:
            while session.screen.frame is None:
                await asyncio.sleep(0.002)
            shown, state.warnings = session.screen.frame, ["of the former scene"]
            session.open_file(file)
            while not state.failure:
                assert not work.done()
                await asyncio.sleep(0.002)
            assert session.screen.frame is shown
            assert "Choose Cloth > Hang as curtain" in state.failure
            assert "--hang" not in state.failure
            assert state.failure.endswith("The picture shows the former scene.")
            assert "of the former scene" not in state.warnings
        finally:
            work.cancel()
            session.close()

    asyncio.run(ask())


def test_only_drafts_and_knits_can_be_sent() -> None:
    files = Uploads()
    data = (library.folder() / "drafts" / "overshot.wif").read_bytes()
    path = files.save("C:\\drafts\\../my <draft>.WIF", data)
    assert (path.name, path.read_bytes()) == ("my _draft_.wif", data)
    assert files.save("my <draft>.wif", b"another") != path
    for name in ("scene.toml", "mesh.vtu", "picture.png", ".wif", ""):
        with pytest.raises(InputError, match="only drafts and machine knitting files"):
            files.save(name, data)
    with pytest.raises(SizeError, match="too large"):
        files.save("a.wif", bytes(MAX_BYTES + 1))
    files.close()
    assert not path.exists()


def test_page_undoes_patterns_and_saves_the_picture(served, tmp_path):
    _, address = served
    with browser(900, 600) as page:
        page.open(address)
        page.wait_until("document.querySelector('.picture img')?.naturalWidth > 500")
        plain = page.evaluate("document.title")
        assert plain == "Plain weave 7 x 7, hung by its top edge – spacemap"
        first = _still_picture(page)
        page.click('.patterns [data-name="twill 2/2"]')
        page.wait_until("document.title === 'Twill 2/2 – spacemap'")
        page.wait_until("document.querySelectorAll('.weave rect').length === 16")
        twill = _changed_picture(page, first)
        # One square: the end no longer lies on top there.
        page.evaluate("document.querySelector('.weave rect').dispatchEvent(new Event('click'))")
        page.wait_until("document.title === 'Weave of 4 ends and 4 picks – spacemap'")
        page.press("z", modifiers=2)
        page.wait_until("document.title === 'Twill 2/2 – spacemap'")
        page.click("#undo")
        page.wait_until(f"document.title === {plain!r}")
        page.wait_until("document.getElementById('undo').disabled")
        page.press("Z", modifiers=10)
        page.wait_until("document.title === 'Twill 2/2 – spacemap'")
        assert np.array_equal(_still_picture(page), twill)

        # The saved picture is the one on the page.
        page.send("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
        shown = page.evaluate(_AS_BASE64)
        page.click("#picture")
        page.click("#save .main")
        file = tmp_path / "Twill_2_2.png"
        while not file.exists():
            time.sleep(0.02)
        page.wait_until("!document.querySelector('#save').open")
        with Image.open(file) as saved, Image.open(io.BytesIO(base64.b64decode(shown))) as jpeg:
            assert saved.size == jpeg.size
            both = [np.asarray(image.convert("RGB"), float) for image in (saved, jpeg)]
        assert abs(both[0] - both[1]).mean() < 2.0  # of 255
        assert both[0].std() > 20.0
        taller = page.evaluate(
            "fetch('picture.png?width=300&height=500').then(a => a.blob()).then(createImageBitmap)"
            ".then(image => [image.width, image.height])"
        )
        assert taller == [300, 500]
        status = "fetch('picture.png?width={}&height=500').then(answer => answer.status)"
        assert [page.evaluate(status.format(side)) for side in ("9", "9000", "x")] == [409] * 3
        for width in (1000, 1280, 1600, 390):
            page.show_as(width, 800)
            page.wait_until(f"innerWidth === {width}")
            assert page.evaluate(_OUTSIDE) == []
        page.show_as(900, 600)
        page.click("#undo")
        page.wait_until(f"document.title === {plain!r}")


@pytest.mark.nightly
def test_page_opens_scenes_and_drafts(served):
    _, address = served
    with browser(1280, 800) as page:
        page.open(address)
        page.wait_until("document.querySelector('.picture img')?.naturalWidth > 500")
        plain, first = page.evaluate("document.title"), _still_picture(page)
        # The gallery: a search, and a click.
        page.click("#scenes")
        groups = "[...document.querySelectorAll('#gallery h3')].map(each => each.textContent)"
        assert page.evaluate(groups) == [k for k, names in library.names_by_kind().items() if names]
        _search(page, "flat filament")
        page.wait_until("document.querySelectorAll('#gallery .choice').length === 1")
        page.wait_until("document.querySelector('#gallery img').naturalWidth === 480")
        page.click("#gallery .choice")
        page.wait_until("document.title.startsWith('8-end satin')")
        satin = _changed_picture(page, first)

        # Drafts that are sent.
        _send(page, "broken.wif", "no draft")
        page.wait_until("document.querySelector('.failure') !== null")
        failure = page.evaluate("document.querySelector('.failure').textContent")
        assert "no section of a draft" in failure
        assert "/" not in failure
        _send(page, "scene.toml", "title = 1")
        page.wait_until("document.querySelector('#gallery .message') !== null")
        refused = page.evaluate("document.querySelector('#gallery .message').textContent")
        assert "only drafts and machine knitting files" in refused
        text = (library.folder() / "drafts" / "apron.wif").read_text("latin-1")
        _send(page, "My apron.wif", text)
        page.wait_until("document.title === 'My apron – spacemap'")
        _changed_picture(page, satin)
        allowed = (address, "data:", "blob:")
        assert [each for each in page.addresses if not each.startswith(allowed)] == []
        # The browser itself reports the answers that refuse something.
        assert [each for each in page.complaints if "40" not in each and "41" not in each] == []
        while not page.evaluate("document.getElementById('undo').disabled"):
            page.click("#undo")
            time.sleep(0.05)
        page.wait_until(f"document.title === {plain!r}")


def _search(page: Page, words: str) -> None:
    page.evaluate(
        f"(line => {{ line.value = '{words}'; line.dispatchEvent(new Event('input')); }})"
        "(document.querySelector('#gallery [type=search]'))"
    )


def _send(page: Page, name: str, text: str) -> None:
    page.evaluate(
        f"(input => {{ const data = new DataTransfer(); "
        f"data.items.add(new File([{json.dumps(text)}], '{name}')); "
        "input.files = data.files; input.dispatchEvent(new Event('change')); })"
        "(document.querySelector('#gallery [type=file]'))"
    )


@pytest.mark.nightly
def test_cancelled_preset_leads_back() -> None:
    async def ask() -> None:
        state = _State()
        session = Session("stockinette", [], state)
        work = asyncio.create_task(session.run())
        try:
            while session.screen.frame is None or session._is_busy:
                await asyncio.sleep(0.01)
            title, shown = state.title, session.screen.frame
            session.preset("hang")
            # Relaxing and hanging the knit takes many seconds.
            stages = set()
            while state.title == title or state.work is None:
                stages |= {state.work["stage"]} if state.work else set()
                await asyncio.sleep(0.01)
            assert "Hang as curtain" in stages
            session.cancel()
            while state.title != title or session._is_busy or session._request:
                await asyncio.sleep(0.01)
            assert state.failure == "The run was cancelled."
            assert state.undo == ""
            assert session.screen.frame.values == shown.values
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
