"""Fuzzing: pass damaged files and texts through every reader, in processes that may die.

    python tests/fuzz.py .wif .ply scene --runs 100000 --seed 1 [--guided] [--keep FOLDER]

A run changes one of a target's seeds in a few steps and reads it as a command would. It must give a
result or a `SpacemapError` that says what is wrong, print nothing, raise no Python warning, and use
at most `SECONDS` of processor time and `MEMORY` bytes more. Anything else, also the end of the
process, is reported once for each place, and its input is kept. The same seed gives the same runs;
with --guided, atheris chooses the steps by the branches that they reach (pip install
'spacemap_vtk[fuzz]'). fuzz.toml lists the runs and the faults found; test_fuzz.py runs a sample.

The program lets another process read a mesh first (`spacemap_vtk.io.crash_check`), which takes ten
times as long. Meshes are therefore read here as that process reads them. A file that ends this
process is read once more by the program as it is, which must refuse it. If the program reads the
file, an earlier file has damaged the process, and this is reported too.
"""

from __future__ import annotations

import argparse
import faulthandler
import io
import json
import mmap
import os
import random
import re
import resource
import select
import shutil
import signal
import struct
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from fuzz_rare import NAMED
from fuzz_seeds import LONGEST, WORD, beside, changed, seeds

from spacemap_vtk.io import registry
from spacemap_vtk.workers import WORKER_VARIABLE

SECONDS, MEMORY = 5.0, 2**31
#: Free memory that the program sees, in bytes.
FREE = 2**29
#: Wall time after which a run is ended [s], on a machine that has other work.
HUNG = 120.0
#: Runs of one process where VTK reads, which leaves in memory some of what it refuses.
TOGETHER = 1000

#: What atheris watches: where files and words are understood.
INSTRUMENTED = [
    *(f"spacemap_vtk.{part}" for part in ("io", "scenes", "parameters", "parameterised", "units")),
    *(
        f"spacemap_vtk.{part}"
        for part in ("cache", "mechanics.boundary.places", "filters.load", "textile.drafts.loom")
    ),
    *("tomllib", "json", "zipfile", "xml.etree", "numpy.lib", "meshio"),
]

#: Which run is under way, how many were refused, whether it has ended a process that was to read it
#: without a trial, the length of its data; this follows.
_BOARD = struct.Struct("<qqqq")


class Target:
    """What is read, and what of."""

    def __init__(self, name: str, kind: str, read: Callable[[bytes, Path], None]) -> None:
        self.name, self.kind, self.read = name, kind, read
        ending = kind.removeprefix("motion").removeprefix("record")
        #: Whether VTK or meshio read it, which another process tries first.
        read_by_vtk = {*registry.reader_endings("mesh"), *registry.reader_endings("motion"), *NAMED}
        self.tried = ending in read_by_vtk

    @cached_property
    def seeds(self) -> list[bytes]:
        return seeds(self.kind)

    @cached_property
    def words(self) -> list[bytes]:
        """What is written into other places."""
        found = {word for seed in self.seeds for word in WORD.findall(seed[:4096])}
        return sorted(found)[:2000] or [b"a"]

    def changed(self, data: bytes, rng: random.Random) -> bytes:
        """Change a file in a few steps that a generator chooses."""
        steps = [
            (rng.getrandbits(8), rng.getrandbits(40), rng.getrandbits(30))
            for _ in range(rng.choice((1, 1, 2, 3, 5, 9)))
        ]
        return changed(data, steps, self.words, rng.choice(self.seeds))


# --- the targets


def _in_file(name: str, read: Callable[[Path], Any]) -> Callable[[bytes, Path], None]:
    def run(data: bytes, folder: Path) -> None:
        path = folder / name
        path.write_bytes(data)
        read(path)

    return run


def _named(file: str, by: str) -> Callable[[bytes, Path], None]:
    """Read a file that is whole, and names one that is not."""

    def run(data: bytes, folder: Path) -> None:
        (folder / file).write_bytes(data)
        _object(folder / by)

    return run


def _scene(path: Path) -> None:
    from spacemap_vtk.scenes.scene import Scene

    Scene.read(path).check()


def _draft(path: Path) -> None:
    from spacemap_vtk.io.drafts.draft_file import read_draft
    from spacemap_vtk.scenes.scene import Scene

    draft = read_draft(path)
    if path.stat().st_size % 32 == 0:  # what building it begins with takes ten times as long
        read_draft(path, trim=True)
        if path.suffix in (".wif", ".dtx", ".wpo"):
            Scene.read(path).check()
    assert draft.drawdown.size


