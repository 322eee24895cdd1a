"""Read a file in a child process first if its reader is known to crash on damaged files.

VTK's readers trust the numbers in a file. A damaged file makes them read wild memory, ask for all
memory, or never end. A file that ends the other process is refused here. A file that the other
process could read is noted in the cache (`spacemap_vtk.cache`), so an unchanged file is tried once.
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
from spacemap_vtk.io.file_references import file_references
from spacemap_vtk.io.registry import damaged_error
from spacemap_vtk.memory import available_bytes

#: Seconds of processor time that any file may need.
_MOST_SECONDS = 10
#: Seconds added for each byte of the file.
_SECONDS_PER_BYTE = 1e-6

_lock = threading.Lock()
_child: subprocess.Popen[bytes] | None = None
_checked: set[str] = set()


def check_in_child(path: Path, function: str, *more: Any) -> None:
    """Call "module:name" with a path in another process; refuse a file that ends that process."""
    # ParaView runs VTK's readers itself, and its Python has no interpreter that can be started.
    if workers.WORKER_VARIABLE in os.environ or "paraview" in sys.modules:
        return
    try:
        str(path).encode()
    except UnicodeEncodeError:  # VTK accepts only names in UTF-8
        raise InputError(
            f"{path}: the path is not UTF-8", key="file", cure="Rename the file or its folder."
        ) from None
    # The damage may be in another file that this one names.
    states = [_file_state(each) for each in (path, *(other for _, other in file_references(path)))]
    key = f"sound-{hashlib.sha256(repr((states, function, more)).encode()).hexdigest()[:40]}"
    if key in _checked or cache.load(key) is not None:
        return
    seconds = int(_MOST_SECONDS + _SECONDS_PER_BYTE * sum(size for _, size, *_ in states))
    with _lock:
        answer = _run_in_child((function, path, more, seconds, available_bytes()))
    if isinstance(answer, workers.WorkerEndedError):
        how = answer.message.partition("ended by ")[2]
        raise damaged_error(path, f"the file is damaged or too large: its reader ended by {how}")
    if isinstance(answer, InputError):
        raise answer
    if answer is None:  # any other error will occur in this process too
        _checked.add(key)
        cache.store(key)


def _file_state(path: Path) -> tuple[str, int, int, int]:
    """Return the path, size, time of change and inode of a file."""
    size, changed, number = 0, 0, 0
    with suppress(OSError, ValueError):  # the reader reports a file that is missing
        state = os.stat(path)
        size, changed, number = state.st_size, state.st_mtime_ns, state.st_ino
    return os.path.abspath(path), size, changed, number


def _run_in_child(task: Any) -> Any:
    """Return the child's answer to a task; start the child for the first task."""
    global _child
    if _child is None:
        quiet = subprocess.DEVNULL  # hides what libraries print about damaged files
        try:
            _child = workers.start_worker(f"{__name__}:run_check", os.environ, stderr=quiet)
        except OSError:  # no more processes are allowed: the file is read in this one only
            return None
    child = _child
    try:
        answer, _child = workers.run_task(child, task)
    except BaseException:  # Ctrl-C: a late answer would be taken for that of the next file
        child.kill()
        _stop_child()
        raise
    if answer is not None:
        _stop_child()  # a damaged file may have damaged its memory
    return answer


@atexit.register
def _stop_child() -> None:
    global _child
    if _child is not None:
        workers.end_worker(_child)
        _child = None


def run_check(task: tuple[str, Path, tuple[Any, ...], int, int | None]) -> None:
    """Read a file within limits of time and memory; runs in the child."""
    function, path, more, seconds, free = task
    _limit_resources(seconds, free)
    workers.import_function(function)(path, *more)


def _limit_resources(seconds: int, free: int | None) -> None:
    """Limit the further processor time (s) and memory (bytes) of this process."""
    with suppress(ImportError, ValueError, OSError):
        import resource  # not on Windows

        # A process that exceeds a limit must not write its memory to the disk as a core file.
        resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
        used = resource.getrusage(resource.RUSAGE_SELF)
        spent = int(used.ru_utime + used.ru_stime)
        most = resource.getrlimit(resource.RLIMIT_CPU)[1]
        resource.setrlimit(resource.RLIMIT_CPU, (spent + seconds, most))
        if free is not None:
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            most = resource.getrlimit(resource.RLIMIT_AS)[1]
            resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + free, most))
