"""Read Exodus files: finite elements of Sandia's programs, in netCDF, with all their times."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from spacemap_vtk.errors import InputError
from spacemap_vtk.io.registry import lazy_function, reads, truncated_error

if TYPE_CHECKING:
    from spacemap_vtk.io.series import MeshSeries

_ENDINGS = (".e", ".ex2", ".exo", ".exii")
#: Bytes of a number, by netCDF's code of its type.
_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8, 7: 1, 8: 2, 9: 4, 10: 8, 11: 8}


def _check(path: Path) -> None:
    """Refuse a truncated file, or one that is not Exodus: its library would print at length."""
    with path.open("rb") as file:
        magic = file.read(4)
    if magic[:3] != b"CDF" and magic != b"\x89HDF":
        raise InputError(f"{path}: not an Exodus file: neither netCDF nor HDF5", key="file")
    if is_truncated(path):
        raise truncated_error(path)


# As a mesh, only the first step is read.
reads(*_ENDINGS, label="Exodus", holds="mesh", check=_check, common=False)(
    lazy_function("formats.other_programs", "read_with_pyvista")
)


@reads(
    *_ENDINGS,
    label="Exodus",
    holds="motion",
    check=_check,
    names=lazy_function("file_references", "names_in_hdf"),
)
def open_exodus(path: Path) -> MeshSeries:
    """Open a file with all its steps."""
    from vtkmodules.vtkIOExodus import vtkExodusIIReader

    from spacemap_vtk.io.series import ReaderSeries

    reader = vtkExodusIIReader()

    def select_all_arrays() -> None:
        # The reader would move the points itself, and give this array another name.
        reader.SetApplyDisplacements(0)
        for i in range(reader.GetNumberOfPointResultArrays()):
            reader.SetPointResultArrayStatus(reader.GetPointResultArrayName(i), 1)

    return ReaderSeries(path, reader, select_all_arrays)


def is_truncated(path: Path) -> bool:
    """Return whether a classic netCDF file is truncated; its library reads zeros beyond the end."""
    size = path.stat().st_size
    with path.open("rb") as file:
        magic = file.read(4)
        if magic[:3] != b"CDF" or magic[3:] not in (b"\x01", b"\x02", b"\x05"):
            return False
        try:
            return _Header(file, magic[3], size).end() > size
        except (EOFError, IndexError):  # IndexError: an axis that does not exist
            return True


class _Header:
    def __init__(self, file: BinaryIO, version: int, size: int) -> None:
        self.file, self.size = file, size
        self.count_bytes = 8 if version == 5 else 4
        self.offset_bytes = 4 if version == 1 else 8

    def number(self, size: int = 4) -> int:
        text = self.file.read(size)
        if len(text) < size:
            raise EOFError
        return int.from_bytes(text, "big")

    def count(self) -> int:
        return self.number(self.count_bytes)

    def skip(self, size: int) -> None:
        end = self.file.tell() + -(-size // 4) * 4
        if end > self.size:
            raise EOFError
        self.file.seek(end)

    def attributes(self) -> None:
        self.number()
        for _ in range(self.count()):
            self.skip(self.count())
            kind = self.number()
            self.skip(self.count() * _BYTES.get(kind, 1))

    def end(self) -> int:
        """Return the position at which the last variable ends."""
        records = self.count()
        if records == 256**self.count_bytes - 1:  # the file is still being written
            records = 0
        self.number()
        lengths = []
        for _ in range(self.count()):
            self.skip(self.count())
            lengths.append(self.count())
        self.attributes()
        self.number()
        ends, each = [0], []
        for _ in range(self.count()):
            self.skip(self.count())
            axes = [self.count() for _ in range(self.count())]
            self.attributes()
            size = _BYTES.get(self.number(), 1)
            self.count()  # the stored size is wrong for large variables
            begin = self.number(self.offset_bytes)
            repeated = bool(axes) and lengths[axes[0]] == 0
            for axis in axes[repeated:]:
                size *= lengths[axis]
            if repeated:
                each.append((begin, size))
            else:
                ends.append(begin + size)
        step = (
            sum(-(-size // 4) * 4 for _, size in each) if len(each) > 1 else sum(s for _, s in each)
        )
        ends += [begin + (records - 1) * step + size for begin, size in each if records]
        return max(ends)
