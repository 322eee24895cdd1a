"""TextileSource: textiles whose yarns are relaxed by their own mechanics, as Bézier patches."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk import cache
from spacemap_vtk.datasets.arrays import add_array, add_number
from spacemap_vtk.datasets.cloth_data import set_patches
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.base import ProvidedArray, Stage, modification_time
from spacemap_vtk.filters.textile import FabricFigure, Textile
from spacemap_vtk.filters.textile_file import (
    FileYarns,
    file_figures,
    make_file_yarns,
    piece_of,
)
from spacemap_vtk.io import registry
from spacemap_vtk.mechanics.equilibrium.energy_terms import digest_of
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import Bools, Floats
from spacemap_vtk.parameters import (
    Choice,
    Color,
    FilePath,
    Flag,
    Integer,
    Parameter,
    Real,
    Series,
    Vector,
)
from spacemap_vtk.textile.rods.knit import (
    POINTS,
    Selvedges,
    relax_knit,
    relax_selvedges,
    repeat_knit,
    strip_wales,
)
from spacemap_vtk.textile.rods.stitches import GRAMMAR, STRUCTURES, parse_rows
from spacemap_vtk.textile.rods.tubes import PARTS, sweep_yarns
from spacemap_vtk.textile.rods.yarns import Yarn, measure_thickness
from spacemap_vtk.textile.weave.yarn import COTTON, PACKING, section_factor

#: Length of yarn in a stitch, in diameters, if none is given.
STITCH = 16.0
#: Diameter of the yarn of a knit, if none is given [m].
DIAMETER = 5e-4
#: Parameters that only one kind has.
_KNIT, _FILE = {"kind": ("knit",)}, {"kind": ("file",)}
#: Colour of yarns, if none is given.
COLOR = (200, 85, 61)
#: Bytes for each part of a tube, measured and rounded up.
_PART_BYTES = 2000


class Stitches(Parameter[Any]):
    """Rows of stitches: a structure's name, or letters."""

    kind = "stitches"
    annotation = "str or sequence of str"
    expected = GRAMMAR

    def convert(self, value: Any) -> tuple[str, ...]:
        """Convert to rows of equal length."""
        return parse_rows(value)

    def text(self, value: Any) -> str:
        """Format as a structure's name, or as rows with commas."""
        names = [name for name, rows in STRUCTURES.items() if rows == value]
        return f'"{names[0]}"' if names else f'"{", ".join(value)}"'


