"""Files that a user sends to the page: drafts and machine knitting files, in a temporary folder."""

from __future__ import annotations

import re
from contextlib import ExitStack
from pathlib import Path

from spacemap_vtk.errors import InputError, SizeError
from spacemap_vtk.io import registry
from spacemap_vtk.temporary_files import temporary_folder

#: Largest file in bytes; drafts of large cloths have some hundred kilobytes.
MAX_BYTES = 4 * 2**20
#: Most files of a session, all of which are kept for undo.
_MOST_FILES = 64
#: Kinds of files that cannot name other files of this machine, as scenes do.
_KINDS = ("draft", "knit")
#: Most characters of a name, without its ending.
_MAX_NAME = 80


class Uploads:
    """The files that were sent, until the program ends."""

    def __init__(self) -> None:
        self._held = ExitStack()
        self._folder: Path | None = None
        self._count = 0

    def check_name(self, name: str) -> str:
        """Return the name under which a file is stored; refuse kinds of files that are not read."""
        plain = Path(re.split(r"[/\\]", name)[-1])
        if registry.kind_of(plain) not in _KINDS:
            raise InputError(
                "only drafts and machine knitting files can be opened from the page",
                key="file",
                value=plain.name,
                allowed=", ".join(endings()),
                cure='Open other files with "spacemap serve FILE".',
            )
        stem = re.sub(r"[^\w .()+-]", "_", plain.stem).strip(" .")
        return (stem[:_MAX_NAME] or "draft") + plain.suffix.lower()

    def save(self, name: str, data: bytes) -> Path:
        """Store a file, and return its path."""
        name = self.check_name(name)
        if len(data) > MAX_BYTES:
            raise too_large_error(name)
        if self._count == _MOST_FILES:
            raise SizeError(
                "no more files can be opened",
                key="file",
                value=name,
                allowed=f"up to {_MOST_FILES} files",
                cure='Start "spacemap serve" again.',
            )
        if self._folder is None:
            self._folder = self._held.enter_context(temporary_folder())
        self._count += 1
        # A folder of its own, because files of the same name can differ.
        path = self._folder / str(self._count) / name
        path.parent.mkdir()
        path.write_bytes(data)
        return path

    def close(self) -> None:
        """Remove all files."""
        self._held.close()


def endings() -> list[str]:
    """Return the endings of the files that can be sent."""
    return [ending for kind in _KINDS for ending in registry.reader_endings(kind)]


def too_large_error(name: str) -> SizeError:
    """Return the error for a file that is too large."""
    return SizeError(
        "the file is too large",
        key="file",
        value=name,
        allowed=f"up to {MAX_BYTES // 2**20} MiB",
        cure='Open it with "spacemap serve FILE".',
    )
