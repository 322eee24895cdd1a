"""Share work among processes, each of which may die at any moment, or on a Dask cluster.

Processes are used, not threads: if the system kills one for its memory, only one piece of work is
lost, and within one process VTK draws only one picture at a time. Each is started as a separate
program (``python -m spacemap_vtk.workers module:function``), so that the calling script needs no
``if __name__ == "__main__"``.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from queue import Empty, SimpleQueue
from socket import create_connection
from typing import Any
from urllib.parse import urlsplit

from spacemap_vtk.errors import InputError, MissingLibraryError, SpacemapError
from spacemap_vtk.memory import available_bytes, require_memory
from spacemap_vtk.parallel import core_count

#: Environment variable that is set in worker processes.
WORKER_VARIABLE = "SPACEMAP_EXPENDABLE"
#: Bytes that a process needs before it does any work.
_PYTHON_BYTES = 300_000_000
#: Seconds between two checks for Ctrl-C, which on Windows does not interrupt a wait.
_PATIENCE = 0.5
#: Longest time to wait for a scheduler's answer [s].
_ANSWER = 10
#: Other valid schemes of a scheduler's address, besides tcp and tls.
_SCHEMES = ("inproc", "ucx", "ws", "wss")
#: Probable causes of an exit status.
_ENDS = {-9: ", possibly out of memory", 137: ", possibly out of memory"}


class WorkerEndedError(SpacemapError, RuntimeError):
    """A process ended before it finished its work, for example because it was killed."""


def run_in_processes(
    function: str, tasks: Sequence[Any], count: int
) -> Generator[tuple[int, Any | Exception]]:
    """Yield, as tasks end, the number of each and its result or error."""
    # `function` is "module:name"; tasks and results are pickled. If the loop is left early, by
    # Ctrl-C or any error, all processes are ended. A process serves several tasks, so that what it
    # has loaded is reused.
    waiting, lock = iter(enumerate(tasks)), threading.Lock()
    done: SimpleQueue[tuple[int, Any | Exception]] = SimpleQueue()
    children: list[subprocess.Popen[bytes]] = []
    count = max(1, min(count, len(tasks)))
    # Software OpenGL starts as many threads as there are cores, in each process.
    threads = str(max(1, core_count() // count))

    def started() -> subprocess.Popen[bytes]:
        children.append(start_worker(function, {"LP_NUM_THREADS": threads, **os.environ}))
        return children[-1]

    def serve() -> None:
        child: subprocess.Popen[bytes] | None = None
        while True:
            with lock:  # so that no process is started after all have been ended
                number, task = next(waiting, (-1, None))
                if number < 0:
                    break
                try:
                    child = child or started()
                except OSError as error:
                    done.put((number, SpacemapError(f"cannot start a process: {error}")))
                    continue
            result, child = run_task(child, task)
            done.put((number, result))
        if child is not None:
            end_worker(child)

    servers = [threading.Thread(target=serve, daemon=True) for _ in range(count)]
    for server in servers:
        server.start()
    try:
        left = len(tasks)
        while left:
            with suppress(Empty):
                yield done.get(timeout=_PATIENCE)
                left -= 1
    finally:
        with lock:
            for _ in waiting:
                pass
            for child in children:
                child.kill()
        for server in servers:
            server.join()


def process_count(jobs: int, worth: int, need: int, asked: int | None) -> int:
    """Return how many processes to start; raise SizeError if the number asked for does not fit."""
    # `worth` limits the number if none is asked for. Each process needs `need` bytes in addition to
    # the Python interpreter.
    need, free = need + _PYTHON_BYTES, available_bytes()
    fits = jobs if free is None else max(1, free // need)
    if asked is None:
        return max(1, min(core_count(), fits, worth))
    count, cure = min(asked, jobs), f"Use {fits} or fewer."
    if count > 1:
        require_memory(count * need, f"{count} processes", key="--workers", value=asked, cure=cure)
    return count


def run_on_cluster(
    address: str, function: Callable[[Any], Any], tasks: Sequence[Any]
) -> Generator[tuple[int, Any | Exception]]:
    """Yield the same as `run_in_processes`, computed by the workers of a Dask cluster."""
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise MissingLibraryError(
            "a Dask cluster needs the package distributed, which is not installed",
            cure="Run \"pip install 'spacemap_vtk[cluster]'\".",
        ) from None
    refused = InputError(
        "no Dask scheduler answers at this address",
        key="--cluster",
        value=address,
        allowed="the address that it prints when it starts, such as tcp://127.0.0.1:8786",
        cure='Start one with "dask scheduler", and workers with "dask worker ADDRESS".',
    )
    try:
        # Test the address first: a client without a scheduler retries for long when it is closed.
        place = urlsplit(address if "://" in address else f"tcp://{address}")
        if place.scheme in ("tcp", "tls"):
            create_connection((place.hostname, place.port or 0), _ANSWER).close()
        elif place.scheme not in _SCHEMES:
            raise refused
        client = Client(address, timeout=_ANSWER, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise refused from error
    with client:
        found = client.get_versions(packages=["spacemap_vtk"])["workers"]
        lacking = [name for name, each in found.items() if not each["packages"]["spacemap_vtk"]]
        if lacking or not found:
            raise InputError(
                f"spacemap_vtk is not installed on its worker {lacking[0]}"
                if lacking
                else "the cluster has no workers",
                key="--cluster",
                value=address,
                cure="Start workers in an environment with spacemap_vtk: "
                f"dask worker {address} --nthreads 1",
            )
        futures = {client.submit(function, task, pure=False): k for k, task in enumerate(tasks)}
        try:
            for future in as_completed(list(futures), loop=client.loop):
                failed = future.exception()
                yield futures[future], failed or future.result()
        finally:
            client.cancel(list(futures))


def start_worker(
    function: str, environment: Mapping[str, str], **more: Any
) -> subprocess.Popen[bytes]:
    """Start a process that applies the function "module:name" to each task that it receives."""
    # Without the empty entry, which is the current folder: it may be the folder of a stranger's
    # scene, whose modules must not be imported.
    paths = os.pathsep.join(path for path in sys.path if path)
    return subprocess.Popen(
        [sys.executable, "-m", "spacemap_vtk.workers", function],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**environment, "PYTHONPATH": paths, "PYTHONSAFEPATH": "1", WORKER_VARIABLE: "1"},
        **more,
    )


def run_task(
    child: subprocess.Popen[bytes], task: Any
) -> tuple[Any | Exception, subprocess.Popen[bytes] | None]:
    """Return a process's result for a task, and the process if it is still alive."""
    assert child.stdin is not None
    assert child.stdout is not None
    try:
        pickle.dump(task, child.stdin)
        child.stdin.flush()
        return pickle.load(child.stdout), child
    except (EOFError, OSError, pickle.UnpicklingError):
        end_worker(child)
        code = child.returncode
        why = f"signal {signal.Signals(-code).name}" if code < 0 else f"status {code}"
        return WorkerEndedError(f"its process ended by {why}{_ENDS.get(code, '')}"), None


