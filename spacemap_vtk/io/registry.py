"""Registry of file formats: their endings, what their files hold, who reads and writes them.

`Scene.read`, the dialogs, the command line's help, ParaView's readers and the messages about
refused files are made from it. A format is registered by decorating its functions. Within this
package they are in a module of `spacemap_vtk.io.formats`; elsewhere they may be anywhere:

    @reads(".abc", label="Alphabet", holds="mesh", check=refuse_short_file)
    def read_abc(path: Path) -> vtkPolyData: ...

    @writes(".abc", label="Alphabet", holds=("surface",))
    def write_abc(file: Path, surface: vtkPolyData) -> None: ...

Use `lazy_function` in place of a function that would only import and call another one.
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

#: What a file that is read can hold, and what its reader returns.
READ = {
    "scene": "tables of values by section",
    "draft": "a draft",
    "mesh": "any VTK data object, or `texture_atlas.TexturedMesh`",
    "motion": "`series.MeshSeries`",
    "table": "times and factors",
    "column": "numbers",
    "yarns": "`textile.rods.curves.CurveSet`",
    "knit": "`yarns.knitout.KnitoutFile`",
}
#: Keys of `READ` that open as a scene.
SCENE_KINDS = ("scene", "draft", "mesh", "knit", "yarns")
#: Reasons why a path cannot be read as a file.
NO_SUCH_FILE = "no such file"
IS_FOLDER = "a folder, not a file"
#: Data of a scene that can be written, in words.
DATA = {
    "patches": "Bézier patches",
    "surface": "Surface",
    "cage": "Cage with its motion",
    "draft": "Weaver's draft",
    "moving": "Moving surface",
    "modes": "Mode shapes",
    "analysis": "Cage for other solvers",
    "painted": "Surface with colours",
    "yarns": "Axes of the yarns",
    "obstacles": "Surfaces of obstacles",
}
#: Output that is drawn and then written, and what its writers receive after the file.
DRAWN = {
    "picture": "an array of pixels",
    "film": "arrays of pixels, one after another, and their rate in 1/s",
    "frames": "as a film; the file has a number such as %04d in its name",
    "plot": "a matplotlib figure",
    "unit_cell": "`unit_cell.phases.UnitCellModel`",
    "pages": "matplotlib figures, one after another",
}
#: How a user makes a file of a moving surface smaller.
SMALLER_FILE_CURE = "Raise --tolerance, use fewer times, or lower --subdivisions."
_F = TypeVar("_F", bound=Callable[..., Any])


@dataclass(frozen=True)
class Reader:
    """A function that reads files of some endings."""

    #: In lower case, with their dots.
    endings: tuple[str, ...]
    #: Name of the format.
    label: str
    #: A key of `READ`.
    holds: str
    function: Callable[[Path], Any]
    #: Called with the path first. Refuses a file on which VTK's reader would crash, or which it
    #: would accept as whole although it is truncated.
    check: Callable[[Path], None] | None = None
    #: Returns the words by which a file names other files that are read with it.
    names: Callable[[Path], list[str]] | None = None
    #: Whether short lists of formats include it.
    common: bool = True
    #: Whether files of these endings hold other things too. Such a file is not opened as a scene by
    #: itself, but it is read where something names it.
    general: bool = False
    #: Whether it reads the files of all endings that no other reader reads.
    rest: bool = False

    def read(self, path: Path) -> Any:
        """Check a file and the names in it, then read it."""
        self.referenced_names(path)
        if self.check is not None:
            self.check(path)
        return self.function(path)

    def referenced_names(self, path: Path) -> list[str]:
        """Return the words by which a file names others; refuse names on other machines."""
        from spacemap_vtk.parameters import require_local_file

        found = [] if self.names is None else self.names(path)
        for word in found:
            require_local_file(word, path)
        return found


@dataclass(frozen=True)
class Writer:
    """A function that writes files of some endings."""

    endings: tuple[str, ...]
    label: str
    #: Keys of `DATA`, the default first, or one of `DRAWN`.
    holds: tuple[str, ...]
    #: Called with a file and what to write. The file is in a new folder that may take others too.
    write: Callable[..., None]
    #: Whether `write` receives, one after another, pairs of time in s and data.
    times: bool = False
    #: Whether `write` receives, one after another, the pieces that make up the data.
    pieces: bool = False
    #: Refuses a file if a library is missing, before any work is done for it.
    require: Callable[[Path], None] | None = None
    #: Returns sentences about what the format cannot store of the data.
    loses: Callable[[Any], list[str]] | None = None
    #: Whether the format stores colours that represent numbers and change with time.
    numbers: bool = False
    #: Whether the format stores how pictures shade a moving surface.
    shaded: bool = False
    #: Most bytes that a moving surface may have in single precision.
    most: int = 2**32
    #: Whether pictures may have a fourth channel, the coverage of each pixel.
    alpha: bool = False

    def check(self, path: Path) -> None:
        """Refuse a file that cannot be written on this machine."""
        if self.require is not None:
            self.require(path)


_readers: list[Reader] = []
_writers: list[Writer] = []


def reads(*endings: str, label: str, holds: str, **more: Any) -> Callable[[_F], _F]:
    """Register a function of a path as a reader of some endings; `more` as in `Reader`."""
    _require_known([holds], READ)

    def register(function: _F) -> _F:
        _load_builtin_formats()
        _readers.append(Reader(endings, label, holds, function, **more))
        return function

    return register


def writes(*endings: str, label: str, holds: tuple[str, ...], **more: Any) -> Callable[[_F], _F]:
    """Register a function of a path and data as a writer; `more` as in `Writer`."""
    _require_known(holds, {**DATA, **DRAWN})

    def register(function: _F) -> _F:
        _load_builtin_formats()
        _writers.append(Writer(endings, label, holds, function, **more))
        return function

    return register


def lazy_function(module: str, name: str, *more: Any) -> Callable[[Any], Any]:
    """Return a function that imports a function of a module of `io` when called, and calls it."""

    def called(given: Any) -> Any:
        return getattr(import_module(f"spacemap_vtk.io.{module}"), name)(given, *more)

    return called


def require_package(package: str, module: str, cure: str) -> Callable[[Path], None]:
    """Return a check that refuses files while a package is not installed."""

    def require(file: Path) -> None:
        if find_spec(module) is None:
            raise MissingLibraryError(
                f"{file.name}: {file.suffix} needs the package {package}", cure=cure
            )

    return require


def unregister(function: Callable[..., Any]) -> None:
    """Remove a function from the registry."""
    _readers[:] = [reader for reader in _readers if reader.function is not function]
    _writers[:] = [writer for writer in _writers if writer.write is not function]


def readers(holds: str) -> list[Reader]:
    """Return the readers of a key of `READ`."""
    _load_builtin_formats()
    return [reader for reader in _readers if reader.holds == holds]


def reader(path: Path, holds: str) -> Reader | None:
    """Return the reader of a file's ending; of several, the one that was registered last."""
    ending = path.suffix.lower()
    able = [each for each in reversed(readers(holds)) if each.rest or ending in each.endings]
    return min(able, key=lambda each: each.rest, default=None)


