"""Results kept on disk by content: what was solved once is not solved again.

An entry is one file of arrays under a digest of all that they depend on, so that it is never out of
date. It is written whole or not at all; one that cannot be read, or is not what was stored, counts
as missing and is replaced: so nobody waits until the disk has it. The folder holds `LARGEST` bytes
and little more: the entries longest unused go first. A cache that fails, on a full or read-only
disk, is no reason for the program to.

The environment variable SPACEMAP_CACHE names another folder, or ``off``.
"""

from __future__ import annotations

import contextlib
import os
import stat
import sys
import warnings
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spacemap_vtk.vanishing import vanishing_folder

#: Environment variable that names the folder, or switches the cache off.
VARIABLE = "SPACEMAP_CACHE"

#: Bytes that all entries together may take.
LARGEST = 2**30

#: The folder is looked through when this share of `LARGEST` has been stored since: a drag in the
#: window stores dozens of entries a second, and would look through thousands for each.
_LOOK = 1 / 64
_stored = {"bytes": float("inf")}

#: Part of the names of entries: another one, when what is stored changes its meaning.
_FORMAT = "1"


def folder() -> Path | None:
    """Return where entries lie."""
    chosen = os.environ.get(VARIABLE, "")
    if chosen.lower() in ("off", "0", "no", "false"):
        return None
    if chosen:
        return Path(chosen)
    try:
        home = Path.home()
    except RuntimeError:
        return None
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", home)) / "spacemap_vtk" / "Cache"
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "spacemap_vtk"
    return Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "spacemap_vtk"


def load(key: str, **shapes: tuple[int, ...]) -> dict[str, NDArray[Any]] | None:
    """Return an entry's arrays: all, or some if they are of these shapes; -1 is any length."""
    place = folder()
    if place is None:
        return None
    path = _path(place, key)
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise ValueError(path)  # a pipe never ends
        with zipfile.ZipFile(path) as entry, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of an entry by another program
            if sum(member.file_size for member in entry.infolist()) > LARGEST:
                raise ValueError(path)
            every = {name.removesuffix(".npy"): None for name in entry.namelist()}
            arrays = {name: _read(entry, name, shape) for name, shape in (shapes or every).items()}
        os.utime(path)
    except FileNotFoundError:
        return None
    except Exception:  # whatever makes of damage, in its names, sizes, flags or codes
        with contextlib.suppress(OSError):
            path.unlink()
        return None
    return arrays


def _read(entry: zipfile.ZipFile, name: str, shape: tuple[int, ...] | None) -> NDArray[Any]:
    """Return an array; its checksum, at its end, is looked at even where its header says less."""
    with entry.open(f"{name}.npy") as stream:
        array: NDArray[Any] = np.lib.format.read_array(stream, allow_pickle=False)
        if stream.read(1) or not (shape is None or _fits(array, shape)):
            raise ValueError(name)
    return array


def _fits(array: NDArray[Any], shape: tuple[int, ...]) -> bool:
    known = array.dtype in (np.float64, np.int64) and array.ndim == len(shape)
    return known and all(n in (-1, m) for n, m in zip(shape, array.shape, strict=True))


def store(key: str, **arrays: NDArray[Any]) -> None:
    """Keep arrays, in place of an entry of the same key."""
    place = folder()
    size = sum(array.nbytes for array in arrays.values())
    if place is None or size > LARGEST / 2:
        return
    with contextlib.suppress(OSError):
        place.mkdir(parents=True, exist_ok=True)
        look = _stored["bytes"] + size > _LOOK * LARGEST
        with vanishing_folder(place, look) as room:
            np.savez(room / "entry.npz", **arrays)  # type: ignore[arg-type]
            os.replace(room / "entry.npz", _path(place, key))
        _stored["bytes"] += size
        if look:
            _shrink(place)
            _stored["bytes"] = 0


def _path(place: Path, key: str) -> Path:
    return place / f"{key}-{_FORMAT}.npz"


def _shrink(place: Path) -> None:
    """Remove the entries longest unused until the rest fits."""
    entries = []
    for path in [*place.glob("*.npz"), *place.glob("*.part")]:
        with contextlib.suppress(OSError):
            status = path.stat()
            entries.append((status.st_mtime, status.st_size, path))
    total = sum(size for _, size, _ in entries)
    for _, size, path in sorted(entries):
        if total <= LARGEST:
            return
        with contextlib.suppress(OSError):
            path.unlink()
            total -= size
