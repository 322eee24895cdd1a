"""Output files that appear whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from spacemap_vtk.errors import InputError


def check_output(path: Path, formats: dict[str, str]) -> None:
    """Refuse an output path that cannot be written, before any work is done for it.

    Parameters
    ----------
    path : Path
        The file to be written.
    formats : dict of str to str
        Allowed endings, and what each is.

    Raises
    ------
    InputError
        If the format is unknown, or the folder does not exist.
    """
    if path.suffix.lower() not in formats:
        raise InputError(
            f"{path}: the ending {path.suffix or 'is missing and'} names no format"
            if not path.suffix
            else f'{path}: format "{path.suffix}" is not known here',
            allowed=", ".join(f"{ending} ({what})" for ending, what in formats.items()),
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
        raise InputError(
            f"{path}: the folder {path.parent} is not writable", cure="Choose another folder."
        )


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a path to write to; it takes the place of `path` when the block ends well.

    Parameters
    ----------
    path : Path
        The file wanted.

    Yields
    ------
    Path
        A file of the same ending in a new folder beside it.
    """
    with whole_folder(path.parent) as folder:
        yield folder / path.name


@contextmanager
def whole_folder(target: Path) -> Iterator[Path]:
    """Yield a new folder; its files move into `target` when the block ends well.

    Parameters
    ----------
    target : Path
        An existing folder.

    Yields
    ------
    Path
        A folder on the same disk, so that moving is renaming.

    Raises
    ------
    InputError
        If `target` takes no new folder.
    """
    try:
        folder = Path(tempfile.mkdtemp(prefix=".spacemap-", dir=target))
    except OSError as error:
        # Not the new folder's name, which the user has never heard of.
        raise InputError(
            f"{target}: nothing can be written to this folder ({error.strerror})",
            cure="Choose another one, or make room and see to its permissions.",
        ) from error
    try:
        yield folder
        for file in sorted(folder.iterdir()):
            os.replace(file, target / file.name)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
