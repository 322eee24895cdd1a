"""TextileSource: textiles whose yarns are relaxed by their own mechanics, as Bézier patches."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import add_array, add_number
from spacemap_vtk.datasets.cloth_data import CORNER, REPEAT, set_patches
from spacemap_vtk.filters.base import ProvidedArray, Stage
from spacemap_vtk.filters.textile import FabricFigure, StatedYarns, Textile
from spacemap_vtk.filters.textile_sheet import add_textile
from spacemap_vtk.filters.textiles import KINDS
from spacemap_vtk.filters.textiles.kind import TextileKind, combine
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.geometry.weave import PatchCounts
from spacemap_vtk.textile.rods.pieces import repeat_yarns
from spacemap_vtk.textile.rods.tubes import sweep_yarns

#: Cells along each period that are made for a unit cell, the middle one.
_AROUND = 5
#: Bytes for each part of a tube, measured and rounded up.
_PART_BYTES = 2000
#: Control points and patches of each part: three rings of twelve points.
_PART_POINTS = 36
_PART_PATCHES = 4


class TextileSource(combine(KINDS, ["knit"]), Textile, Stage):  # type: ignore[misc]
    """Make a textile of relaxed yarns, or yarns of a file, as bicubic Bézier patches.

    Yarns are elastic rods: round, without friction, straight if free. They are drawn with the right
    crossings and relaxed without passing through each other. A knit's loops have a given length and
    take the least bending energy, in a repeat whose size follows from the yarns alone; the yarns of
    other textiles are pulled taut in a repeat of given size. Courses, picks run along x; wales,
    ends and braids along y; the face looks along z.

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

    @property
    def _textile(self) -> TextileKind:
        """The kind with the values of its parameters."""
        kind, given = KINDS[self.kind], self.given_values
        return kind(**{name: given[name] for name in kind.parameters if name in given})

    @property
    def yarn_diameters(self) -> Floats:
        """Diameter of each yarn [m]."""
        return self._textile.line_diameters

    @property
    def families(self) -> dict[str, int]:
        """Number of yarns in each family."""
        textile = self._textile
        counts = np.bincount(textile.line_families, minlength=len(textile.family_names))
        named = zip(textile.family_names, counts.tolist(), strict=True)
        return {name: count for name, count in named if count}

    @property
    def closed(self) -> bool:
        """Whether caps close the ends of yarns: always."""
        return True

    @property
    def cell(self) -> Floats:
        """Two vectors after which yarns repeat themselves [m], (2, 3); 0 where they do not."""
        textile = self._textile
        return textile.rest().cell * textile.scale

    @property
    def linear_densities(self) -> Floats:
        """Mass per length of each yarn [kg/m]."""
        textile = self._textile
        return textile.mass_per_length(textile.line_diameters) * textile.line_aspects

    @property
    def mechanics(self) -> StatedYarns:
        """Stiffness of the yarns: that of the parameters, which the output states."""
        return StatedYarns()

    @property
    def figures(self) -> list[FabricFigure]:
        """Figures of the kind, thickness, mass, and the largest overlap."""
        return self._textile.all_figures()

    def estimate_patches(self) -> tuple[PatchCounts, int]:
        """Return the numbers of patches without those of ends, and the memory for them [bytes]."""
        parts = self._textile.parts
        return PatchCounts(_PART_POINTS * parts, _PART_PATCHES * parts, parts), _PART_BYTES * parts

    #: Number of cells along both periods that are made instead of the piece; None: the piece.
    _cells: tuple[int, int] | None = None

    def around_repeat(self) -> TextileSource:
        """Return a source of one cell and its neighbours."""
        if not self._textile.rest(self.report_progress).cell.any(axis=1).all():
            return super().around_repeat()
        other = TextileSource(**self.settings)
        other._cells = _AROUND, _AROUND
        return other

    def _run_cells(self, output: vtkUnstructuredGrid, cells: tuple[int, int]) -> None:
        """Make a number of cells, with the repeat in their middle."""
        textile = self._textile
        rest = textile.rest(self.report_progress)
        made, which = repeat_yarns(rest.yarns, rest.cell, cells)
        lines = [line * textile.scale for line in made]
        diameters = np.array([yarn.diameter for yarn in rest.yarns])[which] * textile.scale
        tubes = sweep_yarns(lines, diameters, None)
        set_patches(output, tubes)
        add_array(output.GetCellData(), "yarn", tubes.line)
        field, cell = output.GetFieldData(), rest.cell * textile.scale
        add_array(field, REPEAT, cell.ravel())
        add_array(field, CORNER, (cells[0] // 2) * cell[0] + (cells[1] // 2) * cell[1])

    def run(self, inputs: list[Any], output: vtkUnstructuredGrid, time: float) -> None:
        """Relax a repeat, and sweep the yarns of the piece."""
        textile = self._textile
        if self._cells is not None:
            self._run_cells(output, self._cells)
            return
        require_memory(
            textile.parts * _PART_BYTES,
            f"a textile of {len(textile.line_families)} yarns",
            cure="Use fewer repeats.",
        )
        lines = textile.lines(self.report_progress)
        for note in textile.notes:
            self.warn(note)
        low, high = (
            end(np.stack([end(line, axis=0) for line in lines]), axis=0) for end in (np.min, np.max)
        )
        lines = [line - (low + high) / 2 for line in lines]
        made = sweep_yarns(lines, textile.line_diameters, textile.line_aspects)
        set_patches(output, made)
        cells = output.GetCellData()
        add_array(cells, "yarn", made.line)
        add_array(cells, "family", textile.line_families[made.line].astype(np.int32))
        add_array(cells, "color", textile.line_colors[made.line])
        add_textile(output, textile)
        for one in textile.all_figures():
            if one.key == "areal_mass" and one.value is not None:
                add_number(output.GetFieldData(), "areal_mass", one.value)
