"""Work shared among processes, each of which can be ended at any moment, or on a Dask cluster.

Processes, not threads: one that is killed for its memory takes one piece of work with it and not
all, and what VTK draws in one process it draws one after another. They are started as a program of
their own (``python -m spacemap_vtk.workers module:function``), so that a script that asks for them
needs no ``if __name__ == "__main__"``.
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
from spacemap_vtk.memory import available, require
from spacemap_vtk.parallel import core_count

#: The variable by which a process knows that it is one of these.
EXPENDABLE = "SPACEMAP_EXPENDABLE"
#: Bytes that a process takes before it does anything.
_PYTHON = 300_000_000
#: Seconds after which Ctrl-C is looked for: on Windows it does not end a wait.
_PATIENCE = 0.5
#: Seconds for a scheduler's answer.
_ANSWER = 10
#: Of addresses, beside tcp and tls.
_SCHEMES = ("inproc", "ucx", "ws", "wss")
#: Why a process has ended, where only its status tells.
_ENDS = {-9: ", perhaps for lack of memory", 137: ", perhaps for lack of memory"}


class EndedError(SpacemapError, RuntimeError):
    """A process has ended before its work, as one does that is killed."""


def in_processes(
    function: str, tasks: Sequence[Any], count: int
) -> Generator[tuple[int, Any | Exception]]:
    """Yield the number of each task and what a function makes of it, or why not, as they end."""
    # `function` is "module:name"; tasks and results are pickled. Leaving the loop early, by Ctrl-C
    # or any error, ends all processes. Each serves several tasks: what it keeps is there for more.
    waiting, lock = iter(enumerate(tasks)), threading.Lock()
    done: SimpleQueue[tuple[int, Any | Exception]] = SimpleQueue()
    children: list[subprocess.Popen[bytes]] = []
    count = max(1, min(count, len(tasks)))
    # Software OpenGL takes as many threads as there are cores, in each process.
    threads = str(max(1, core_count() // count))

    def started() -> subprocess.Popen[bytes]:
        children.append(start(function, {"LP_NUM_THREADS": threads, **os.environ}))
        return children[-1]

    def serve() -> None:
        child: subprocess.Popen[bytes] | None = None
        while True:
            with lock:  # so that none is started once all have been ended
                number, task = next(waiting, (-1, None))
                if number < 0:
                    break
                try:
                    child = child or started()
                except OSError as error:
                    done.put((number, SpacemapError(f"no process could be started: {error}")))
                    continue
            result, child = ask(child, task)
            done.put((number, result))
        if child is not None:
            end(child)

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
    """Return how many processes there is work and memory for; refuse more that are asked for."""
    # At most `worth` by themselves; each takes so many bytes beside a Python of its own.
    need, free = need + _PYTHON, available()
    fits = jobs if free is None else max(1, free // need)
    if asked is None:
        return max(1, min(core_count(), fits, worth))
    count, cure = min(asked, jobs), f"Take {fits} or fewer."
    if count > 1:
        require(count * need, f"{count} processes", key="--workers", value=asked, cure=cure)
    return count


def on_cluster(
    address: str, function: Callable[[Any], Any], tasks: Sequence[Any]
) -> Generator[tuple[int, Any | Exception]]:
    """Yield what `in_processes` does, worked out by the workers of a Dask cluster."""
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise MissingLibraryError(
            "a Dask cluster needs the package distributed, which is not installed",
            cure="Try \"pip install 'spacemap_vtk[cluster]'\".",
        ) from None
    refused = InputError(
        "no Dask scheduler answers there",
        key="--cluster",
        value=address,
        allowed="the address that it prints when it starts, as in tcp://127.0.0.1:8786",
        cure='Start one by "dask scheduler", and workers by "dask worker ADDRESS".',
    )
    try:
        # Asked first: a client that has found none tries again when it is let go, for long.
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
                f"its worker {lacking[0]} has no spacemap_vtk" if lacking else "it has no workers",
                key="--cluster",
                value=address,
                cure="Start workers in an environment that has the program: dask worker "
                f"{address} --nthreads 1",
            )
        futures = {client.submit(function, task, pure=False): k for k, task in enumerate(tasks)}
        try:
            for future in as_completed(list(futures), loop=client.loop):
                failed = future.exception()
                yield futures[future], failed or future.result()
        finally:
            client.cancel(list(futures))


def start(function: str, environment: Mapping[str, str], **more: Any) -> subprocess.Popen[bytes]:
    """Start a process that answers with what "module:name" makes of the tasks that it is sent."""
    # Not with modules of the folder that this one runs in, which may be that of a stranger's scene.
    paths = os.pathsep.join(path for path in sys.path if path)
    return subprocess.Popen(
        [sys.executable, "-m", "spacemap_vtk.workers", function],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**environment, "PYTHONPATH": paths, "PYTHONSAFEPATH": "1", EXPENDABLE: "1"},
        **more,
    )


def ask(
    child: subprocess.Popen[bytes], task: Any
) -> tuple[Any | Exception, subprocess.Popen[bytes] | None]:
    """Return what a process makes of a task, and the process if it lives."""
    assert child.stdin is not None
    assert child.stdout is not None
    try:
        pickle.dump(task, child.stdin)
        child.stdin.flush()
        return pickle.load(child.stdout), child
    except (EOFError, OSError, pickle.UnpicklingError):
        end(child)
        code = child.returncode
        why = f"signal {signal.Signals(-code).name}" if code < 0 else f"status {code}"
        return EndedError(f"its process ended by {why}{_ENDS.get(code, '')}"), None


def end(child: subprocess.Popen[bytes]) -> None:
    """Let a process go: it ends when nobody asks it any more."""
    for stream in (child.stdin, child.stdout):
        assert stream is not None
        with suppress(OSError):  # what was written has not arrived
            stream.close()
    child.wait()


def told(error: BaseException) -> bytes:
    """Return an error as bytes, its words alone where it is one that no bytes bring back."""
    try:
        answer = pickle.dumps(error)
        pickle.loads(answer)
    except Exception:
        answer = pickle.dumps(SpacemapError(str(error) or type(error).__name__))
    return answer


def named(function: str) -> Callable[[Any], Any]:
    """Return the function that "module:name" names."""
    module, _, name = function.partition(":")
    return getattr(import_module(module), name)


def main() -> None:
    """Answer what comes by standard input until that is closed."""
    # Ctrl-C reaches all processes of a terminal: the one that has started this one ends it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # What a library prints is no answer.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    function = named(sys.argv[1])
    while True:
        try:
            task = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        try:
            answer = pickle.dumps(function(task))
        except Exception as error:
            answer = told(error)
        try:
            answers.write(answer)
            answers.flush()
        except OSError:  # nobody waits for it
            return


if __name__ == "__main__":
    main()
