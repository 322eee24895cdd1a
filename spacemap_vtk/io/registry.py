"""Which file formats there are: their endings, what their files hold, who reads and writes them.

`Scene.read`, the dialogs, the command line's help, ParaView's readers and what is said of a file
that is refused are made from this. A format is registered by decorating its functions, here in a
module of `spacemap_vtk.io.formats`, elsewhere anywhere:

    @reads(".abc", label="Alphabet", holds="mesh", check=refuse_short_file)
    def read_abc(path: Path) -> vtkPolyData: ...

    @writes(".abc", label="Alphabet", holds=("surface",))
    def write_abc(file: Path, surface: vtkPolyData) -> None: ...

Where such a function would only import and call another, `of` stands for it.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar

from spacemap_vtk.errors import InputError, MissingLibraryError, UnknownNameError

#: What a file can hold that is read, and what reading it returns.
READ = {
    "scene": "tables of values by section",
    "draft": "a draft",
    "mesh": "any data object of VTK's, or `texture_atlas.Painted`",
    "motion": "`series.MeshSeries`",
    "table": "times and factors",
    "column": "numbers",
}
#: Why a path is that of no file, where another name may help.
NOT_THERE, A_FOLDER = "no such file", "a folder"
#: What data a scene has that is written, in words.
DATA = {
    "patches": "Bézier patches",
    "surface": "Surface",
    "cage": "Cage with its motion",
    "draft": "Weaver's draft",
    "moving": "Surface that moves",
    "modes": "Mode shapes",
    "analysis": "Cage for other solvers",
    "painted": "Surface with its colours",
    "yarns": "Middles of the yarns",
}
#: What is drawn and written, and what its writers take after the file.
DRAWN = {
    "picture": "an array of pixels",
    "film": "arrays of pixels, one after another, and their rate in 1/s",
    "frames": "as a film; the file has a number such as %04d in its name",
    "plot": "a figure of matplotlib's",
}
#: What makes a file of what moves smaller.
SMALLER = "Raise --tolerance, take fewer times, or lower --subdivisions."
_F = TypeVar("_F", bound=Callable[..., Any])


@dataclass(frozen=True)
class Reader:
    """Who reads some endings."""

    #: In small letters, with their dots.
    endings: tuple[str, ...]
    #: What the format is called.
    label: str
    #: A key of `READ`.
    holds: str
    function: Callable[[Path], Any]
    #: Called with the path first; refuses a file that VTK's reader would crash on, or take for
    #: whole though it is truncated.
    check: Callable[[Path], None] | None = None
    #: Returns the words by which a file names others that are read with it.
    names: Callable[[Path], list[str]] | None = None
    #: Whether short lists name it.
    common: bool = True
    #: Whether such files hold other things as well: none is opened as a scene of its own, but they
    #: are read where they are named.
    general: bool = False
    #: Whether it reads files of all endings that nobody else reads.
    rest: bool = False

    def read(self, path: Path) -> Any:
        """Read a file."""
        self.named(path)
        if self.check is not None:
            self.check(path)
        return self.function(path)

    def named(self, path: Path) -> list[str]:
        """Return the words by which a file names others; refuse what no machine should ask for."""
        from spacemap_vtk.parameters import require_near

        found = [] if self.names is None else self.names(path)
        for word in found:
            require_near(word, path)
        return found


@dataclass(frozen=True)
class Writer:
    """Who writes some endings."""

    endings: tuple[str, ...]
    label: str
    #: Keys of `DATA`, the default first, or one of `DRAWN`.
    holds: tuple[str, ...]
    #: Of a file in a folder that is new and may take others beside it, and what it is to hold.
    write: Callable[..., None]
    #: Whether `write` takes not the data but pairs of time in s and data, one after another.
    times: bool = False
    #: Whether it takes the pieces that make up the data, one after another.
    pieces: bool = False
    #: Refuses a file, before any work is done for it, where a library is missing.
    require: Callable[[Path], None] | None = None
    #: Tells what of the data the format cannot hold, in sentences.
    loses: Callable[[Any], list[str]] | None = None
    #: Whether it holds colours that stand for numbers and change with time.
    numbers: bool = False
    #: Bytes that what moves may take in single precision.
    most: int = 2**32
    #: Whether pictures may have a fourth number for each pixel, how much of it is covered.
    alpha: bool = False

    def check(self, path: Path) -> None:
        """Refuse a file that cannot be written here."""
        if self.require is not None:
            self.require(path)


_readers: list[Reader] = []
_writers: list[Writer] = []


def reads(*endings: str, label: str, holds: str, **more: Any) -> Callable[[_F], _F]:
    """Register a function of a path as the reader of files of some endings; more as in `Reader`."""
    _require_known([holds], READ)

    def register(function: _F) -> _F:
        _builtin()
        _readers.append(Reader(endings, label, holds, function, **more))
        return function

    return register


def writes(*endings: str, label: str, holds: tuple[str, ...], **more: Any) -> Callable[[_F], _F]:
    """Register a function of a path and data as their writer; more as in `Writer`."""
    _require_known(holds, {**DATA, **DRAWN})

    def register(function: _F) -> _F:
        _builtin()
        _writers.append(Writer(endings, label, holds, function, **more))
        return function

    return register


def of(module: str, name: str, *more: Any) -> Callable[[Any], Any]:
    """Return a function of a module of `io`, which is imported when it is called."""

    def called(given: Any) -> Any:
        return getattr(import_module(f"spacemap_vtk.io.{module}"), name)(given, *more)

    return called


def needs(package: str, module: str, cure: str) -> Callable[[Path], None]:
    """Return what refuses a file that cannot be written for want of a package."""

    def require(file: Path) -> None:
        if find_spec(module) is None:
            raise MissingLibraryError(
                f"{file.name}: {file.suffix} needs the package {package}", cure=cure
            )

    return require


def forget(function: Callable[..., Any]) -> None:
    """Take back what a function was registered for."""
    _readers[:] = [reader for reader in _readers if reader.function is not function]
    _writers[:] = [writer for writer in _writers if writer.write is not function]


def readers(holds: str) -> list[Reader]:
    """Return the readers of what is a key of `READ`."""
    _builtin()
    return [reader for reader in _readers if reader.holds == holds]


def reader(path: Path, holds: str) -> Reader | None:
    """Return who reads a file, by its ending; of two the one that was registered last."""
    ending = path.suffix.lower()
    able = [each for each in reversed(readers(holds)) if each.rest or ending in each.endings]
    return min(able, key=lambda each: each.rest, default=None)


def read(path: Path, holds: str) -> Any:
    """Read a file; of a kind of which there is a reader for the rest."""
    found = reader(path, holds)
    assert found is not None
    return found.read(path)


def writers(holds: str | None = None) -> list[Writer]:
    """Return the writers of what is a key of `DATA` or `DRAWN`; without one, of any data."""
    _builtin()
    kinds = set(DATA) if holds is None else {holds}
    return [writer for writer in _writers if kinds & set(writer.holds)]


def writer(path: Path, holds: str | None = None) -> Writer:
    """Return who writes a file, by its ending; of two the one that was registered last."""
    ending = path.suffix.lower()
    return next(each for each in reversed(writers(holds)) if ending in each.endings)


def endings(holds: str, common: bool = False) -> list[str]:
    """Return the endings of files that are what is a key of `READ`, and can be nothing else."""
    found = [each for each in readers(holds) if not each.general and (each.common or not common)]
    found.sort(key=lambda reader: not reader.common)
    return _once(ending for reader in found for ending in reader.endings)


def kind_of(path: Path) -> str | None:
    """Return whether a file is a scene, a draft or a mesh, by its ending; None if it is none."""
    kinds = ("scene", "draft", "mesh")
    return next((kind for kind in kinds if path.suffix.lower() in endings(kind)), None)


def written(holds: str | None = None) -> dict[str, str]:
    """Return the endings of what is a key of `DATA` or `DRAWN`, in words; of all data without."""
    found: dict[str, list[str]] = {}
    for each in writers(holds):
        for ending in each.endings:
            words = each.holds if holds is None else [DATA.get(holds, each.label)]
            found[ending] = _once([*found.get(ending, []), *words])
    return {ending: " or ".join(words) for ending, words in found.items()}


def writable(holds: str) -> list[str]:
    """Return the endings of `written` that nothing is missing for here."""
    found = []
    for ending in written(holds):
        with suppress(MissingLibraryError):
            writer(Path(f"a{ending}"), holds).check(Path(f"a{ending}"))
            found.append(ending)
    return found


def endings_with_alpha(holds: str) -> list[str]:
    """Return the endings of pictures or films that can be without background."""
    kinds = ("film", "frames") if holds == "film" else (holds,)
    found = [each for kind in kinds for each in writers(kind) if each.alpha]
    return _once(ending for each in found for ending in each.endings)


def opened_words() -> str:
    """Return what can be opened as a scene, in words."""
    meshes = ", ".join([*endings("mesh", common=True), "..."])
    scenes, drafts = ", ".join(endings("scene")), ", ".join(endings("draft"))
    return f"a scene file ({scenes}), a weaver's draft ({drafts}), a mesh ({meshes})"


def written_words(holds: str | None = None) -> str:
    """Return what `written` does in words, without a key with the data."""
    if holds is not None:
        return _enumerated(written(holds))
    by_data: dict[str, list[str]] = {}
    for ending, data in written().items():
        by_data.setdefault(data, []).append(ending)
    *most, last = (f"{_enumerated(found)} ({data})" for data, found in by_data.items())
    return f"{', '.join(most)}, or {last}"


def read_words(holds: str) -> str:
    """Return what is read as what is a key of `READ`, in words."""
    return ", ".join(f"{each.label} ({', '.join(each.endings)})" for each in readers(holds))


def opened_filters() -> str:
    """Return what a dialog offers that opens scenes, drafts and meshes."""
    first = [*endings("scene"), *endings("draft"), *endings("mesh", common=True)]
    more = [ending for ending in endings("mesh") if ending not in first]
    return ";;".join(
        [
            name_filter("Scenes, drafts, meshes", first),
            name_filter("Other meshes", more),
            "All files (*)",
        ]
    )


def draft_filters() -> str:
    """Return what a dialog offers that opens drafts, those in pictures and texts among them."""
    found = _once(ending for reader in readers("draft") for ending in reader.endings)
    return f"{name_filter('Drafts', found)};;All files (*)"


def written_filters() -> dict[str, str]:
    """Return what a dialog offers that writes data, each with its key of `DATA`."""
    found = {}
    for data, words in DATA.items():
        for ending in written(data):
            series = ", all times" if writer(Path(f"a{ending}"), data).times else ""
            found[name_filter(f"{words}{series}", [ending])] = data
    return found


def name_filter(label: str, endings: Iterable[str]) -> str:
    """Return a line of a dialog that shows files of some endings."""
    return f"{label} ({' '.join(f'*{ending}' for ending in endings)})"


def existing(path: Path, allowed: str | None = None) -> Path:
    """Refuse a file that is not there, or has nothing in it."""
    if why := refusal(path):
        raise InputError(f"{path}: {why}", key="file", allowed=allowed)
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty", key="file")
    return path


def damaged(path: Path, why: str) -> InputError:
    """Return the error for a file that is not as its program has written it."""
    return InputError(f"{path}: {why}", key="file", cure="Write the file again, whole.")


def refusal(path: str | Path) -> str:
    """Return why a path is that of no file which can be read, or nothing."""
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISREG(mode):
            with open(path, "rb"):  # who may, only the system knows
                return ""
    except PermissionError:
        return "permission denied"
    except (OSError, ValueError):  # the second of a name with a null character
        return NOT_THERE
    return A_FOLDER if stat.S_ISDIR(mode) else "a device or a pipe, no file"


def truncated(path: Path) -> InputError:
    """Return the error for a file that ends too early."""
    return damaged(path, "truncated: it holds less than its header promises")


def _require_known(holds: Iterable[str], known: dict[str, str]) -> None:
    for name in holds:
        if name not in known:
            raise UnknownNameError("no file holds that", key=name, allowed=", ".join(known))


def _enumerated(words: Iterable[str]) -> str:
    *most, last = words
    return f"{', '.join(most)} or {last}" if most else last


def _once(words: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(words))


def _builtin() -> None:
    # Before those of anyone else, and when they are asked for: a program that only makes arrays
    # needs none. A no-op while they register themselves.
    import_module("spacemap_vtk.io.formats")
