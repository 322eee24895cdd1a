"""Kill commands at random moments, and check the files that are left.

``python tests/killed.py COUNT SEED [SIGTERM] [NAME ...]`` prints the phase of each kill, and at
the end the counts; ``python tests/killed.py both [NAME ...]`` lets two processes write one output
at the same time.

Each command runs in a fork of this process, which has imported everything and has one thread, so a
run does not take time to start. A third of the kills come at any time of a run, a third while it
writes, and a third before one of its changes to the disk, chosen by number.
"""

from __future__ import annotations

import collections
import json
import os
import pkgutil
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path

# Before NumPy is imported: a fork has none of its threads.
os.environ.update(OPENBLAS_NUM_THREADS="1", QT_QPA_PLATFORM="offscreen")

import numpy as np

WEAVE = "plain_weave --set weave.ends=3 --set weave.picks=3 -q"
FILM = f"animate {WEAVE} --size 64x48 --set animation.stop=0.2 --set animation.speed=1 -o"
#: Commands by the name of their output; commands that need modes also write the cache.
COMMANDS = {
    "a.png": f"render {WEAVE} --size 160x120 -o",
    "a.jpg": f"render {WEAVE} --size 160x120 -o",
    "a.gif": FILM,
    "a.mp4": FILM,
    "a%02d.png": FILM,
    "a.pvd": f"export {WEAVE} --times 0,0.02,0.04 -o",
    "a%02d.vtp": f"export {WEAVE} --times 0,0.02,0.04 -o",
    "a.pvtp": f"export {WEAVE} --pieces 3 -o",
    "a.vtkhdf": f"export {WEAVE} --times 0,0.02 -o",
    "a.vtu": f"export {WEAVE} --what cage -o",
    "a.ply": f"export {WEAVE} -o",
    "a.stl": f"export {WEAVE} -o",
    "a.obj": f"export {WEAVE} -o",
    "a.glb": f"export {WEAVE} --times 0,0.02 -o",
    "a.usdc": f"export {WEAVE} --times 0,0.02 -o",
    "a.html": f"export {WEAVE} --times 0,0.02 -o",
    "a.inp": f"export {WEAVE} -o",
    "a.csv": f"export {WEAVE} -o",
    "a.wif": f"export {WEAVE} -o",
    "a.dtx": "convert given.wif -q",
    "plot.pdf": f"plot {WEAVE} -o",
    "shapes.png": f"modes {WEAVE} --set modal.modes=2 --plot",
    "modes": f"modes {WEAVE} --json",
    "sweep": "sweep plain_weave --set weave.picks=3 --set weave.ends=3,4 -q --workers 1 -o",
    "scene.toml": "",  # saved as the window does it
}
#: Outputs that are written in a small part of a second.
LIGHT = ("a.dtx", "a.wif", "a.pvd", "a.vtkhdf")
CHANGES = ("os.rename", "os.link", "os.mkdir", "os.rmdir", "os.remove", "os.truncate")
Files = dict[str, bytes]


def import_all() -> None:
    """Import all modules that the commands import."""
    import spacemap_vtk

    for each in pkgutil.walk_packages(spacemap_vtk.__path__, "spacemap_vtk."):
        room = each.name.split(".")[1]
        if room not in ("app", "paraview", "__main__") and "speed" not in each.name:
            import_module(each.name)
    for name in ("PIL.Image", "h5py", "pxr.UsdSkel", "matplotlib.figure", "scipy.sparse.linalg"):
        import_module(name)
    import_module("spacemap_vtk.app.documents.document")
    assert len(os.listdir("/proc/self/task")) == 1, "a fork would lack the other threads"


def execute(name: str, place: Path) -> None:
    """Run a command in this process."""
    if name == "scene.toml":
        from spacemap_vtk.app.documents.document import Document

        document = Document()
        document.open("plain_weave")
        document.save(place / name)
        return
    from spacemap_vtk.cli.main import main

    words = [
        str(place / "given.wif") if each == "given.wif" else each for each in COMMANDS[name].split()
    ]
    main([*words, *([] if name == "modes" else [str(place / name)])])


