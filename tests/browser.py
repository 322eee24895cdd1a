"""A browser without a screen: headless Chromium, driven by its own protocol (DevTools).

It hears and answers through a pipe: no port is open, and no library is needed. A test file starts
one, for all that it asks:

    with browser() as page:
        page.open(file.as_uri())
        page.click("#play")
        assert page.evaluate("document.title") == "plain weave"
"""

from __future__ import annotations

import base64
import fcntl
import io
import json
import os
import select
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

_FLAGS = [
    "--headless",
    "--no-sandbox",
    "--remote-debugging-pipe",
    "--no-first-run",
    "--disable-quic",
    "--disable-sync",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-extensions",
    "--hide-scrollbars",
    "--mute-audio",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
#: Key names with their code and number.
_KEYS = {" ": ("Space", 32), "Home": ("Home", 36), "End": ("End", 35)}


class Page:
    """A page of the browser."""

    def __init__(self, process: subprocess.Popen[bytes], words: int, answers: int) -> None:
        self._process, self._words, self._answers = process, words, answers
        self._heard, self._number, self._session = b"", 0, ""
        #: Errors, warnings and uncaught exceptions of the page.
        self.complaints: list[str] = []
        #: All addresses that the page has requested.
        self.addresses: list[str] = []
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        found = self.send("Target.attachToTarget", targetId=target, flatten=True)
        self._session = found["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.send(f"{domain}.enable")

    def send(self, method: str, **values: Any) -> dict[str, Any]:
        """Call a method of the protocol."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": values}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._words, json.dumps(message).encode() + b"\0")
        while True:
            found = self._hear(60.0)
            if found.get("id") == self._number:
                assert "error" not in found, (method, found["error"])
                answer: dict[str, Any] = found["result"]
                return answer

    def open(self, address: str) -> None:
        """Open an address, and wait until it is loaded."""
        assert "errorText" not in self.send("Page.navigate", url=address), address
        self.wait_until("document.readyState === 'complete'")

    def evaluate(self, script: str) -> Any:
        """Return the value of an expression; a promise is awaited."""
        found = self.send(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def wait_until(self, script: str, seconds: float = 60.0) -> None:
        """Wait until an expression is true."""
        end = time.monotonic() + seconds
        while not self.evaluate(f"!!({script})"):  # the value may be large
            assert time.monotonic() < end, (f"it never happened: {script}", self.complaints)
            time.sleep(0.02)

    def click(self, selector: str, count: int = 1) -> None:
        """Click the centre of an element; an element that covers it gets the click."""
        box = f"document.querySelector({json.dumps(selector)}).getBoundingClientRect()"
        x, y = self.evaluate(f"(box => [box.x + box.width / 2, box.y + box.height / 2])({box})")
        for number in range(1, count + 1):
            for kind in ("mousePressed", "mouseReleased"):
                self._mouse(kind, x, y, button="left", clickCount=number)

    def drag(self, start: tuple[float, float], end: tuple[float, float], **more: Any) -> None:
        """Drag the mouse between two positions in pixels; `modifiers=8` is Shift."""
        self._mouse("mousePressed", *start, button="left", clickCount=1, **more)
        for share in (0.25, 0.5, 0.75, 1.0):
            x, y = (a + share * (b - a) for a, b in zip(start, end, strict=True))
            self._mouse("mouseMoved", x, y, button="left", buttons=1, **more)
        self._mouse("mouseReleased", *end, button="left", clickCount=1, **more)

    def wheel(self, x: float, y: float, turn: float) -> None:
        """Turn the mouse wheel at a position."""
        self._mouse("mouseWheel", x, y, deltaX=0, deltaY=turn)

    def press(self, key: str, modifiers: int = 0) -> None:
        """Press and release a key; `modifiers` is the sum of 2 for Ctrl and 8 for Shift."""
        code, number = _KEYS.get(key, (f"Key{key.upper()}", ord(key.upper()[0])))
        key_event = {"key": key, "code": code or key, "windowsVirtualKeyCode": number}
        key_event["modifiers"] = modifiers
        text = {"text": key} if len(key) == 1 and not modifiers else {}
        self.send("Input.dispatchKeyEvent", type="keyDown", **key_event, **text)
        self.send("Input.dispatchKeyEvent", type="keyUp", **key_event)

    def show_as(self, width: int, height: int, dark: bool = False, scale: float = 1.0) -> None:
        """Set the size of the page, the pixels per unit and the theme."""
        size = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": False}
        self.send("Emulation.setDeviceMetricsOverride", **size)
        theme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.send("Emulation.setEmulatedMedia", features=[theme])

    def screenshot(self) -> NDArray[np.uint8]:
        """Return a screenshot as RGB, shape (height, width, 3)."""
        found = self.send("Page.captureScreenshot", format="png")["data"]
        with Image.open(io.BytesIO(base64.b64decode(found))) as image:
            return np.asarray(image.convert("RGB"))

    def _mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        self.send("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def _hear(self, seconds: float) -> dict[str, Any]:
        end = time.monotonic() + seconds
        while b"\0" not in self._heard:
            ready = select.select([self._answers], [], [], max(0.0, end - time.monotonic()))[0]
            assert ready, "the browser does not answer"
            part = os.read(self._answers, 1 << 20)
            assert part, f"the browser has ended: {self._process.wait(10)}"
            self._heard += part
        text, self._heard = self._heard.split(b"\0", 1)
        message: dict[str, Any] = json.loads(text)
        params, method = message.get("params", {}), message.get("method")
        if method == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(params["exceptionDetails"]))
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning"):
            self.complaints.append(f"{params['type']}: {json.dumps(params['args'])}")
        elif method == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
            self.complaints.append(json.dumps(params["entry"]))
        elif method == "Network.requestWillBeSent":
            self.addresses.append(params["request"]["url"])
        return message


@contextmanager
def browser(width: int = 1600, height: int = 1000) -> Iterator[Page]:
    """Start a browser; skip the test if there is none."""
    found = shutil.which("chromium") or shutil.which("chromium-browser")
    if found is None:
        pytest.skip("needs chromium")
    ends = [_high(end) for end in (*os.pipe(), *os.pipe())]
    hears, words, answers, speaks = ends

    def connect() -> None:  # pipes to and from the browser
        os.dup2(hears, 3)
        os.dup2(speaks, 4)

    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        own = (f"--user-data-dir={profile}", f"--window-size={width},{height}", "about:blank")
        process = subprocess.Popen(
            [found, *_FLAGS, *own],
            pass_fds=(3, 4),
            preexec_fn=connect,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(hears)
        os.close(speaks)
        try:
            page = Page(process, words, answers)
            page.show_as(width, height)
            yield page
            page.send("Page.close")
        finally:
            os.close(words)  # the browser ends when its pipe is closed
            os.close(answers)
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _high(end: int) -> int:
    """Duplicate the end of a pipe to a number that is free in the browser."""
    moved = fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10)
    os.close(end)
    return moved
