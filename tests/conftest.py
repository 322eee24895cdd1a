"""Every test fails on anything that VTK prints, and on a stage that is never freed."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest
from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow

from spacemap_vtk.filters.base import Stage


@pytest.fixture(autouse=True)
def silent_vtk() -> Iterator[vtkStringOutputWindow]:
    window, usual = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    vtkOutputWindow.SetInstance(window)
    yield window
    vtkOutputWindow.SetInstance(usual)
    assert window.GetOutput() == ""


@pytest.fixture(autouse=True)
def no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep solved modes out of the user's cache; tests of the cache choose a folder."""
    monkeypatch.setenv("SPACEMAP_CACHE", "off")


@pytest.fixture(autouse=True)
def no_leaked_stages() -> Iterator[None]:
    before = _stages()
    yield
    leaked = _stages() - before
    if leaked:
        gc.collect()
        leaked = _stages() - before
    assert not leaked


def _stages() -> set[int]:
    return {id(thing) for thing in gc.get_objects() if isinstance(thing, Stage)}
