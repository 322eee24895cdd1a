"""Write an output file, or a folder of files, whole or not at all.

Output is first written into a hidden folder next to its target, on the same disk. When it is
complete and the disk has stored it, it replaces the target. Several files and folders are moved
one after another; the file that names the others is moved last.

VTK's writers must not write to a disk. On a full disk they end the program (.vtp, .vtu), or report
nothing and leave half a file (.ply). They write to memory instead, and `write_parts` writes the
bytes to the disk, because Python reports every error. Pillow reports every error too, and ffmpeg
does so by its exit status.
"""

from __future__ import annotations

import csv
import errno
import os
import re
import shutil
import stat
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from io import StringIO
from pathlib import Path
from pickle import PickleBuffer
from typing import Any

from spacemap_vtk.errors import InputError, SpacemapError
from spacemap_vtk.io.registry import writer_endings, writers
from spacemap_vtk.temporary_files import delay_signals, temporary_folder

#: Number of bytes at a file's end that are read back to check it.
_END_BYTES = 64
#: Characters that XML cannot hold and VTK cannot open: control characters, and bytes that are not
#: UTF-8.
_UNREADABLE = re.compile(r"[\x00-\x1f\x7f\ud800-\udfff]")
#: Commands with the keys of `registry.DATA` and `registry.DRAWN` that they write.
_COMMANDS = (
    ("render", ("picture",)),
    ("animate", ("film",)),
    ("export", (None,)),
    ("figure", ("plot",)),
)
_ROOM_CURE = "Free some space, or choose a folder on another disk."
_FOLDER_CURE = "Choose another folder, or change its permissions."
#: Reason and cure for each system error with which a disk refuses a file.
_DISK_ERRORS = {
    getattr(errno, "EDQUOT", None): ("your quota on this disk is used up", _ROOM_CURE),
    errno.ENOSPC: ("disk full", _ROOM_CURE),
    errno.EFBIG: ("the file is larger than allowed", 'Raise "ulimit -f", or choose another disk.'),
    errno.EROFS: ("the disk is read-only", "Choose a folder on another disk."),
    errno.EACCES: ("permission denied", _FOLDER_CURE),
    errno.EPERM: ("permission denied", _FOLDER_CURE),
}


def _other_command(ending: str) -> str | None:
    """Return a sentence with the command that writes files with an ending; None without one."""
    for command, kinds in _COMMANDS:
        if any(ending in writer_endings(kind) for kind in kinds):
            return f'"spacemap {command}" writes {ending}.'
    return None


def check_output(path: Path, formats: dict[str, str], numbered: bool = False) -> None:
    """Refuse an output path that cannot be written, before any work is done for it."""
    if path.suffix.lower() not in formats:
        raise InputError(
            f'{path}: unsupported format "{path.suffix}"'
            if path.suffix
            else f"{path}: the name needs an ending",
            allowed=", ".join(f"{ending} ({what})" for ending, what in formats.items()),
            cure=_other_command(path.suffix.lower()),
        )
    if not numbered and (number := re.search(r"%\d*d(?![a-z])", path.name)):
        example = path.with_name(path.name.replace(number[0], "0001"))
        raise InputError(
            f"{path}: this command writes one file, not a numbered series",
            allowed=f"a name without {number[0]}, for example {example}",
            cure='Write one file for each --time, or numbered pictures with "spacemap animate".',
        )
    if _UNREADABLE.search(path.name):
        raise InputError(
            f"{path}: the name must be UTF-8 without control characters",
            cure="Choose another name.",
        )
    if os.path.isfile(path.parent):
        raise InputError(
            f"{path}: {path.parent} is a file, not a folder", cure="Choose another folder."
        )
    if not os.path.isdir(path.parent):
        raise InputError(
            f"{path}: the folder {path.parent} does not exist",
            cure=f'Try "mkdir -p {path.parent}".',
        )
    _require_file_or_nothing(path)
    try:
        # Permissions alone prove nothing: they allow root to write even where it cannot.
        with temporary_folder(path.parent):
            pass
    except OSError as error:
        why, cure = _DISK_ERRORS.get(error.errno or 0, ("it cannot be written to", _FOLDER_CURE))
        if cure != _ROOM_CURE:  # a small file may still fit
            raise InputError(f"{path}: the folder {path.parent}: {why}", cure=cure) from None


