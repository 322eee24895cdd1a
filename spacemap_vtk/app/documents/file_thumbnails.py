"""Thumbnails of the user's files: small pictures of the view, kept in the folder of the cache."""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path

from PySide6.QtCore import QRect, Qt
from PySide6.QtGui import QImage

from spacemap_vtk import cache
from spacemap_vtk.draw import thumbnails
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.io.output import atomic_file

#: More thumbnails than these are deleted, the oldest first.
_MOST_FILES = 40


def thumbnail_of(file: Path) -> Path | None:
    """Return the thumbnail of a file; None if there is none, or if the file has changed since."""
    picture = _path_of(file)
    try:
        is_current = picture is not None and picture.stat().st_mtime >= file.stat().st_mtime
    except OSError:
        return None
    return picture if is_current else None


def save_thumbnail(file: Path, view: QImage) -> bool:
    """Save a picture of the view as the thumbnail of a file; return whether that was possible."""
    picture = _path_of(file)
    if picture is None:
        return False
    width, height = thumbnails.SIZE
    fitted = view.size().scaled(width, height, Qt.AspectRatioMode.KeepAspectRatioByExpanding)
    smooth = Qt.TransformationMode.SmoothTransformation
    small = view.scaled(fitted, Qt.AspectRatioMode.IgnoreAspectRatio, smooth)
    cut = QRect(0, 0, width, height)
    cut.moveCenter(small.rect().center())
    with contextlib.suppress(OSError, SpacemapError):  # a full disk, for example
        picture.parent.mkdir(parents=True, exist_ok=True)
        with atomic_file(picture) as part:
            saved = small.copy(cut).save(str(part), "JPG", 84)
        old = sorted(picture.parent.glob("*.jpg"), key=lambda each: each.stat().st_mtime)
        for each in old[:-_MOST_FILES]:
            each.unlink()
        return bool(saved)
    return False


def _path_of(file: Path) -> Path | None:
    folder = cache.folder()
    name = hashlib.sha256(str(file.resolve()).encode()).hexdigest()[:24]
    return None if folder is None else folder / "thumbnails" / f"{name}.jpg"