def _object(path: Path) -> None:
    from spacemap_vtk.io.reading import read_object

    read_object(path)


def _motion(path: Path) -> None:
    from spacemap_vtk import MotionReader

    reader = MotionReader(file=path)
    reader.update(0.0)
    reader.update(0.75)


def _record(path: Path) -> None:
    from spacemap_vtk.io.provenance import read_record
    from spacemap_vtk.scenes.scene_record import restore_scene

    record = read_record(path)
    if record is not None:
        restore_scene(record, [path.parent])


def _cache_entry(data: bytes, folder: Path) -> None:
    """Read a damaged cache entry as the stages do."""
    from spacemap_vtk import cache
    from spacemap_vtk.filters import modal_solver, transient_response

    os.environ[cache.VARIABLE] = str(folder)
    for name in ("modes-a-2", "steps-a-0"):
        (folder / f"{name}-{cache._FORMAT}.npz").write_bytes(data)
    found = modal_solver._read_modes("a", 2, 8)
    assert found is None or found[1].shape[1:] == (8, 3)
    for row in transient_response._read_states("a"):
        assert row.ndim == 2


@cache
def _empty_scene() -> Any:
    from spacemap_vtk.scenes.scene import Scene

    return Scene({})


def _set(data: bytes, folder: Path) -> None:
    from spacemap_vtk.scenes.assignments import parse_value_list
    from spacemap_vtk.scenes.scene import Scene

    text = os.fsdecode(data)  # as the command line has it
    parse_value_list(text, _empty_scene().parts)
    if len(data) % 16 == 0:  # what connects the stages anew takes ten times as long
        Scene({}).set(text)


def _command(*words: str) -> Callable[[bytes, Path], None]:
    """Run a command on a file in {}; it must end with 0 and a complete file, or write none."""

    def run(data: bytes, folder: Path) -> None:
        from contextlib import redirect_stderr, redirect_stdout

        from spacemap_vtk.cli.main import main
        from spacemap_vtk.errors import InputError

        given, made = [folder / Path(word.format(folder)).name for word in words if "{}" in word]
        given.write_bytes(data)
        before = {*folder.iterdir()}
        printed = io.StringIO()
        with redirect_stderr(printed), redirect_stdout(printed):
            try:
                main([word.format(folder) for word in words])
            except SystemExit as end:
                code = end.code
        rest = sorted({*folder.iterdir()} - before)
        assert rest == ([made] if code == 0 else []), f"exit {code} leaves {rest}"
        assert code in (0, 2), f"exit {code}: {printed.getvalue()[-300:]}"
        if code == 0:
            made.unlink()
        else:
            raise InputError(printed.getvalue().removeprefix("spacemap: "))

    return run


def _table(path: Path) -> None:
    from spacemap_vtk.errors import InputError

    with suppress(InputError):
        registry.read(path, "table")
    registry.read(path, "column")


def _texture(path: Path) -> None:
    from spacemap_vtk.io.texture_atlas import read_picture

    read_picture(path)


@cache
def targets() -> dict[str, Target]:
    """Return all targets by name; each registered ending is one."""
    found = [
        Target("scene", "scene", _in_file("a.toml", _scene)),
        Target("set", "set", _set),
        Target("modes", "modes", _cache_entry),
        Target("table", "table", _in_file("a.csv", _table)),
        Target("picture", "picture", _in_file("a.png", _draft)),
        Target("texture", "picture", _in_file("a.png", _texture)),
    ]
    for ending in [*registry.reader_endings("draft"), ".txt"]:
        found.append(Target(ending, ending, _in_file(f"a{ending}", _draft)))
    for ending in registry.reader_endings("mesh"):
        found.append(Target(ending, ending, _in_file(f"a{ending}", _object)))
    for ending in registry.reader_endings("motion"):
        kind = f"motion{ending}"
        found.append(Target(kind, kind, _in_file(f"a{ending}", _motion)))
    for file, by in NAMED.items():
        found.append(Target(f"{by}:{file}", file, _named(file, by)))
    for ending in (".wif", ".html", ".png", ".vtp", ".glb"):
        kind = f"record{ending}"
        found.append(Target(kind, kind, _in_file(f"a{ending}", _record)))
    for given, made in ((".wif", ".dtx"), (".dtx", ".wif"), (".wpo", ".txt"), (".txt", ".wif")):
        words = "convert", "{}/a" + given, "{}/b" + made
        found.append(Target(f"convert{given}", given, _command(*words)))
    words = "export", "{}/a.ply", "-o", "{}/b.vtp", "--quiet"
    found.append(Target("export.ply", ".ply", _command(*words)))
    return {target.name: target for target in found}