def _require_file_or_nothing(path: Path) -> None:
    """Refuse a path that is not a regular file: it would be replaced, not written through."""
    try:
        mode = os.lstat(path).st_mode
    except (FileNotFoundError, PermissionError):  # check_output tests the folder afterwards
        return
    except OSError as error:
        why = os.strerror(error.errno or 0).lower()
        raise InputError(f"{path}: {why}", cure="Choose another name.") from None
    if stat.S_ISLNK(mode):
        target = os.readlink(path)
        raise InputError(
            f"{path} is a link to {target}",
            cure="Remove the link, or write to its target.",
        )
    if not stat.S_ISREG(mode):
        what = "folder" if stat.S_ISDIR(mode) else "device or pipe"
        raise InputError(f"{path}: a {what} of that name exists", cure="Choose another name.")


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yield a path to write to; the file replaces `path` when the block ends without an error."""
    with atomic_files(path) as folder:
        yield folder / path.name
        if not (folder / path.name).is_file():
            raise SpacemapError(f"{path}: nothing was written")


@contextmanager
def atomic_files(path: Path) -> Iterator[Path]:
    """Yield a new folder; if the block ends without an error, its files move next to `path`."""
    with explain_disk_errors(path), temporary_folder(path.parent) as folder:
        yield folder
        if not any(folder.iterdir()):
            raise SpacemapError(f"{path}: nothing was written")
        for each in folder.rglob("*"):
            _flush_to_disk(each)
        with delay_signals():
            _move_files(folder, path)
            _flush_to_disk(path.parent)


@contextmanager
def explain_disk_errors(path: Path, name: str = "") -> Iterator[None]:
    """Replace a system error about a file by an error in words for the user."""
    try:
        yield
    except OSError as error:
        filename = error.filename
        elsewhere = isinstance(filename, str) and not Path(filename).is_relative_to(path.parent)
        if error.errno is None or error.errno == errno.EPIPE or elsewhere:
            raise
        why, cure = _DISK_ERRORS.get(error.errno, (os.strerror(error.errno).lower(), None))
        # The system error names the hidden folder, which the user does not know.
        raise SpacemapError(f"{name or path}: could not be written: {why}", cure=cure) from error


def write_parts(file: Path, parts: Iterable[Any]) -> None:
    """Write a file from its parts, and check that its end was stored."""
    size, end = 0, b""
    with file.open("wb") as stream:
        for part in parts:
            size += stream.write(part)
            end = bytes(PickleBuffer(part).raw()[-_END_BYTES:]) or end  # works for any array
    with file.open("rb") as stream:
        stream.seek(max(0, size - len(end)))
        if stream.read(len(end) + 1) != end:
            raise SpacemapError(f"{file.name}: the disk has not stored all of the file")


def format_csv(rows: Iterable[Sequence[object]]) -> str:
    """Return rows as the text of a CSV table."""
    stream = StringIO()
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue()


def require_disk_space(path: Path, size: int, what: str) -> None:
    """Refuse output that is larger than the free space of the disk, before it is written."""
    free = shutil.disk_usage(path.parent).free
    if size > free:
        raise SpacemapError(
            f"{path.name}: {what} need about {size / 1e6:.3g} MB more, and the disk has "
            f"{free / 1e6:.3g} MB free",
            cure=_ROOM_CURE,
        )


def is_foreign(target: Path, folder: bool) -> bool:
    """Return whether a target must not be replaced: neither a file nor a series of that name."""
    if not folder or not target.is_dir():
        return target.exists() and target.is_dir() != folder
    ours = re.compile(rf"{re.escape(target.name)}_\d+\.\w+")
    return not all(ours.fullmatch(each.name) and each.is_file() for each in target.iterdir())


def check_folder(file: Path) -> None:
    """Refuse a file if the folder for its other files belongs to something else."""
    lists = {ending for w in writers() if w.require is check_folder for ending in w.endings}
    others = map(file.with_suffix, sorted(lists - {file.suffix.lower()}))
    folder, why = file.with_suffix(""), ""
    if other := next((each for each in others if each.exists()), None):
        why = f"which has the files of {other}"
    elif is_foreign(folder, folder=True):
        why = "which has other files"
    if why:
        raise InputError(
            f"{file}: its files belong in {folder}, {why}", cure="Choose another name."
        )


def _flush_to_disk(path: Path) -> None:
    """Wait until a file is on the disk; some disks report only then that they are full."""
    # A folder is flushed too; otherwise its file names may be lost. Windows cannot open a folder.
    if path.is_dir() and os.name == "nt":
        return
    with ExitStack() as closed:
        try:
            handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
            closed.callback(os.close, handle)
            os.fsync(handle)
        except OSError as error:
            # Some disks cannot flush, and some folders may not be opened; both are accepted.
            if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EACCES):
                raise


def _move_files(folder: Path, path: Path) -> None:
    """Move files next to their folder, unless one would replace what belongs to another."""
    files = sorted(folder.iterdir(), key=lambda file: (file.name == path.name, file.name))
    for file in files if len(files) > 1 else ():
        target = path.parent / file.name
        if is_foreign(target, file.is_dir()):
            kind = errno.EISDIR if target.is_dir() else errno.ENOTDIR
            raise OSError(kind, "exists", str(target))
    for file in files:
        _replace(file, path.parent / file.name)


def _replace(source: Path, target: Path) -> None:
    """Move a file or folder to its target, replacing an earlier one."""
    if not (source.is_dir() and target.is_dir()):
        os.replace(source, target)  # raises an error if a file would replace a folder
        return
    # Folders cannot be exchanged in one call. The older one moves into the hidden folder, which
    # is deleted afterwards.
    older = source.with_name(f"{source.name}.older")
    os.replace(target, older)
    try:
        os.replace(source, target)
    except OSError:
        os.replace(older, target)
        raise
