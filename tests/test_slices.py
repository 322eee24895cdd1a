"""Background work in slices: it shares the engine's thread, can be cancelled, and fails aloud."""

from __future__ import annotations

import threading
import time
from collections.abc import Generator

import pytest

from spacemap_vtk import cancel
from spacemap_vtk.app.work.slices import in_slices
from spacemap_vtk.ndarrays import Progress


def work_for(seconds: float, log: list[int], report: Progress) -> str:
    """Work in steps of a millisecond, each of which is logged and reported."""
    count = round(1e3 * seconds)
    for number in range(count):
        time.sleep(1e-3)
        log.append(number)
        report(len(log) / count)
        cancel.check()
    return "done"


def test_work_is_done_in_slices_and_never_between_them() -> None:
    log: list[int] = []
    results: list[str] = []

    def collect() -> Generator[float | None, None, None]:
        results.append((yield from in_slices(lambda report: work_for(0.3, log, report))))

    counts = []
    for share in collect():
        counts.append(len(log))
        assert share == len(log) / 300
        time.sleep(0.02)
        assert len(log) == counts[-1]
    assert results == ["done"]
    assert len(counts) >= 4
    assert len(log) == 300


def test_closed_work_is_cancelled_and_its_thread_ends() -> None:
    log: list[int] = []
    before = threading.active_count()
    work = in_slices(lambda report: work_for(10.0, log, report))
    next(work)
    work.close()
    assert len(log) < 1000
    assert threading.active_count() == before


def test_failures_of_the_work_are_raised() -> None:
    def fail(_: Progress) -> None:
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        list(in_slices(fail))
