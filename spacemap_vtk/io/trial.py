"""Files are read first by a process that may die.

VTK's readers believe what a file says: of a damaged one they run into wild memory, take all that
there is, or never end. What has killed one process is refused in this one, and what it has read is
noted in the cache (`spacemap_vtk.cache`), so that an unchanged file is tried once.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from spacemap_vtk import cache, workers
from spacemap_vtk.errors import InputError
from spacemap_vtk.io.named import named
from spacemap_vtk.io.registry import damaged
from spacemap_vtk.memory import available

#: Seconds of the processor's time that a file may take, and more for each byte of it.
_SECONDS, _EACH = 10, 1e-6

_lock = threading.Lock()
_children: list[subprocess.Popen[bytes]] = []
_sound: set[str] = set()


@contextmanager
def tried(path: Path, function: str, *more: Any, needs: str = "") -> Iterator[None]:
    """Let another process call "module:name" with a path and more before this one reads."""
    # What ends that process is refused, and so is what has not been the same throughout.
    # What the function needs is imported once there, and not in a copy for each file.
    # ParaView has its readers' faults anyway, and no interpreter to start.
    if workers.EXPENDABLE in os.environ or "paraview" in sys.modules:
        yield
        return
    try:
        str(path).encode()
    except UnicodeEncodeError:  # VTK takes no other
        raise InputError(
            f"{path}: its name is no UTF-8", key="file", cure="Rename it, or the folder it is in."
        ) from None
    before = _state(path)
    key = f"sound-{hashlib.sha256(repr((before, function, more)).encode()).hexdigest()[:40]}"
    if key not in _sound and cache.load(key) is None:
        size = sum(size or 0 for _, size, *_ in before)
        allowed = int(_SECONDS + _EACH * size), available()
        with _lock:
            answer = _asked((needs, function, path, *more), *allowed)
        if isinstance(answer, workers.EndedError):
            why = answer.message.split()[-1]
            raise damaged(path, f"damaged, or too large: what reads it ends by {why}")
        if isinstance(answer, InputError):
            raise answer
        _require_same(path, before)
        if answer is None:
            _sound.add(key)
            cache.store(key)
    try:
        yield
    except Exception:
        _require_same(path, before)
        raise
    _require_same(path, before)


def _state(path: Path) -> list[tuple[str, int | None, int, int]]:
    """Return what tells whether a file is the one that it was, and those that it names."""
    found: list[tuple[str, int | None, int, int]] = []
    for each in (path, *(other for _, other in named(path))):
        told: tuple[int | None, int, int] = None, 0, 0
        with suppress(OSError, ValueError):  # whoever reads it says so
            state = os.stat(each)
            told = state.st_size, state.st_mtime_ns, state.st_ino
        found.append((os.path.abspath(each), *told))
    return found


def _require_same(path: Path, before: list[tuple[str, int | None, int, int]]) -> None:
    if _state(path) != before:
        raise InputError(
            f"{path}: it, or a file that it names, has changed while it was read",
            key="file",
            cure="Read it again when what writes it has ended.",
        )


def _asked(task: Any, *limits: int | None) -> Any:
    if not _children:
        quiet = subprocess.DEVNULL  # what libraries print of damaged files
        # No threads, which a copy would lack. The GNU C library fills memory with that number: what
        # is wild kills, and is not 0 by chance.
        one = {"VTK_SMP_BACKEND_IN_USE": "Sequential", "OPENBLAS_NUM_THREADS": "1"}
        environment = {**os.environ, **one, "MALLOC_PERTURB_": "85"}
        try:
            _children.append(workers.start(f"{__name__}:attempt", environment, stderr=quiet))
        except OSError:
            return None
    try:
        answer, left = workers.ask(_children[0], (task, limits))
    except BaseException:  # Ctrl-C: its answer to this would be taken for one to the next
        child = _children.pop()
        child.kill()
        workers.end(child)
        raise
    if left is None:
        _children.clear()
    return answer


@atexit.register
def _leave() -> None:
    for child in _children:
        workers.end(child)


def attempt(task: tuple[tuple[Any, ...], tuple[int, int | None]]) -> None:
    """Read a file, within limits of time and memory."""
    (needs, function, *arguments), limits = task
    read = partial(workers.named(function), *arguments)
    if needs:
        with suppress(ImportError):  # whoever reads says so
            import_module(needs)
    if sys.platform != "linux":
        _within(read, *limits)
        return
    # In a copy of this process: what is wild in memory depends on what has been read before, and
    # what spares one that has read much may kill another.
    receive, send = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            _within(read, *limits)
        except BaseException as error:
            os.write(send, workers.told(error))
        os._exit(0)
    os.close(send)
    with os.fdopen(receive, "rb") as stream:
        answer = stream.read()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    if code:  # libraries call exit() where they do not know what to do
        how = signal.Signals(-code).name if code < 0 else f"exit({code})"
        raise workers.EndedError(f"its process ended by {how}")
    if answer:
        raise pickle.loads(answer)


def _within(read: Callable[[], Any], seconds: int, free: int | None) -> None:
    with suppress(ImportError, ValueError, OSError):
        import resource  # not on Windows

        # What ends by its limits, or by a fault, leaves no image of its memory on the disk.
        resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
        used = resource.getrusage(resource.RUSAGE_SELF)
        spent = int(used.ru_utime + used.ru_stime)
        most = resource.getrlimit(resource.RLIMIT_CPU)[1]
        resource.setrlimit(resource.RLIMIT_CPU, (spent + seconds, most))
        if free is not None:
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            most = resource.getrlimit(resource.RLIMIT_AS)[1]
            resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + free, most))
    read()