class TextileSource(Textile, Stage):
    """Make a knit whose yarns have come to rest, or yarns of a file, as bicubic Bézier patches.

    Yarns are elastic rods: inextensible, round, without friction, straight if free. Their loops are
    drawn from the stitches and relaxed to the least bending energy, in a repeat whose size follows
    from the yarns alone. Courses run along x, wales along y, and the face looks along z.

    Notes
    -----
    Real knits have friction and are set by washing or steaming, so that measured spacings differ:
    D. L. Munden, "The Geometry and Dimensional Properties of Plain-knit Fabrics", J. Textile Inst.
    50 (1959) T448, found loop length over course and wale spacing of 5.5 and 4.2 for fully relaxed
    wool at any stitch length; here they are 5.4 and 4.0 for 16 diameters, and change with it.

    Examples
    --------
    >>> from spacemap_vtk import TextileSource
    >>> TextileSource(rows="rib 1x1", wales=10).rows
    ('kp',)
    """

    section = "textile"
    role = "source"
    provides: ClassVar = {
        "yarn": ProvidedArray("cell"),
        "family": ProvidedArray("cell"),
        "color": ProvidedArray("cell"),
    }

    kind = Choice(
        "knit",
        "Kind of textile. knit: from stitches; file: yarns that another program made.",
        ["knit", "file"],
    )
    rows = Stitches("stockinette", "Stitches of a repeat, seen from the face.", when=_KNIT)
    wales = Integer(8, "Number of stitches in a course.", minimum=1, maximum=10_000, when=_KNIT)
    courses = Integer(8, "Number of courses.", minimum=1, maximum=10_000, when=_KNIT)
    file = FilePath(
        None,
        "File of yarns: .tg3, .bcc, .yarns, .csv, or lines in .vtp.",
        automatic="no file",
        when=_FILE,
    )
    relax = Flag(False, "Let the yarns of a file come to rest; ends of yarns are held.", when=_FILE)
    repeats = Vector(
        (1, 1),
        "Number of cells of a file that are drawn, along its two periods.",
        component=Integer(1, "Number of cells.", minimum=1, maximum=10_000),
        labels="xy",
        when=_FILE,
    )
    period = Vector(
        None,
        "Length of the cell along x and y, for files without one; 0: none.",
        component=Real(0.0, "Length.", unit="m", minimum=0.0, usual_units="mm"),
        labels="xy",
        automatic="that of the file",
        when=_FILE,
    )
    keep_cell = Flag(False, "Keep the size of the cell while yarns come to rest.", when=_FILE)
    unit = Real(
        None,
        "Length of 1 in the file.",
        unit="m",
        above=0.0,
        usual_units="mm",
        automatic="that of the file, else 1 mm",
        when=_FILE,
    )
    diameter = Real(
        None,
        "Diameter of the yarn.",
        unit="m",
        above=0.0,
        plausible=(1e-6, 0.05),
        usual_units="mm",
        automatic="0.5 mm; of a file, its own",
    )
    stitch_length = Real(
        None,
        "Length of yarn in a stitch.",
        unit="m",
        above=0.0,
        plausible=(1e-5, 1.0),
        usual_units="mm",
        automatic="16 diameters",
        when=_KNIT,
    )
    fibre_density = Real(
        COTTON, "Density of the fibres; the default is that of cotton.", unit="kg/m3", above=0.0
    )
    packing = Real(
        PACKING, "Share of fibre in a yarn's section; the rest is air.", above=0.0, maximum=1.0
    )
    color = Series(
        Color(COLOR, "Colour of the courses or yarns; a list is repeated over them."),
        automatic="#c8553d; of a file, its own",
    )

    edges = Choice(
        "cut",
        "Sides of the piece. cut: each course is a yarn of its own; turned: the yarn turns at the "
        "selvedges and knits the next course, except where the colour changes. Selvedges take some "
        "seconds to relax, and need 3 wales.",
        ["cut", "turned"],
        when=_KNIT,
    )

    #: What was relaxed last, with its digest: a repeat in diameters, and its selvedges.
    _relaxed: tuple[str, list[Yarn], Floats, float] | None = None
    _selvedges: tuple[str, Selvedges] | None = None
    _read: tuple[Any, FileYarns] | None = None

    def _of_file(self) -> FileYarns:
        """Return the yarns of a cell of the file."""
        if self.file is None:
            raise InputError(
                "no file is given", key="file", allowed=registry.describe_readers("yarns")
            )
        given = (self.file, self.unit, self.diameter, self.period, self.relax, self.keep_cell)
        state = *given, modification_time(self.file)
        if self._read is None or self._read[0] != state:
            self._read = state, make_file_yarns(*given, progress=self.report_progress)
        return self._read[1]

    @property
    def _size(self) -> float:
        """Diameter of the yarn of a knit [m]."""
        return DIAMETER if self.diameter is None else self.diameter

    def _rest(self) -> tuple[list[Yarn], Floats, float]:
        """Return the relaxed yarns of a repeat, its cell, and the largest overlap; in diameters."""
        length = self._stitch_diameters
        key = digest_of("knit", *self.rows, length)
        if self._relaxed is None or self._relaxed[0] != key:
            shape = (len(self.rows), POINTS * len(self.rows[0]), 3)
            found = cache.load(key, points=shape, cell=(2, 3), overlap=(1,))
            if found is None:
                made = relax_knit(self.rows, length, self.report_progress)
                points = np.stack([yarn.points for yarn in made.yarns])
                found = {"points": points, "cell": made.cell, "overlap": np.array([made.overlap])}
                cache.store(key, **found)
            yarns = [Yarn(points, (1, 0)) for points in found["points"]]
            self._relaxed = key, yarns, found["cell"], float(found["overlap"][0])
        return self._relaxed[1:]

    @property
    def _stitch_diameters(self) -> float:
        return STITCH if self.stitch_length is None else self.stitch_length / self._size

    def _sides(self) -> Selvedges | None:
        """Return the relaxed selvedges, in diameters; None if the courses are cut."""
        if self.edges == "cut" or self.wales < 3:
            return None
        yarns, cell, _ = self._rest()
        strip = strip_wales(len(self.rows[0]), self.wales)
        key = digest_of("selvedges", *self.rows, self._stitch_diameters, strip)
        if self._selvedges is None or self._selvedges[0] != key:
            sides = (-1, -1, 3)
            found = cache.load(key, left=sides, right=sides, turns=sides, overlap=(1,))
            if found is None:
                made = relax_selvedges(
                    yarns, cell, self._stitch_diameters, self.wales, self.report_progress
                )
                found = {"left": made.left, "right": made.right, "turns": made.turns}
                found["overlap"] = np.array([made.overlap])
                cache.store(key, **found)
            overlap = float(found.pop("overlap")[0])
            self._selvedges = key, Selvedges(**found, wales=strip, overlap=overlap)
        return self._selvedges[1]

    def _courses(self) -> tuple[NDArray[np.uint8], Bools]:
        """Return the colour of each course, and whether its yarn is that of the course below."""
        given = np.reshape(COLOR if self.color is None else self.color, (-1, 3)).astype(np.uint8)
        colors = given[np.arange(self.courses) % len(given)]
        alike = (colors[1:] == colors[:-1]).all(axis=1)
        return colors, alike & (self.edges == "turned" and self.wales >= 3)

    @property
    def yarn_diameters(self) -> Floats:
        """Diameter of each yarn, or height of a flat one [m]."""
        if self.kind == "file":
            made = self._of_file()
            return np.array([made.yarns[k].diameter for k in piece_of(made, self.repeats).yarns])
        return np.full(self.courses - int(self._courses()[1].sum()), self._size)

    @property
    def closed(self) -> bool:
        """Whether caps close the ends of yarns: always."""
        return True

    @property
    def linear_densities(self) -> Floats:
        """Mass per length of each yarn [kg/m]."""
        areas = section_factor(1.0, "circular") * self.yarn_diameters**2
        if self.kind == "file":
            made = self._of_file()
            areas = areas * made.aspects[piece_of(made, self.repeats).yarns]
        return self.fibre_density * self.packing * areas

    @property
    def figures(self) -> list[FabricFigure]:
        """Spacings, lengths, thickness, and mass per area."""
        if self.kind == "file":
            return file_figures(self._of_file(), self.fibre_density * self.packing)
        yarns, cell, overlap = self._rest()
        if (sides := self._sides()) is not None:
            overlap = max(overlap, sides.overlap)
        wale = float(cell[0, 0]) / len(self.rows[0]) * self._size
        course = float(cell[1, 1]) / len(self.rows) * self._size
        loop = self.stitch_length or STITCH * self._size
        thickness = measure_thickness(yarns, cell) * self._size
        mass = float(self.linear_densities[0]) * loop / (wale * course)
        return [
            FabricFigure("course_spacing", "course spacing", course, "m"),
            FabricFigure("wale_spacing", "wale spacing", wale, "m"),
            FabricFigure("loop_length", "loop length", loop, "m"),
            FabricFigure("kc", "loop length over course spacing", loop / course),
            FabricFigure("kw", "loop length over wale spacing", loop / wale),
            FabricFigure("thickness", "thickness", thickness, "m"),
            FabricFigure("areal_mass", "mass per area", mass, "kg/m2"),
            FabricFigure("largest_overlap", "largest overlap over the diameter", overlap),
        ]

    def run(self, inputs: list[Any], output: vtkUnstructuredGrid, time: float) -> None:
        """Relax a repeat, and sweep the yarns of the piece."""
        if self.kind == "file":
            self._run_file(output)
            return
        parts = self.wales * self.courses * POINTS * PARTS
        require_memory(
            parts * _PART_BYTES,
            f"a knit of {self.wales} x {self.courses} stitches",
            key="wales",
            value=self.wales,
            cure="Use fewer wales and courses.",
        )
        yarns, cell, _ = self._rest()
        colors, joined = self._courses()
        sides = self._sides()
        lines = repeat_knit(yarns, cell, self.wales, self.courses, sides, joined.tolist())
        lines = [line * self._size for line in lines]
        low, high = (
            end(np.stack([end(line, axis=0) for line in lines]), axis=0) for end in (np.min, np.max)
        )
        made = sweep_yarns([line - (low + high) / 2 for line in lines], self.yarn_diameters)
        set_patches(output, made)
        cells = output.GetCellData()
        add_array(cells, "yarn", made.line)
        add_array(cells, "family", np.zeros(len(made.line), dtype=np.int32))
        add_array(cells, "color", colors[np.append(True, ~joined)][made.line])
        mass = next(one.value for one in self.figures if one.key == "areal_mass")
        assert mass is not None
        add_number(output.GetFieldData(), "areal_mass", mass)

    def _run_file(self, output: vtkUnstructuredGrid) -> None:
        """Sweep the yarns of a file."""
        made = self._of_file()
        for note in made.notes:
            self.warn(note)
        piece = piece_of(made, self.repeats)
        require_memory(
            sum(map(len, piece.lines)) * PARTS * _PART_BYTES,
            f"{len(piece.lines)} yarns of a file",
            key="repeats",
            value=self.repeats,
            cure="Use fewer repeats.",
        )
        swept = sweep_yarns(piece.lines, self.yarn_diameters, made.aspects[piece.yarns])
        set_patches(output, swept)
        cells = output.GetCellData()
        add_array(cells, "yarn", swept.line)
        add_array(cells, "family", np.zeros(len(swept.line), dtype=np.int32))
        given = np.reshape(COLOR if self.color is None else self.color, (-1, 3)).astype(np.uint8)
        colors = given[np.array(piece.yarns) % len(given)]
        if self.color is None:
            for line, yarn in enumerate(piece.yarns):
                if (own := made.colors[yarn]) is not None:
                    colors[line] = own
        add_array(cells, "color", colors[swept.line])
        for one in self.figures:
            if one.key == "areal_mass" and one.value is not None:
                add_number(output.GetFieldData(), "areal_mass", one.value)