class Run:
    """A command in a process of its own."""

    def __init__(
        self,
        name: str,
        place: Path,
        cache: Path,
        event: int = -1,
        log: int = 0,
        number: int = signal.SIGKILL,
    ) -> None:
        self.log = place.with_name(f"{place.name}.log{log}")
        self.pipe, events = os.pipe()
        self.begun = time.monotonic()
        self.child = os.fork()
        if self.child:
            os.close(events)
            return
        status = 70
        try:
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            out = os.open(self.log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(out, 1)
            os.dup2(out, 2)
            os.environ["SPACEMAP_CACHE"] = str(cache)
            tempfile.tempdir = str(place.parent)
            sys.addaudithook(self.audit_hook(events, event, (str(place), str(cache)), number))
            try:
                execute(name, place)
                status = 0
            except SystemExit as error:
                status = int(error.code or 0)
            if not status:
                os.write(events, b"d")
        except BaseException as error:
            os.write(2, f"Traceback {error!r}".encode())
        finally:
            sys.stdout.flush()
            os._exit(status)

    @staticmethod
    def audit_hook(events: int, event: int, places: tuple[str, ...], number: int):
        """Return an audit hook that reports the first write and each change, and kills at one."""
        left, begun = [event], [False]

        def hook(name: str, arguments: tuple) -> None:
            if name == "open":
                path, mode = arguments[0], arguments[1]
                if (
                    not isinstance(path, str)
                    or not path.startswith(places)
                    or mode in (None, "r", "rb")
                ):
                    return
                if not begun[0] and (".spacemap-" in path or ".frames" in path):
                    begun[0] = True
                    os.write(events, b"w")
            elif name not in CHANGES:
                return
            if begun[0]:
                os.write(events, b".")
                left[0] -= 1
                if left[0] == -1 and event >= 0:
                    os.kill(os.getpid(), number)

        return hook

    def wait(self) -> int:
        """Wait for the end of the process, and return its exit code."""
        status = os.waitpid(self.child, 0)[1]
        self.seconds = time.monotonic() - self.begun
        with open(self.pipe, "rb") as pipe:
            self.events = pipe.read()
        return os.waitstatus_to_exitcode(status)

    def kill_after(self, writing: bool, seconds: float, number: int) -> None:
        """Kill the process some time after its start, or after its first write."""
        if writing:
            os.read(self.pipe, 1)
        time.sleep(seconds)
        os.kill(self.child, number)
        self.wait()
        if writing:
            self.events = b"w" + self.events

    @property
    def phase(self) -> str:
        return "after" if b"d" in self.events else "writing" if b"w" in self.events else "computing"


def files(place: Path) -> Files:
    """Return the files that a user sees, without hidden_folders folders."""
    found = {str(path.relative_to(place)): path for path in place.rglob("*") if path.is_file()}
    return {
        name: path.read_bytes()
        for name, path in found.items()
        if ".spacemap-" not in name and ".frames/" not in name and name != "given.wif"
    }


def hidden_folders(place: Path) -> list[Path]:
    return [*place.glob(".spacemap-*"), *place.glob("*.frames")]


def entries(cache: Path) -> dict[str, dict[str, np.ndarray]]:
    found = {}
    for path in cache.glob("*.npz"):
        with np.load(path, allow_pickle=False) as entry:
            found[path.name] = {key: entry[key] for key in entry.files}
    return found


def drop_varying_files(name: str, found: Files) -> Files:
    """Remove files that differ in each run, because they state the time of a sweep."""
    if name == "sweep":
        for key in [key for key in found if key.endswith((".json", ".csv", "sheet.png"))]:
            if key.endswith(".json"):
                json.loads(found[key])
            del found[key]
    return found


def check_with_other_programs(place: Path) -> None:
    """Read each file with another program."""
    import configparser
    import tomllib
    from xml.etree import ElementTree

    import h5py
    import imageio_ffmpeg
    import meshio
    from PIL import Image
    from pxr import Usd

    for name, data in files(place).items():
        path = place / name
        match path.suffix:
            case ".png" | ".jpg" | ".gif":
                with Image.open(path) as image:
                    for frame in range(getattr(image, "n_frames", 1)):
                        image.seek(frame)
                        image.load()
            case ".mp4":
                assert imageio_ffmpeg.count_frames_and_secs(str(path))[0] > 3
            case ".vtp" | ".pvd" | ".pvtp":
                ElementTree.fromstring(data)
            case ".vtu" | ".ply" | ".stl" | ".obj" | ".inp":
                assert len(meshio.read(path).points) > 20
            case ".vtkhdf":
                with h5py.File(path) as file:
                    assert file["VTKHDF/Steps"].attrs["NSteps"] == 2
            case ".glb":
                assert int.from_bytes(data[8:12], "little") == len(data)
            case ".usdc":
                stage = Usd.Stage.Open(str(path))
                assert stage.GetDefaultPrim()
            case ".wif" | ".dtx" if path.suffix == ".wif":
                configparser.ConfigParser(strict=False).read_string(data.decode())
            case ".toml":
                tomllib.loads(data.decode())
            case ".pdf" | ".html" | ".dtx":
                ends = {".pdf": b"%%EOF", ".html": b"</html>", ".dtx": b"@@End"}
                assert ends.get(path.suffix, b"") in data[-200:], name


class Reference:
    """The output of a command that is not killed."""

    def __init__(self, name: str, room: Path, draft: bytes) -> None:
        self.name, self.draft = name, draft
        self.cache = room / f"{name}.cache"
        self.cache.mkdir()
        place = self.place(room / f"{name}.right", {})
        run = Run(name, place, self.cache)
        assert run.wait() == 0, run.log.read_text()
        assert hidden_folders(place) == hidden_folders(self.cache) == []
        self.files, self.entries = drop_varying_files(name, files(place)), entries(self.cache)
        check_with_other_programs(place)
        self.events = run.events.count(b".")
        # Timed in a second run, because the first one reads libraries from the disk.
        again = Run(name, self.place(room / f"{name}.timed", {}), room / f"{name}.cold")
        os.read(again.pipe, 1)
        before = time.monotonic() - again.begun
        again.wait()
        self.seconds, self.writing = again.seconds, again.seconds - before

    def place(self, place: Path, older: Files) -> Path:
        place.mkdir()
        (place / "given.wif").write_bytes(self.draft)
        for name, data in older.items():
            (place / name).parent.mkdir(exist_ok=True)
            (place / name).write_bytes(data)
        return place


def kill_once(
    reference: Reference, room: Path, chance: random.Random, number: int
) -> tuple[str, bool]:
    """Kill a run and check its files; return its phase, and whether old and new files are mixed."""
    name, right = reference.name, reference.files
    older = {} if name == "sweep" or chance.random() < 0.5 else dict.fromkeys(right, b"older")
    place, cache = reference.place(room / "case", older), room / "cache"
    if chance.random() < 0.5:
        shutil.copytree(reference.cache, cache)
    kind = chance.choice(["any time", "writing", "change"])
    if kind == "change" and reference.events:
        run = Run(name, place, cache, chance.randrange(reference.events), number=number)
        run.wait()
    else:
        writing = kind == "writing"
        run = Run(name, place, cache)
        longest = reference.writing if writing else 1.1 * reference.seconds
        run.kill_after(writing, chance.uniform(0.0, longest), number)
    if number != signal.SIGKILL:
        assert [*room.glob("*/.spacemap-*"), *room.glob(".spacemap-*")] == []

    def is_complete() -> bool:
        """Return whether all files are old or all are new; each must be one of them."""
        found = drop_varying_files(name, files(place))
        for key, data in found.items():
            assert data in (older.get(key), right.get(key)), f"{key}: neither old nor new"
        assert {key for key in older if "/" not in key} <= set(found)
        # Of several files each is old or new; a folder whose place a new one takes may be gone.
        return name == "sweep" or len(right) > 1 or found in (older, right)

    mixed = not is_complete()
    for key, arrays in entries(cache).items():
        for each, array in arrays.items():
            np.testing.assert_array_equal(array, reference.entries[key][each])
    # Another command removes the remains, and the same command makes the output.
    shutil.copy(place / "given.wif", room / "given.wif")
    other = Run("a.dtx", place, cache) if name != "a.dtx" else None
    if other is not None:
        assert other.wait() == 0, other.log.read_text()
        (place / "a.dtx").unlink()
        assert is_complete(), "neither all old nor all new"
        assert list(place.glob(".spacemap-*")) == []
    again = Run(name, place, cache)
    assert again.wait() == 0, again.log.read_text()
    assert "Traceback" not in again.log.read_text()
    assert drop_varying_files(name, files(place)) == right
    assert hidden_folders(place) == hidden_folders(room) == []
    assert entries(cache).keys() >= reference.entries.keys()
    for key, arrays in reference.entries.items():
        for each, array in arrays.items():
            np.testing.assert_array_equal(entries(cache)[key][each], array)
    return run.phase, mixed


def kill(count: int, seed: int, names: list[str], room: Path, signal_: int) -> dict[str, int]:
    """Kill runs; return the number of kills by phase."""
    from conftest import WIF

    import_all()
    chance = random.Random(seed)
    hit: collections.Counter[str] = collections.Counter()
    references = {name: Reference(name, room, WIF.encode()) for name in names}
    # A sweep, of several processes, takes as long as all others together.
    seldom = [name for name in names if name != "sweep"] * 4 + [n for n in names if n == "sweep"]
    for number in range(count):
        name = chance.choice(seldom)
        own = room / str(number)
        own.mkdir()
        try:
            phase, mixed = kill_once(
                references[name], own, random.Random(seed * 100_000 + number), signal_
            )
        except (AssertionError, OSError) as error:
            print(f"{number} {name}: {error!r:.400}, see {own}", flush=True)
            hit["failed"] += 1
            continue
        shutil.rmtree(own)
        hit[phase] += 1
        hit["half moved"] += mixed
        print(number, name, phase, "half moved" * mixed, flush=True)
    return dict(hit)


def write_at_once(names: list[str], room: Path) -> None:
    """Let two processes write one output at once: it is complete, or the error says why not."""
    from conftest import WIF

    import_all()
    for name in names:
        reference = Reference(name, room, WIF.encode())
        for number in range(3):
            place = reference.place(room / f"{name}.{number}", {})
            runs = [Run(name, place, room / f"{name}.{number}.cache", log=k) for k in (0, 1)]
            ends = [run.wait() for run in runs]
            for run, end in zip(runs, ends, strict=True):
                assert end in (0, 2), run.log.read_text()
                assert end == 0 or "is being made by another process" in run.log.read_text()
            assert 0 in ends
            assert drop_varying_files(name, files(place)) == reference.files, name
            assert hidden_folders(place) == [], name
        print(name, "twice at once", ends, flush=True)


def main() -> None:
    if sys.argv[1] == "both":
        with tempfile.TemporaryDirectory(prefix="both-") as folder:
            single = [name for name in COMMANDS if name not in ("sweep", "a.pvd", "a.pvtp")]
            write_at_once(sys.argv[2:] or single, Path(folder))
        return
    count, seed = int(sys.argv[1]), int(sys.argv[2])
    begun = time.monotonic()
    room = Path(tempfile.mkdtemp(prefix="killed-"))
    words = sys.argv[3:]
    number = (
        signal.Signals[words.pop(0)] if words and words[0].startswith("SIG") else signal.SIGKILL
    )
    hit = kill(count, seed, words or list(COMMANDS), room, number)
    print(
        f"{count} times {number.name}, seed {seed}, {time.monotonic() - begun:.0f} s:",
        json.dumps(hit),
    )
    if hit.get("failed"):
        sys.exit(1)
    shutil.rmtree(room)


if __name__ == "__main__":
    main()
