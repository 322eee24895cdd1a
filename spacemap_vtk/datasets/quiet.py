"""What VTK prints, as an exception."""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow

from spacemap_vtk.errors import InputError

#: VTK's XML readers stumble over the range of an array with a NaN in it, which they do not need.
_HARMLESS = "InformationKey"
#: All threads of a process have one standard error, and one place for what VTK says: two that took
#: them at once heard each other, or let VTK write to what was gone, and the program was aborted.
_taken = threading.RLock()


@contextmanager
def quiet_stderr() -> Iterator[None]:
    """Let what libraries in C print of a damaged file go nowhere: it is told in words."""
    with _taken:
        try:
            kept = os.dup(2)
        except OSError:  # a window without a console
            yield
            return
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 2)
        os.close(nowhere)
        try:
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)


@contextmanager
def silent_vtk() -> Iterator[vtkStringOutputWindow]:
    """Let VTK say what it has to say there, and print nothing."""
    with quiet_stderr():
        window, usual = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
        verbosity = vtkLogger.GetCurrentVerbosityCutoff()
        vtkOutputWindow.SetInstance(window)
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # it would print them once more
        try:
            yield window
        finally:
            vtkOutputWindow.SetInstance(usual)
            vtkLogger.SetStderrVerbosity(verbosity)


@contextmanager
def quiet_vtk(path: Path) -> Iterator[None]:
    """Turn what VTK prints as an error while a file is read into an exception."""
    with silent_vtk() as window:
        yield
    output = window.GetOutput()
    if isinstance(output, bytes):  # it quotes what is no UTF-8
        output = output.decode("utf-8", "replace")
    errors = [
        " ".join(text.split("):")[-1].split())
        for text in re.split(r"(?=ERROR: In |Warning: In )", output)
        if text.startswith("ERROR") and _HARMLESS not in text
    ]
    # The first reader knows why; those above it only that it failed, at length.
    errors = [text for text in errors if "returned failure" not in text] or errors
    if errors and not path.exists():
        raise InputError(f"{path}: it has gone while it was read")
    if errors:
        why = errors[0][:200].rstrip(".")
        raise InputError(
            f"{path}: damaged or not of the format that its ending says: {why}",
            cure="Write the file again, whole.",
        )
