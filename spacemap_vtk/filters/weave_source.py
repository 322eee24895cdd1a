"""WeaveSource: woven fabric as Bézier patches."""

from __future__ import annotations

from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import VTK_BEZIER_QUADRILATERAL, vtkUnstructuredGrid

from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric import weave
from spacemap_vtk.fabric.draft import Draft
from spacemap_vtk.fabric.draft_file import read_draft
from spacemap_vtk.fabric.settle import Fabric, settle
from spacemap_vtk.filters.arrays import add_array, to_cells, to_points
from spacemap_vtk.filters.base import Stage
from spacemap_vtk.filters.weave_parameters import Pattern, repeat_of
from spacemap_vtk.memory import require
from spacemap_vtk.parameters import Color, FilePath, Integer, Real


class WeaveSource(Stage):
    """Make any woven fabric by Peirce's exact geometry, as bicubic Bézier patches.

    A yarn is arc, straight, arc where it changes side between neighbouring crossings, and straight
    where it floats: warp and weft touch at every crossing and overlap nowhere. Ends (warp) run
    along y, picks (weft) along x, z is the normal of the cloth.

    Notes
    -----
    F. T. Peirce, "The Geometry of Cloth Structure", J. Textile Inst. 28 (1937) T45-T96.

    Examples
    --------
    >>> from spacemap_vtk import WeaveSource
    >>> weave = WeaveSource(ends=7, picks=7, warp_diameter="0.3 mm")
    >>> weave.update()
    >>> weave.GetOutputDataObject(0).GetNumberOfCells()
    1120
    """

    section = "weave"

    pattern = Pattern("plain", "The weave, repeated over the cloth.")
    draft = FilePath(
        None,
        "A draft in place of the pattern: a WIF; a text (.txt, .csv), a row of 0 and 1 for each "
        "pick, the first pick first; or a black-and-white picture (.png and others), a pixel for "
        "each crossing, black where the end lies over the pick, the first pick at the bottom.",
        automatic="no draft",
    )
    ends = Integer(
        None,
        "Number of warp yarns.",
        minimum=1,
        maximum=100_000,
        automatic="the draft's own number, or 7",
    )
    picks = Integer(
        None,
        "Number of weft yarns.",
        minimum=1,
        maximum=100_000,
        automatic="the draft's own number, or 7",
    )
    warp_diameter = Real(
        None,
        "Diameter d1 of the warp yarns.",
        unit="m",
        above=0.0,
        automatic="the draft's thickness, or half the spacing",
    )
    weft_diameter = Real(
        None,
        "Diameter d2 of the weft yarns.",
        unit="m",
        above=0.0,
        automatic="the draft's thickness, or half the spacing",
    )
    warp_spacing = Real(
        None,
        "Distance p1 between neighbouring ends.",
        unit="m",
        above=0.0,
        automatic="the draft's spacing, or 0.5 mm",
    )
    weft_spacing = Real(
        None,
        "Distance p2 between neighbouring picks.",
        unit="m",
        above=0.0,
        automatic="the draft's spacing, or 0.5 mm",
    )
    warp_crimp_height = Real(
        None,
        "Height h1 of the warp's wave, crest to trough of the axis; the weft's is d1 + d2 - h1.",
        unit="m",
        minimum=0.0,
        automatic="the middle of the feasible interval",
    )
    overhang = Real(
        None,
        "How far yarns reach past their last crossing.",
        unit="m",
        above=0.0,
        automatic="half the spacing crossed",
    )
    warp_color = Color("#2d6a8e", "Colour of the warp, unless a draft has its own.")
    weft_color = Color("#e8c78f", "Colour of the weft, unless a draft has its own.")

    @property
    def fabric(self) -> Fabric:
        """The fabric as the parameters ask for it; reads the draft, builds nothing.

        Raises
        ------
        GeometryError
            If the cloth is jammed or impossible.
        InputError
            If the draft cannot be read.
        SizeError
            If the patches would not fit into memory.
        """
        if self.draft is None:
            source = Draft(repeat_of(self.pattern))
            picks, ends = 7, 7
        elif self.pattern != self.parameter("pattern").default:
            raise InputError(
                "there are a pattern and a draft, and a cloth has one weave",
                key="pattern",
                value=self.pattern,
                cure=f"Leave out the pattern, or the draft {self.draft}",
            )
        else:
            source = read_draft(self.draft).draft
            picks, ends = source.drawdown.shape
        ends, picks = self.ends or ends, self.picks or picks
        require(
            weave.estimate_bytes(ends, picks, parts_per_gap=3),
            f"a weave of {ends} x {picks} yarns",
            key="ends",
            value=ends,
            cure="Use fewer ends and picks.",
        )
        measures = {name: value for name, value in self.settings.items() if name in _MEASURES}
        return settle(source, ends=ends, picks=picks, **measures)

    def run(self, inputs: list[Any], output: vtkUnstructuredGrid, time: float) -> None:
        """Build the patches."""
        fabric = self.fabric
        for text in fabric.warnings:
            self.warn(text)
        made = weave.build(fabric.drawdown, fabric.cloth)
        output.SetPoints(to_points(made.points))
        output.SetCells(VTK_BEZIER_QUADRILATERAL, to_cells(made.patches))
        add_array(output.GetCellData(), "yarn", made.yarn)
        add_array(output.GetCellData(), "family", made.family.astype(np.int32))
        colors = np.concatenate([fabric.warp_colors, fabric.weft_colors])
        add_array(output.GetCellData(), "color", colors[made.yarn])
        heights = fabric.cloth.height, fabric.cloth.diameter_sum - fabric.cloth.height
        for family, crimp, height in zip(
            ("warp", "weft"), (made.warp, made.weft), heights, strict=True
        ):
            for name, value in (
                ("theta", crimp.theta),
                ("length", crimp.length),
                ("crimp", crimp.crimp),
                ("height", height),
            ):
                add_array(output.GetFieldData(), f"{family}_{name}", np.array([float(value)]))


#: The parameters that `settle` takes as they are.
_MEASURES = {
    "warp_diameter",
    "weft_diameter",
    "warp_spacing",
    "weft_spacing",
    "warp_crimp_height",
    "overhang",
    "warp_color",
    "weft_color",
}
