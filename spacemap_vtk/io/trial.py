"""Read a file in another process first, where a reader is known to crash on damaged files.

VTK's readers believe what a file says: a damaged one makes them read wild memory, ask for all the
memory there is, or never end. What ends the other process is refused here. A file that it has read
is noted in the cache (`spacemap_vtk.cache`), so that an unchanged file is read there once.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any

from spacemap_vtk import cache, workers
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.named import named
from spacemap_vtk.io.registry import damaged
from spacemap_vtk.memory import available

#: Seconds of processor time that a file may take.
_SECONDS = 10
#: Seconds more for each byte of the file.
_SECONDS_PER_BYTE = 1e-6

_lock = threading.Lock()
_child: subprocess.Popen[bytes] | None = None
_sound: set[str] = set()


def try_in_child(path: Path, function: str, *more: Any) -> None:
    """Let another process call "module:name" with a path and more; refuse what ends it."""
    # ParaView runs VTK's readers itself, and its Python has no interpreter to start.
    if workers.EXPENDABLE in os.environ or "paraview" in sys.modules:
        return
    try:
        str(path).encode()
    except UnicodeEncodeError:  # VTK takes no other
        raise InputError(
            f"{path}: its name is no UTF-8", key="file", cure="Rename it, or the folder it is in."
        ) from None
    # A file that it names may be the damaged one.
    states = [_state(each) for each in (path, *(other for _, other in named(path)))]
    key = f"sound-{hashlib.sha256(repr((states, function, more)).encode()).hexdigest()[:40]}"
    if key in _sound or cache.load(key) is not None:
        return
    seconds = int(_SECONDS + _SECONDS_PER_BYTE * sum(size for _, size, *_ in states))
    with _lock:
        answer = _ask((function, path, more, seconds, available()))
    if isinstance(answer, workers.EndedError):
        how = answer.message.partition("ended by ")[2]
        raise damaged(path, f"damaged, or too large: what reads it ends by {how}")
    if isinstance(answer, InputError):
        raise answer
    if answer is None:  # any other error occurs here as well
        _sound.add(key)
        cache.store(key)


def _state(path: Path) -> tuple[str, int, int, int]:
    """Return the place of a file, and what changes with its content."""
    size, changed, number = 0, 0, 0
    with suppress(OSError, ValueError):  # whoever reads it says so
        state = os.stat(path)
        size, changed, number = state.st_size, state.st_mtime_ns, state.st_ino
    return os.path.abspath(path), size, changed, number


def _ask(task: Any) -> Any:
    """Return the answer of the child, which is started for the first task."""
    global _child
    if _child is None:
        quiet = subprocess.DEVNULL  # what libraries print of damaged files
        try:
            _child = workers.start(f"{__name__}:attempt", os.environ, stderr=quiet)
        except OSError:  # no more processes are allowed: then the file is read here alone
            return None
    child = _child
    try:
        answer, _child = workers.ask(child, task)
    except BaseException:  # Ctrl-C: the late answer would be taken for the next file's
        child.kill()
        _end_child()
        raise
    if answer is not None:
        _end_child()  # a damaged file may have left damaged memory
    return answer


@atexit.register
def _end_child() -> None:
    global _child
    if _child is not None:
        workers.end(_child)
        _child = None


def attempt(task: tuple[str, Path, tuple[Any, ...], int, int | None]) -> None:
    """Read a file, within limits of time and memory."""
    function, path, more, seconds, free = task
    _limit(seconds, free)
    workers.named(function)(path, *more)


def _limit(seconds: int, free: int | None) -> None:
    """Let this process use so much more processor time, and so many bytes more."""
    with suppress(ImportError, ValueError, OSError):
        import resource  # not on Windows

        # A process that exceeds a limit leaves no image of its memory on the disk.
        resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
        used = resource.getrusage(resource.RUSAGE_SELF)
        spent = int(used.ru_utime + used.ru_stime)
        most = resource.getrlimit(resource.RLIMIT_CPU)[1]
        resource.setrlimit(resource.RLIMIT_CPU, (spent + seconds, most))
        if free is not None:
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            most = resource.getrlimit(resource.RLIMIT_AS)[1]
            resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + free, most))