def read(path: Path, holds: str) -> Any:
    """Read a file of a kind for which one reader reads all remaining endings."""
    found = reader(path, holds)
    assert found is not None
    return found.read(path)


def writers(holds: str | None = None) -> list[Writer]:
    """Return the writers of a key of `DATA` or `DRAWN`; without a key, of all data."""
    _load_builtin_formats()
    kinds = set(DATA) if holds is None else {holds}
    return [writer for writer in _writers if kinds & set(writer.holds)]


def writer(path: Path, holds: str | None = None) -> Writer:
    """Return the writer of a file's ending; of several, the one that was registered last."""
    ending = path.suffix.lower()
    return next(each for each in reversed(writers(holds)) if ending in each.endings)


def reader_endings(holds: str, common: bool = False) -> list[str]:
    """Return the endings that hold only this key of `READ`, common ones first."""
    found = [each for each in readers(holds) if not each.general and (each.common or not common)]
    found.sort(key=lambda reader: not reader.common)
    return _unique(ending for reader in found for ending in reader.endings)


def kind_of(path: Path) -> str | None:
    """Return "scene", "draft", "knit", "yarns" or "mesh" by the file's ending, or None."""
    ending = path.suffix.lower()
    return next((kind for kind in SCENE_KINDS if ending in reader_endings(kind)), None)


def writer_endings(holds: str | None = None) -> dict[str, str]:
    """Return each ending that can be written, with its data in words; without a key, for all."""
    found: dict[str, list[str]] = {}
    for each in writers(holds):
        for ending in each.endings:
            words = each.holds if holds is None else [DATA.get(holds, each.label)]
            found[ending] = _unique([*found.get(ending, []), *words])
    return {ending: " or ".join(words) for ending, words in found.items()}


def available_writer_endings(holds: str) -> list[str]:
    """Return the endings of `writer_endings` for which no library is missing."""
    found = []
    for ending in writer_endings(holds):
        with suppress(MissingLibraryError):
            writer(Path(f"a{ending}"), holds).check(Path(f"a{ending}"))
            found.append(ending)
    return found


