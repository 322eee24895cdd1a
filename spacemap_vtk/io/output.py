"""Output files that appear whole or not at all.

What is written lies in a hidden folder beside its target, on the same disk, until it is whole and
the disk has it; then it takes the target's place, in one step.

VTK's writers must not be let near a disk: on a full one they end the program (.vtp, .vtu), or say
nothing and leave half a file (.ply). What they write they write to memory, and `write` to the disk,
because Python tells each fault. Pillow tells each fault, too, and ffmpeg by its exit status.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.io.registry import writers
from spacemap_vtk.vanishing import undisturbed, vanishing_folder

_ROOM = "Make room there, or choose a folder on another disk."
_OTHER = "Choose another folder, or see to its permissions."
#: Why a disk takes no file, and what helps.
_REFUSALS = {
    getattr(errno, "EDQUOT", None): ("your quota of this disk is used up", _ROOM),
    errno.ENOSPC: ("disk full", _ROOM),
    errno.EFBIG: ("no file may be so large", 'See "ulimit -f", or choose another disk.'),
    errno.EROFS: ("the disk is read-only", "Choose a folder on another disk."),
    errno.EACCES: ("permission denied", _OTHER),
    errno.EPERM: ("permission denied", _OTHER),
}


def check_output(path: Path, formats: dict[str, str], numbered: bool = False) -> None:
    """Refuse an output path that cannot be written, before any work is done for it."""
    if path.suffix.lower() not in formats:
        raise InputError(
            f"{path}: the ending {path.suffix or 'is missing and'} names no format"
            if not path.suffix
            else f'{path}: format "{path.suffix}" is not known here',
            allowed=", ".join(f"{ending} ({what})" for ending, what in formats.items()),
        )
    if not numbered and (number := re.search(r"%\d*d(?![a-z])", path.name)):
        one = path.with_name(path.name.replace(number[0], "0001"))
        raise InputError(
            f"{path}: one file is written here, no series of numbered ones",
            allowed=f"a name without {number[0]}, for example {one}",
            cure='Write one for each --time; numbered pictures are what "spacemap animate" writes.',
        )
    if path.parent.exists() and not path.parent.is_dir():
        raise InputError(
            f"{path}: {path.parent} is a file, not a folder", cure="Choose another folder."
        )
    if not path.parent.is_dir():
        raise InputError(
            f"{path}: the folder {path.parent} does not exist",
            cure=f'Try "mkdir -p {path.parent}".',
        )
    if path.is_dir():
        raise InputError(
            f"{path}: a folder of that name is in the way", cure="Choose another name."
        )
    if not os.access(path.parent, os.W_OK):
        why = "is on a read-only disk" if _read_only(path.parent) else "is not writable"
        raise InputError(f"{path}: the folder {path.parent} {why}", cure="Choose another folder.")


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a path to write to; it takes the place of `path` when the block ends well."""
    with whole_folder(path) as folder:
        yield folder / path.name
        if not (folder / path.name).is_file():
            raise SpacemapError(f"{path}: nothing was written")


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Yield a new folder; its files move into the folder of `path` when the block ends well."""
    with telling_refusals(path), vanishing_folder(path.parent) as folder:
        yield folder
        if not any(folder.iterdir()):
            raise SpacemapError(f"{path}: nothing was written")
        for file in folder.rglob("*"):
            if file.is_file():
                _make_last(file)
        with undisturbed():
            _move(sorted(folder.iterdir()), path.parent)


@contextmanager
def telling_refusals(path: Path, name: str = "") -> Iterator[None]:
    """Tell in the user's words why a disk does not take a file."""
    try:
        yield
    except OSError as error:
        named = error.filename
        elsewhere = isinstance(named, str) and not Path(named).is_relative_to(path.parent)
        if error.errno is None or error.errno == errno.EPIPE or elsewhere:
            raise
        why, cure = _REFUSALS.get(error.errno, (os.strerror(error.errno).lower(), None))
        # Not the name in the error: it is that of a folder which the user has never heard of.
        raise SpacemapError(f"{name or path}: could not be written: {why}", cure=cure) from error


def write(file: Path, parts: Iterable[Any]) -> None:
    """Write a file whose content is known."""
    size = 0
    with file.open("wb") as stream:
        for part in parts:
            size += stream.write(part)
    if file.stat().st_size != size:
        raise SpacemapError(f"{file.name}: the disk has not kept all that was written")


def require_room(path: Path, size: int, what: str) -> None:
    """Refuse what would not fit onto a disk, before all of its room is taken."""
    free = shutil.disk_usage(path.parent).free
    if size > free:
        raise SpacemapError(
            f"{path.name}: {what} take about {size / 1e6:.3g} MB more, and the disk has "
            f"{free / 1e6:.3g} MB free",
            cure=_ROOM,
        )


def stands_in_the_way(target: Path, folder: bool) -> bool:
    """Return whether what is there must stay: all but a file, or a series, of the same name."""
    if not folder or not target.is_dir():
        return target.exists() and target.is_dir() != folder
    ours = re.compile(rf"{re.escape(target.name)}_\d+\.\w+")
    return not all(ours.fullmatch(each.name) and each.is_file() for each in target.iterdir())


def check_folder(file: Path) -> None:
    """Refuse a file whose others would lie in a folder that is another's."""
    lists = {ending for w in writers() if w.require is check_folder for ending in w.endings}
    others = map(file.with_suffix, sorted(lists - {file.suffix.lower()}))
    if other := next((each for each in others if each.exists()), None):
        raise InputError(
            f"{file}: its files would lie in {file.with_suffix('')}, in place of those of {other}",
            cure="Choose another name.",
        )
    if stands_in_the_way(folder := file.with_suffix(""), folder=True):
        raise InputError(
            f"{file}: its files would lie in {folder}, where others are",
            cure="Choose another name.",
        )


def _read_only(folder: Path) -> bool:
    # Windows knows neither.
    return hasattr(os, "statvfs") and bool(os.statvfs(folder).f_flag & os.ST_RDONLY)


def _make_last(file: Path) -> None:
    """Wait until the disk has a file: some tell only then that there was no room for it."""
    with file.open("rb+") as stream:
        try:
            os.fsync(stream.fileno())
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # of disks that cannot be asked
                raise


def _move(files: list[Path], target: Path) -> None:
    """Let files appear in a folder: all, or on a fault none, and what was there is back."""
    if len(files) < 2:
        for file in files:
            os.replace(file, target / file.name)  # at no moment there is none
        return
    for file in files:
        if stands_in_the_way(target / file.name, file.is_dir()):
            kind = errno.EISDIR if (target / file.name).is_dir() else errno.ENOTDIR
            raise OSError(kind, "in the way", str(target / file.name))
    older = files[0].with_name("older")
    older.mkdir()
    try:
        for file in files:
            with suppress(FileNotFoundError):
                os.replace(target / file.name, older / file.name)
            os.replace(file, target / file.name)
    except OSError:
        for file in files:
            if not file.exists():
                os.replace(target / file.name, file)
            if (older / file.name).exists():
                os.replace(older / file.name, target / file.name)
        raise
