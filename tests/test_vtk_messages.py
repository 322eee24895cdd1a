"""What VTK prints is heard by the thread whose file it is about."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor

from vtkmodules.vtkCommonCore import vtkOutputWindow

from spacemap_vtk.datasets.vtk_messages import capture_vtk_messages


def test_second_thread_waits_for_the_first() -> None:
    usual, inside = vtkOutputWindow.GetInstance(), threading.Event()

    def listen() -> None:
        with capture_vtk_messages():
            inside.set()

    with ThreadPoolExecutor(1) as other:
        with capture_vtk_messages() as window:
            waiting = other.submit(listen)
            assert not inside.wait(0.1)
            assert vtkOutputWindow.GetInstance() is window
        waiting.result(60.0)
    assert vtkOutputWindow.GetInstance() is usual