def endings_with_alpha(holds: str) -> list[str]:
    """Return the endings of pictures or films that can have a transparent background."""
    kinds = ("film", "frames") if holds == "film" else (holds,)
    found = [each for kind in kinds for each in writers(kind) if each.alpha]
    return _unique(ending for each in found for ending in each.endings)


def describe_scene_files() -> str:
    """Describe in words what can be opened as a scene."""
    meshes = ", ".join([*reader_endings("mesh", common=True), "..."])
    scenes, drafts, knits, yarns = (
        ", ".join(reader_endings(kind)) for kind in ("scene", "draft", "knit", "yarns")
    )
    return (
        f"a scene file ({scenes}), a weaver's draft ({drafts}), a mesh ({meshes}), a machine "
        f"knitting file ({knits}), yarns ({yarns})"
    )


def describe_writers(holds: str | None = None) -> str:
    """Describe in words what `writer_endings` returns; without a key, grouped by the data."""
    if holds is not None:
        return _join_words(writer_endings(holds))
    by_data: dict[str, list[str]] = {}
    for ending, data in writer_endings().items():
        by_data.setdefault(data, []).append(ending)
    *most, last = (f"{_join_words(found)} ({data})" for data, found in by_data.items())
    return f"{', '.join(most)}, or {last}"


def describe_readers(holds: str) -> str:
    """Describe in words the formats that are read for a key of `READ`."""
    return ", ".join(f"{each.label} ({', '.join(each.endings)})" for each in readers(holds))


def scene_dialog_filters() -> str:
    """Return the name filters of a dialog that opens scenes, drafts, knits, yarns and meshes."""
    first = [
        *reader_endings("scene"),
        *reader_endings("draft"),
        *reader_endings("knit"),
        *reader_endings("yarns"),
        *reader_endings("mesh", common=True),
    ]
    more = [ending for ending in reader_endings("mesh") if ending not in first]
    return ";;".join(
        [
            name_filter("Scenes, drafts, knits, meshes", first),
            name_filter("Other meshes", more),
            "All files (*)",
        ]
    )


def draft_dialog_filters() -> str:
    """Return the name filters of a dialog that opens drafts, including pictures and texts."""
    found = _unique(ending for reader in readers("draft") for ending in reader.endings)
    return f"{name_filter('Drafts', found)};;All files (*)"


def export_dialog_filters() -> dict[str, str]:
    """Return the name filters of a dialog that writes data, each with its key of `DATA`."""
    found = {}
    for data, words in DATA.items():
        for ending in writer_endings(data):
            series = ", all times" if writer(Path(f"a{ending}"), data).times else ""
            found[name_filter(f"{words}{series}", [ending])] = data
    return found


def name_filter(label: str, endings: Iterable[str]) -> str:
    """Return one name filter of a dialog."""
    return f"{label} ({' '.join(f'*{ending}' for ending in endings)})"


def require_file(path: Path, allowed: str | None = None) -> Path:
    """Return the path; refuse a file that is missing or empty."""
    if why := unreadable_reason(path):
        raise InputError(f"{path}: {why}", key="file", allowed=allowed)
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty", key="file")
    return path


def damaged_error(path: Path, why: str) -> InputError:
    """Return the error for a damaged file."""
    return InputError(f"{path}: {why}", key="file", cure="Write the file again.")


def unreadable_reason(path: str | Path) -> str:
    """Return why a path cannot be read as a file, or an empty string."""
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISREG(mode):
            with open(path, "rb"):  # only trying shows whether this user may read it
                return ""
    except PermissionError:
        return "permission denied"
    except (OSError, ValueError):  # ValueError: the name has a null character
        return NO_SUCH_FILE
    return IS_FOLDER if stat.S_ISDIR(mode) else "a device or pipe, not a file"


def truncated_error(path: Path) -> InputError:
    """Return the error for a file that ends too early."""
    return damaged_error(path, "truncated: shorter than its header says")


def _require_known(holds: Iterable[str], known: dict[str, str]) -> None:
    for name in holds:
        if name not in known:
            raise UnknownNameError("unknown kind of data", key=name, allowed=", ".join(known))


def _join_words(words: Iterable[str]) -> str:
    *most, last = words
    return f"{', '.join(most)} or {last}" if most else last


def _unique(words: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(words))


def _load_builtin_formats() -> None:
    # The package's own formats must be registered before any others. They are imported only when
    # formats are needed, because a program that only makes arrays needs none. While they register
    # themselves, this call does nothing.
    import_module("spacemap_vtk.io.formats")
