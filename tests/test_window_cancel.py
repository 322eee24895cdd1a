"""Long runs can be cancelled within about a second, and later results are complete."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from window import require_display, settled, wait_until

require_display()

from PySide6.QtCore import Qt  # noqa: E402
from PySide6.QtTest import QTest  # noqa: E402

from spacemap_vtk.app.work.engine import Engine  # noqa: E402
from spacemap_vtk.app.work.frame_request import FrameRequest  # noqa: E402
from spacemap_vtk.cage.tetwild import run_process  # noqa: E402
from spacemap_vtk.cancel import Cancelled, CancelToken, check  # noqa: E402
from spacemap_vtk.parallel import for_each  # noqa: E402
from spacemap_vtk.scenes import library  # noqa: E402
from spacemap_vtk.scenes.scene import Scene  # noqa: E402


def cancel_time() -> float:
    """Return the seconds that cancelling may take on a busy machine."""
    return 10.0 * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


def test_cancelled_work_stops_at_its_next_check() -> None:
    token, blocks = CancelToken(), []
    with token.active():
        check()
        token.cancel()
        with pytest.raises(Cancelled):
            check()
        with CancelToken().active():
            check()  # the outer token has no effect here
    check()  # nor after the work has ended

    def work(job: int) -> None:
        blocks.append(job)
        if job == 3:
            token.cancel()

    token = CancelToken()
    with token.active(), pytest.raises(Cancelled):
        for_each(range(100), lambda: work, threads=2)
    # Each of the two threads finishes its present block.
    assert len(blocks) < 10


HEAVY = {
    "weave": ("weave", {"ends": 300, "picks": 300}),
    "modal": ("cage", {"divisions": [24, 24, 2], "order": 2}),
}


@pytest.mark.parametrize("stage", [pytest.param("weave", marks=pytest.mark.nightly), "modal"])
def test_every_long_stage_can_be_cancelled(open_window: Any, stage: str) -> None:
    window = open_window()
    frame = window.view.frame
    window.document.set_many(*HEAVY[stage])
    wait_until(
        lambda: window.stages.states[stage] == "running" and window.cancel_button.isVisible()
    )
    QTest.qWait(200)
    start = time.monotonic()
    QTest.mouseClick(window.cancel_button, Qt.MouseButton.LeftButton)
    assert window.running_label.text().endswith("stopping…")
    wait_until(lambda: not window.engine.busy)
    assert time.monotonic() - start < cancel_time()
    wait_until(
        lambda: window.stages.states[stage] == "stale" and not window.cancel_button.isVisible()
    )
    assert window.view.frame is frame
    # The stages below wait too, and the message says that the picture is old.
    sections = [s.section for s in window.document.scene.stages]
    at = sections.index(stage)
    assert {window.stages.states[s] for s in sections[:at]} <= {"fresh"}
    assert {window.stages.states[s] for s in sections[at:]} == {"stale"}
    # The message follows when the thread has stopped.
    wait_until(lambda: window.errors.text)
    assert window.errors.text == "The run was cancelled: the picture is older than the values."
    assert window.errors.run_button.isVisible()
    # Partial results are not used: the former scene returns completely.
    before = np.array(frame.surface.GetBounds())
    window.document.history.undo()
    wait_until(lambda: settled(window))
    np.testing.assert_allclose(window.view.frame.surface.GetBounds(), before, atol=1e-9)
    assert window.view.frame.cage.GetNumberOfPoints() == 72
    assert window.errors.text == ""


def cancel_when_running(window: Any, stage: str) -> None:
    wait_until(
        lambda: window.stages.states[stage] == "running" and window.cancel_button.isVisible()
    )
    QTest.mouseClick(window.cancel_button, Qt.MouseButton.LeftButton)
    wait_until(lambda: not window.engine.busy and window.errors.text)


@pytest.mark.nightly
def test_cancelled_run_can_be_started_again(
    open_window: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_window()
    # As cloth of many yarns, which is drawn anew for each size of the view.
    monkeypatch.setattr(window.view, "needs_new_frame", lambda _frame: True)
    window.document.set_many("cage", {"divisions": [9, 9, 2], "order": 2})
    cancel_when_running(window, "modal")
    # The message takes room from the view. This alone does not start the run again.
    QTest.qWait(400)
    assert not window.engine.busy
    assert window.errors.run_button.isVisible()
    QTest.mouseClick(window.errors.run_button, Qt.MouseButton.LeftButton)
    assert window.errors.text == ""
    wait_until(lambda: settled(window))
    assert window.view.frame.values == window.document.values
    assert set(window.stages.states.values()) == {"fresh", "off", "settings"}
    assert window.errors.text == ""
    # An error message has no Run button.
    window.report("value", ValueError("wrong"))
    assert not window.errors.run_button.isVisible()


@pytest.mark.nightly
def test_message_about_a_cancelled_run_is_correct(open_window: Any, tmp_path: Path) -> None:
    window = open_window()
    # A run that is long enough to be cancelled.
    window.document.set_many("weave", {"ends": 12, "picks": 12})
    wait_until(lambda: settled(window))
    window.document.set("surface", "subdivisions", 64)
    cancel_when_running(window, "surface")
    assert "coarser" in window.errors.text
    scene = tmp_path / "large.toml"
    scene.write_text("[weave]\nends = 300\npicks = 300\n[surface]\nsubdivisions = 2\n")
    window.document.open(scene)
    assert window.errors.text == ""
    # Nothing of the former scene is visible, neither now nor after cancelling.
    for ended in (False, True):
        if ended:
            cancel_when_running(window, "weave")
        rows = window.view.image().astype(int)
        assert np.ptp(rows, axis=1).max() <= 2, ended  # only the background
    assert "no picture of this scene" in window.errors.text


def test_closing_cancels_the_run(open_window: Any) -> None:
    window = open_window(str(library.folder() / "animal_in_carved_cage.toml"))
    window.document.set("cage", "divisions", [130, 100, 65])
    wait_until(lambda: window.stages.states["cage"] == "running")
    QTest.qWait(200)
    start = time.monotonic()
    window.discard()
    assert time.monotonic() - start < cancel_time()
    assert not window.engine.isRunning()


def test_child_process_ends_with_the_cancelled_run(tmp_path: Path) -> None:
    token, ends = CancelToken(), []
    code = "import os, time; open('pid', 'w').write(str(os.getpid())); time.sleep(60)"

    def work() -> None:
        with token.active(), pytest.raises(Cancelled):
            run_process([sys.executable, "-c", code], tmp_path)
        ends.append(time.monotonic())

    thread = threading.Thread(target=work)
    thread.start()
    wait_until(lambda: (tmp_path / "pid").is_file() and (tmp_path / "pid").read_text())
    start = time.monotonic()
    token.cancel()
    thread.join(300.0)
    assert ends[0] - start < cancel_time()
    assert not psutil.pid_exists(int((tmp_path / "pid").read_text()))


def test_child_process_returns_its_output(tmp_path: Path) -> None:
    code = "import sys; print('x' * 100_000); sys.stderr.write('wrong'); sys.exit(3)"
    done = run_process([sys.executable, "-c", code], tmp_path)
    assert done.returncode == 3
    assert len(done.stdout.strip()) == 100_000
    assert done.stderr == "wrong"


def make_request(divisions: int, generation: int = 1) -> FrameRequest:
    """Request a frame of a small cloth in a cage that is solved quickly."""
    values = {
        "weave": {"ends": 3, "picks": 3},
        "cage": {"divisions": [divisions, 2, 1]},
        "modal": {"modes": 3},
        "response": {},
    }
    scene = Scene(values)
    return FrameRequest(
        values=values,
        base=Path(),
        settings={name: part.settings for name, part in scene.parts.items()},
        generation=generation,
        time=0.0,
    )


@contextmanager
def running_engine() -> Iterator[tuple[Engine, list[Any]]]:
    """Run an engine; the list holds the values of each frame, or "cancelled"."""
    engine, results = Engine(), []
    direct = Qt.ConnectionType.DirectConnection
    engine.ready.connect(lambda: results.append(engine.take_frame().values), direct)
    engine.cancelled.connect(lambda: results.append("cancelled"), direct)
    engine.start()
    try:
        yield engine, results
    finally:
        engine.finish()
        engine.ready.disconnect()
        engine.cancelled.disconnect()


def test_cancel_before_a_run_starts_stops_only_that_run(qapp: Any) -> None:
    with running_engine() as (engine, results):
        first, second = make_request(2), make_request(3)
        do, pending = engine.run_request, [engine.cancel]

        def cancelled_first(job: FrameRequest) -> None:
            # The request is taken, but its run has not started.
            if pending:
                pending.pop()()
            do(job)

        engine.run_request = cancelled_first
        engine.request(first)
        wait_until(lambda: results and not engine.busy)
        assert results == ["cancelled"]
        engine.request(second)
        wait_until(lambda: len(results) == 2)
        assert results[1] == second.values
        # Nothing runs and nothing waits, so the cancellation has no effect.
        wait_until(lambda: not engine.busy)
        engine.cancel()
        engine.request(first)
        wait_until(lambda: len(results) == 3)
        assert results[2] == first.values


def test_closing_before_a_run_starts_ends_the_engine(qapp: Any) -> None:
    with running_engine() as (engine, results):
        do, taken = engine.run_request, threading.Event()

        def late(job: FrameRequest) -> None:
            taken.set()
            while not engine.ending:
                time.sleep(0.001)
            time.sleep(0.2)
            do(job)

        engine.run_request = late
        engine.request(make_request(2))
        assert taken.wait(300.0)
        engine.finish()
        assert results == ["cancelled"]


def test_cancelling_a_long_run_does_not_cancel_the_next(
    qapp: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A newer request cancels a long run, which may end at the same moment."""
    with running_engine() as (engine, results):
        first, second = make_request(2), make_request(3)
        do = engine.run_request
        start, asked, taken = threading.Event(), threading.Event(), []

        def slow(job: FrameRequest) -> None:
            taken.append(job)
            start.set()
            if job is first:
                assert asked.wait(300.0)
            do(job)

        class Late(CancelToken):
            def cancel(self) -> None:
                # The first run ends now, and the second request is taken at once.
                asked.set()
                end = time.monotonic() + 2.0
                while len(taken) < 2 and time.monotonic() < end:
                    time.sleep(0.01)
                super().cancel()

        monkeypatch.setattr("spacemap_vtk.app.work.engine.CancelToken", Late)
        monkeypatch.setattr("spacemap_vtk.app.work.engine.CANCEL_AFTER", 0.0)
        engine.run_request = slow
        engine.request(first)
        assert start.wait(300.0)
        engine.request(second)
        wait_until(lambda: len(results) == 2)
        assert results[1] == second.values
