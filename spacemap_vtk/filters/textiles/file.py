"""Yarns that another program made, read from a file."""

from __future__ import annotations

from typing import Any

import numpy as np

from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.base import modification_time
from spacemap_vtk.filters.textile import FabricFigure
from spacemap_vtk.filters.textile_file import (
    FileYarns,
    Piece,
    file_figures,
    make_file_yarns,
    piece_of,
)
from spacemap_vtk.filters.textiles.kind import Rest, TextileKind
from spacemap_vtk.io import registry
from spacemap_vtk.ndarrays import AnyInts, Floats, Ints, Progress
from spacemap_vtk.parameters import FilePath, Flag, Integer, Real, Vector
from spacemap_vtk.textile.rods.tubes import PARTS

#: The yarns that were read last, and from what.
_read: dict[Any, FileYarns] = {}


class File(TextileKind):
    """Yarns of a file, as they are or relaxed."""

    name = "file"

    file = FilePath(
        None,
        "File of yarns: .tg3, .bcc, .yarns, .smobj, .csv, or lines in .vtp.",
        automatic="no file",
    )
    library = FilePath(
        None,
        "Library of faces (.sf) of a stitch mesh (.smobj), with the yarns in each type of face.",
        automatic="the one in the folder of the mesh",
    )
    relax = Flag(False, "Let the yarns of a file come to rest; ends of yarns are held.")
    repeats = Vector(
        (1, 1),
        "Number of cells of a file that are drawn, along its two periods.",
        component=Integer(1, "Number of cells.", minimum=1, maximum=10_000),
        labels="xy",
    )
    period = Vector(
        None,
        "Length of the cell along x and y, for files without one; 0: none.",
        component=Real(0.0, "Length.", unit="m", minimum=0.0, usual_units="mm"),
        labels="xy",
        automatic="that of the file",
    )
    keep_cell = Flag(False, "Keep the size of the cell while yarns come to rest.")
    unit = Real(
        None,
        "Length of 1 in the file.",
        unit="m",
        above=0.0,
        usual_units="mm",
        automatic="that of the file, else 1 mm",
    )

    def _yarns(self, progress: Progress | None = None) -> FileYarns:
        """Return the yarns of a cell of the file."""
        if self.file is None:
            raise InputError(
                "no file is given", key="file", allowed=registry.describe_readers("yarns")
            )
        given = (
            self.file,
            self.unit,
            self.diameter,
            self.period,
            self.relax,
            self.keep_cell,
            self.library,
        )
        times = (modification_time(each) for each in (self.file, self.library) if each)
        state = *given, *times
        if state not in _read:
            made = make_file_yarns(*given, progress=progress)
            _read.clear()
            _read[state] = made
        return _read[state]

    def _piece(self, progress: Progress | None = None) -> Piece:
        return piece_of(self._yarns(progress), self.repeats)

    def lines(self, progress: Progress | None = None) -> list[Floats]:
        """Return the yarns of the piece."""
        return self._piece(progress).lines

    @property
    def size(self) -> float:
        """Diameter of the thickest yarn [m]."""
        return max(yarn.diameter for yarn in self._yarns().yarns)

    def cell_of_sheet(self, progress: Progress | None = None) -> Rest:
        """Return the yarns of the cell, in diameters of the thickest one."""
        made, unit = self._yarns(progress), self.size
        yarns = [
            yarn._replace(points=yarn.points / unit, diameter=yarn.diameter / unit)
            for yarn in made.yarns
        ]
        return Rest(yarns, made.cell / unit, made.overlap)

    @property
    def line_families(self) -> Ints:
        """All yarns are of one family."""
        return np.zeros(len(self._piece().lines), dtype=np.int64)

    @property
    def line_diameters(self) -> Floats:
        """The diameter of each yarn, or the height of a flat one [m]."""
        return np.array([self._yarns().yarns[k].diameter for k in self._piece().yarns])

    @property
    def line_aspects(self) -> Floats:
        """Width over height of each yarn."""
        return self._yarns().aspects[self._piece().yarns]

    @property
    def line_colors(self) -> AnyInts:
        """The given colours, else those of the file."""
        which = self._piece().yarns
        colors = self.palette[np.array(which) % len(self.palette)]
        if self.color is None:
            for line, yarn in enumerate(which):
                if (own := self._yarns().colors[yarn]) is not None:
                    colors[line] = own
        return colors

    @property
    def notes(self) -> list[str]:
        """Sentences about the file."""
        return self._yarns().notes

    @property
    def parts(self) -> int:
        """Number of parts of all tubes."""
        return sum(map(len, self._piece().lines)) * PARTS

    def all_figures(self) -> list[FabricFigure]:
        """Return lengths, cell, thickness and mass."""
        return file_figures(self._yarns(), self.density)