# --- a run


def limit_resources() -> None:
    """Limit the memory that the program sees, and raise Python warnings as errors."""
    from spacemap_vtk import memory
    from spacemap_vtk.errors import SpacemapWarning
    from spacemap_vtk.io import crash_check

    memory.available_bytes = crash_check.available_bytes = lambda: FREE
    crash_check._MOST_SECONDS = 1
    os.environ["SPACEMAP_CACHE"] = "off"
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", SpacemapWarning)


def fault(target: Target, data: bytes, folder: Path) -> tuple[bool, tuple[str, str] | None]:
    """Read once; return whether it was refused, and the fault and its place if there is one."""
    from spacemap_vtk.errors import MissingLibraryError, SpacemapError

    begin, reported = time.process_time(), os.fstat(2).st_size
    refused, found = False, None
    try:
        target.read(data, folder)
    except SpacemapError as error:
        refused, text = True, str(error)
        if isinstance(error, RuntimeError) and not isinstance(error, MissingLibraryError):
            found = type(error).__name__, text[:300]
        elif not 12 < len(text) < 5000 or len(text.splitlines()) > 1 or " object at 0x" in text:
            found = "message", f"{len(text)} characters: {text[:300]}"
    except (Exception, SystemExit) as error:
        places = traceback.extract_tb(error.__traceback__)
        own = [place for place in places if "spacemap_vtk" in place.filename] or places
        at = " < ".join(f"{Path(place.filename).name}:{place.name}" for place in own[:-4:-1])
        found = f"{type(error).__name__} at {at}", str(error)[:200]
    seconds = time.process_time() - begin
    if found is None and os.fstat(2).st_size != reported:
        found = "printed", ""
    if found is None and seconds > SECONDS:
        found = "slow", f"{seconds:.1f} s"
    return refused, found


def write_companions(folder: Path) -> None:
    """Write the files that the tested files refer to."""
    for name, content in beside().items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


def work(target: Target, board: mmap.mmap, one: Campaign) -> None:
    """Do the remaining runs, and write the current one into shared memory."""
    size = int(Path("/proc/self/statm").read_text().split()[0]) * mmap.PAGESIZE
    index, refused, ended, _ = _BOARD.unpack_from(board)
    first, seen = index, set[str]()

    def run(data: bytes) -> None:
        nonlocal index, refused, ended
        _BOARD.pack_into(board, 0, index, refused, ended, len(data))
        board[_BOARD.size : _BOARD.size + len(data)] = data
        if target.tried and not ended:
            os.environ[WORKER_VARIABLE] = "1"
            signal.setitimer(signal.ITIMER_PROF, 0.5)  # ends this process
        said_no, wrong = fault(target, data, one.room)
        signal.setitimer(signal.ITIMER_PROF, 0)
        os.environ.pop(WORKER_VARIABLE, None)
        slow = ended == -signal.SIGPROF  # here, and not within what a trial may take
        if ended and not slow and not said_no and wrong is None:
            wrong = f"ended by {-ended} after others", f"{index}: alone it is read"
        index, refused, ended = index + 1, refused + said_no, 0
        if wrong is not None and wrong[0] not in seen:
            seen.add(wrong[0])
            one.save(data, *wrong)

    if one.guided:
        import atheris

        def mutated(data: bytes, most: int, number: int) -> bytes:
            rng = random.Random(number)
            if rng.random() < 0.4:
                return bytes(atheris.Mutate(data, most))
            return target.changed(data, rng)[:most]

        for number, content in enumerate(target.seeds):
            (one.corpus / str(number)).write_bytes(content)
        limits = [f"-runs={one.runs - first}", f"-seed={one.seed + first}", f"-max_len={LONGEST}"]
        limits += ["-timeout=600", f"-rss_limit_mb={(size + MEMORY) >> 20}"]
        atheris.Setup([sys.argv[0], *limits, str(one.corpus)], run, custom_mutator=mutated)
        atheris.Fuzz()
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))
    last = min(one.runs, index + TOGETHER) if target.tried else one.runs
    while index < last:
        rng = random.Random(f"{one.seed} {target.name} {index}")
        run(target.changed(rng.choice(target.seeds), rng))
    _BOARD.pack_into(board, 0, index, refused, 0, 0)