def end_worker(child: subprocess.Popen[bytes]) -> None:
    """Close a process's streams, which makes it end, and wait for it."""
    for stream in (child.stdin, child.stdout):
        assert stream is not None
        with suppress(OSError):  # the process died before it read everything
            stream.close()
    child.wait()


def pickle_error(error: BaseException) -> bytes:
    """Pickle an error; one that cannot be unpickled is replaced by its message."""
    try:
        answer = pickle.dumps(error)
        pickle.loads(answer)
    except Exception:
        answer = pickle.dumps(SpacemapError(str(error) or type(error).__name__))
    return answer


def import_function(function: str) -> Callable[[Any], Any]:
    """Return the function named by "module:name"."""
    module, _, name = function.partition(":")
    return getattr(import_module(module), name)


def main() -> None:
    """Answer tasks from standard input until it is closed."""
    # Ctrl-C reaches all processes of a terminal, but only the parent process must act on it: it
    # ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Text that a library prints must not mix with the answers.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    function = import_function(sys.argv[1])
    while True:
        try:
            task = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        try:
            answer = pickle.dumps(function(task))
        except Exception as error:
            answer = pickle_error(error)
        try:
            answers.write(answer)
            answers.flush()
        except OSError:  # the parent process no longer reads
            return


if __name__ == "__main__":
    main()
