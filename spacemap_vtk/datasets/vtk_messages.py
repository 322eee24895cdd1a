"""Turn VTK's printed errors into exceptions, and silence standard error."""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow

from spacemap_vtk.errors import InputError

#: VTK's XML readers print an error with this word if an array's range contains NaN. They do not
#: need the range.
_HARMLESS = "InformationKey"
#: Standard error and VTK's output window are shared by all threads. Without this lock, two threads
#: that redirected them together got each other's messages, or VTK wrote to a deleted window and
#: the program aborted.
_lock = threading.RLock()


@contextmanager
def silence_stderr() -> Iterator[None]:
    """Discard what C libraries print about a damaged file; an exception reports the damage."""
    with _lock:
        try:
            kept = os.dup(2)
        except OSError:  # a program without a console has no standard error
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
def capture_vtk_messages() -> Iterator[vtkStringOutputWindow]:
    """Collect VTK's messages in the yielded window, and print nothing."""
    with silence_stderr():
        window, usual = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
        verbosity = vtkLogger.GetCurrentVerbosityCutoff()
        vtkOutputWindow.SetInstance(window)
        vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # the logger would print them too
        try:
            yield window
        finally:
            vtkOutputWindow.SetInstance(usual)
            vtkLogger.SetStderrVerbosity(verbosity)


@contextmanager
def raise_vtk_errors(path: Path) -> Iterator[None]:
    """Raise InputError for errors that VTK prints while a file is read."""
    with capture_vtk_messages() as window:
        yield
    output = window.GetOutput()
    if isinstance(output, bytes):  # VTK quotes text of the file that is not UTF-8
        output = output.decode("utf-8", "replace")
    errors = [
        " ".join(text.split("):")[-1].split())
        for text in re.split(r"(?=ERROR: In |Warning: In )", output)
        if text.startswith("ERROR") and _HARMLESS not in text
    ]
    # The innermost reader gives the reason. The readers around it only print that it failed.
    errors = [text for text in errors if "returned failure" not in text] or errors
    if errors and not path.exists():
        raise InputError(f"{path}: the file was removed while it was read")
    if errors:
        why = errors[0][:200].rstrip(".")
        raise InputError(
            f"{path}: damaged, or not in the format of its ending: {why}",
            cure="Write the file again.",
        )