class Campaign:
    """Runs of a target, in a new process after each one that died."""

    def __init__(self, name: str, runs: int, seed: int, keep: Path, guided: bool = False) -> None:
        self.name, self.runs, self.seed, self.keep, self.guided = name, runs, seed, keep, guided
        self.corpus, self.room = (
            keep / f"{kind}-{name.replace('/', '-')}" for kind in ("corpus", "room")
        )
        self.corpus.mkdir(parents=True, exist_ok=True)

    def run(self) -> dict[str, Any]:
        """Do the runs; return the record of the campaign."""
        begin, log, edges = time.monotonic(), self.keep / "log", 0
        board = mmap.mmap(-1, _BOARD.size + LONGEST)
        target = targets()[self.name]
        self.room.mkdir(exist_ok=True)
        if target.tried:
            write_companions(self.room)
            if not self.guided:  # what reads is imported, what tries is started, before any fork
                for seed in target.seeds:
                    fault(target, seed, self.room)
        while (now := _BOARD.unpack_from(board))[0] < self.runs:
            child = os.fork()
            if child == 0:
                with log.open("wb") as printed:
                    os.dup2(printed.fileno(), 1)
                    os.dup2(printed.fileno(), 2)
                faulthandler.enable(sys.__stderr__)
                try:
                    work(target, board, self)
                    os._exit(0)
                except BaseException:
                    traceback.print_exc()
                    os._exit(70)
            since, watch = time.monotonic(), os.pidfd_open(child)
            while not select.select([watch], [], [], 1.0)[0]:
                if _BOARD.unpack_from(board) != now:
                    now, since = _BOARD.unpack_from(board), time.monotonic()
                elif time.monotonic() - since > HUNG:
                    os.kill(child, signal.SIGABRT)  # it shows where it stands
                    since = float("inf")
            os.close(watch)
            code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
            index, refused, ended, size = _BOARD.unpack_from(board)
            text = log.read_text(errors="replace")
            edges = max([edges, *map(int, re.findall(r"cov: (\d+)", text))])
            if code == 0:
                if self.guided:
                    _BOARD.pack_into(board, 0, self.runs, refused, 0, 0)
            elif target.tried and not ended:
                _BOARD.pack_into(board, 0, index, refused, code, 0)
            else:
                stack = re.findall(r'File ".*?([^/"]+)", line \d+ in (\w+)', text)
                at = " < ".join(f"{file}:{function}" for file, function in stack[:4])
                data = board[_BOARD.size : _BOARD.size + size]
                self.save(data, f"ended by {code} at {at}", text)
                _BOARD.pack_into(board, 0, index + 1, refused, 0, 0)
        refused = _BOARD.unpack_from(board)[1]
        shutil.rmtree(self.room)
        made = {"target": self.name, "by": "atheris" if self.guided else "steps"}
        made |= {"seed": self.seed, "runs": self.runs, "refused": refused}
        made |= {"edges": edges} if self.guided else {}
        found = sum(each["target"] == self.name for each in self.found())
        return made | {"found": found, "seconds": round(time.monotonic() - begin)}

    def found(self) -> list[dict[str, str]]:
        """Return the faults found so far in this folder, of all targets."""
        file = self.keep / "found.jsonl"
        return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []

    def save(self, data: bytes, kind: str, what: str) -> None:
        """Save a fault unless the same was found before."""
        known = self.found()
        if any((each["target"], each["kind"]) == (self.name, kind) for each in known):
            return
        name = f"{self.name.strip('.')}-{len(known)}".replace("/", "-")
        (self.keep / name).write_bytes(data)
        line = {"target": self.name, "kind": kind, "what": what[:300], "file": name}
        with (self.keep / "found.jsonl").open("a") as file:
            file.write(json.dumps(line) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("targets", nargs="*")
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--guided", action="store_true")
    parser.add_argument("--keep", type=Path)
    given = parser.parse_args()
    # What has threads cannot be forked; Numba would compile what atheris has put in.
    os.environ |= {"VTK_SMP_BACKEND_IN_USE": "Sequential", "OPENBLAS_NUM_THREADS": "1"}
    if given.guided:
        import atheris

        with (
            atheris.instrument_imports(include=INSTRUMENTED),
            tempfile.TemporaryDirectory() as room,
        ):
            for name in given.targets or targets():
                for seed in targets()[name].seeds:  # what reads it is imported now
                    fault(targets()[name], seed, Path(room))
    limit_resources()
    keep = given.keep or Path(tempfile.mkdtemp())
    for name in given.targets or targets():
        made = Campaign(name, given.runs, given.seed, keep, given.guided).run()
        words = (f"{key} = {json.dumps(value)}" for key, value in made.items())
        print(f"    {{ {', '.join(words)} }},", flush=True)
    print(f"# faults are in {keep}", file=sys.stderr)


if __name__ == "__main__":
    main()
