"""Cache of results on disk, addressed by content: nothing is solved twice.

- An entry is one file of arrays. Its name is a digest of everything the arrays depend on, so an
  entry never goes out of date.
- An entry is written completely or not at all. A damaged entry counts as missing and is replaced,
  so there is no need to wait until the disk has written it.
- The folder holds little more than `MAX_BYTES` bytes: the least recently used entries are removed.
- The program goes on if the cache fails, for example on a full or read-only disk.

The environment variable SPACEMAP_CACHE names another folder, or switches the cache off (``off``).
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

from spacemap_vtk.temporary_files import temporary_folder

#: Environment variable that names the folder, or switches the cache off.
VARIABLE = "SPACEMAP_CACHE"

#: Limit on the bytes of all entries together.
MAX_BYTES = 2**30

#: The folder is scanned each time this share of `MAX_BYTES` has been stored. Dragging a slider in
#: the window stores dozens of entries a second, and scanning thousands of files for each is slow.
_SCAN_SHARE = 1 / 64
_stored = {"bytes": float("inf")}

#: Part of every entry's name. Change it when the meaning of stored arrays changes.
_FORMAT = "1"


def folder() -> Path | None:
    """Return the folder of the entries; None if the cache is off or there is no home folder."""
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
    """Load all arrays of an entry, or those of the given shapes; -1 matches any length."""
    cache_folder = folder()
    if cache_folder is None:
        return None
    path = _entry_path(cache_folder, key)
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise ValueError(path)  # reading from a pipe would never end
        with zipfile.ZipFile(path) as entry, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # another program may have written the entry
            if sum(member.file_size for member in entry.infolist()) > MAX_BYTES:
                raise ValueError(path)
            every = {name.removesuffix(".npy"): None for name in entry.namelist()}
            arrays = {
                name: _read_array(entry, name, shape) for name, shape in (shapes or every).items()
            }
        os.utime(path)
    except FileNotFoundError:
        return None
    except Exception:  # a damaged file can raise almost any type of error
        with contextlib.suppress(OSError):
            path.unlink()
        return None
    return arrays


def _read_array(entry: zipfile.ZipFile, name: str, shape: tuple[int, ...] | None) -> NDArray[Any]:
    """Read one array and verify its checksum."""
    with entry.open(f"{name}.npy") as stream:
        array: NDArray[Any] = np.lib.format.read_array(stream, allow_pickle=False)
        # Reading past the array makes zipfile verify the checksum at the end of the member, also
        # if a damaged header gives too small a size.
        if stream.read(1) or not (shape is None or _has_shape(array, shape)):
            raise ValueError(name)
    return array


def _has_shape(array: NDArray[Any], shape: tuple[int, ...]) -> bool:
    known = array.dtype in (np.float64, np.int64) and array.ndim == len(shape)
    return known and all(n in (-1, m) for n, m in zip(shape, array.shape, strict=True))


def store(key: str, **arrays: NDArray[Any]) -> None:
    """Store arrays; an entry with the same key is replaced."""
    cache_folder = folder()
    size = sum(array.nbytes for array in arrays.values())
    if cache_folder is None or size > MAX_BYTES / 2:
        return
    with contextlib.suppress(OSError):
        cache_folder.mkdir(parents=True, exist_ok=True)
        scan = _stored["bytes"] + size > _SCAN_SHARE * MAX_BYTES
        with temporary_folder(cache_folder, scan) as temporary:
            np.savez(temporary / "entry.npz", **arrays)  # type: ignore[arg-type]
            os.replace(temporary / "entry.npz", _entry_path(cache_folder, key))
        _stored["bytes"] += size
        if scan:
            _remove_oldest(cache_folder)
            _stored["bytes"] = 0


def _entry_path(cache_folder: Path, key: str) -> Path:
    return cache_folder / f"{key}-{_FORMAT}.npz"


def _remove_oldest(cache_folder: Path) -> None:
    """Remove the least recently used entries until the rest fits."""
    entries = []
    for path in [*cache_folder.glob("*.npz"), *cache_folder.glob("*.part")]:
        with contextlib.suppress(OSError):
            status = path.stat()
            entries.append((status.st_mtime, status.st_size, path))
    total = sum(size for _, size, _ in entries)
    for _, size, path in sorted(entries):
        if total <= MAX_BYTES:
            return
        with contextlib.suppress(OSError):
            path.unlink()
            total -= size
