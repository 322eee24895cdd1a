"""WeaveSource: woven fabric as Bézier patches."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

from spacemap_vtk.datasets.arrays import add_array, add_number
from spacemap_vtk.datasets.cloth_data import CORNER, PLACES, REPEAT, add_cloth, set_patches
from spacemap_vtk.datasets.extent import store_bounds
from spacemap_vtk.errors import InfoMessage, InputError
from spacemap_vtk.filters.base import ProvidedArray, Stage, modification_time
from spacemap_vtk.filters.textile import Woven
from spacemap_vtk.filters.weave_parameters import WeaveParameters, parameter_name, pattern_repeat
from spacemap_vtk.io.drafts.draft_file import read_draft
from spacemap_vtk.io.registry import describe_readers, unreadable_reason
from spacemap_vtk.memory import require_memory
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.textile.drafts.draft import Draft
from spacemap_vtk.textile.drafts.drawdown import repeat_size
from spacemap_vtk.textile.geometry import weave
from spacemap_vtk.textile.geometry.cloth_axes import ALL_YARNS, YarnSelection
from spacemap_vtk.textile.geometry.partition import cloth_bounds, crop_cloth, select_piece
from spacemap_vtk.textile.weave.as_draft import as_draft
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.feasible import feasible_intervals
from spacemap_vtk.textile.weave.figures import fabric_figures
from spacemap_vtk.textile.weave.resolve import ClothRequest, ThreadsRequest, resolve
from spacemap_vtk.textile.weave.yarn_library import parse_yarns

#: Ends and picks of a pattern if no number is given.
SIZE = 7
#: Yarns on each side of a repeat that shape it; longer floats are cut.
_NEIGHBOURS = 4
#: Bytes per crossing while a drawdown is repeated.
_CROSSING_BYTES = 4


class WeaveSource(WeaveParameters, Woven, Stage):
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
    >>> weave.update().output.GetNumberOfCells()
    1176
    """

    section = "weave"
    role = "source"
    provides: ClassVar = {
        "yarn": ProvidedArray("cell"),
        "family": ProvidedArray("cell"),
        "color": ProvidedArray("cell"),
    }
    seamless = True

    #: The draft's file with its time, and its contents.
    _read: tuple[tuple[Any, ...], Draft] | None = None
    #: The parameters, and the cloth that they resolve to.
    _resolved: tuple[tuple[Any, ...], Cloth] | None = None
    #: The part of the cloth to make, as the yarns whose crossings it has; None: the whole cloth.
    _part: tuple[YarnSelection, Cloth] | None = None
    #: A cloth, its mass per area and, if pieces were requested, its bounds.
    _whole: tuple[Cloth, float, Floats | None] | None = None

    @property
    def cloth(self) -> Cloth:
        """The cloth that the parameters describe."""
        # Cached, because drawing requests it in every frame.
        key = (*self.settings.values(), *self._draft_state)
        if self._resolved is None or self._resolved[0] != key:
            try:
                source, request = self.source, self.request
            except InputError as error:
                if isinstance(error.value, float) and error.key in self.parameters:
                    error.value = self.parameter(error.key).format(error.value)  # with its unit
                raise
            ends, picks = request.ends or source.size[0], request.picks or source.size[1]
            self._require(_CROSSING_BYTES * ends * picks, ends, picks)
            self._resolved = key, resolve(source, request, parameter_name)
        return self._resolved[1]

    @property
    def counts(self) -> weave.PatchCounts:
        """Upper limits for the numbers of control points and patches."""
        cloth = self.cloth if self._part is None else self._part[1]
        # A piece has its share of the yarns, and at most one yarn more.
        pieces = min(self.piece.total, sum(cloth.size))
        self._require(weave.estimate_bytes(cloth, self.single) // pieces, *cloth.size, pieces)
        return weave.estimate_counts(cloth)

    @property
    def closed(self) -> bool:
        """Whether caps close the ends of yarns."""
        return bool(self.caps)

    @property
    def single(self) -> bool:
        """Whether control points are stored in single precision."""
        return self.precision == "single"

    @property
    def feasible(self) -> dict[str, tuple[float, float]]:
        """Interval of feasible values for each parameter: crimps, diameters, spacings."""
        return {
            parameter_name(*which): ends for which, ends in feasible_intervals(self.cloth).items()
        }

    @property
    def draft_file(self) -> Path | None:
        """File of the draft; None for a pattern."""
        return self.draft

    @property
    def fibre_share(self) -> float:
        """Share of fibre in a yarn's section; the mean of warp and weft."""
        shares = []
        for names in (self.warp_yarn, self.weft_yarn):
            packings = [yarn.material.packing for yarn in parse_yarns(names)] or [self.packing]
            shares.append(sum(packings) / len(packings))
        return 0.5 * sum(shares)

    def make_draft(self) -> Draft:
        """Return the fabric's draft: that of the file, as far as no parameter changes it."""
        # This works also for yarns that do not fit.
        named = self.draft is None and isinstance(self.pattern, str)
        title = self.pattern.capitalize() if named else ""
        return as_draft(self.cloth, self.source, self.request, title)

    def around_repeat(self) -> WeaveSource:
        """Return a source of one repeat and its neighbours."""
        ends, picks = (count + 2 * _NEIGHBOURS for count in self._repeat_size)
        return WeaveSource(**{**self.settings, "ends": ends, "picks": picks})

    @property
    def _repeat_size(self) -> tuple[int, int]:
        """Ends and picks after which the crossings repeat themselves."""
        return repeat_size(self.source.drawdown)

    def _add_repeat(self, output: vtkUnstructuredGrid) -> None:
        """Add the vectors of the repeat and one corner, if the cloth has a whole one inside."""
        corner, size = [0.0, 0.0, 0.0], [0.0, 0.0]
        for axis, (yarns, count) in enumerate(
            zip(self.cloth.yarns, self._repeat_size, strict=True)
        ):
            place, beside = yarns.position, (len(yarns.position) - count) // 2
            if beside < 1 or beside + count >= len(place):
                return
            middles = (place[1:] + place[:-1]) / 2
            corner[axis] = float(middles[beside - 1])
            size[axis] = float(middles[beside + count - 1] - middles[beside - 1])
        repeat = np.array([size[0], 0.0, 0.0, 0.0, size[1], 0.0])
        add_array(output.GetFieldData(), REPEAT, repeat)
        add_array(output.GetFieldData(), CORNER, np.array(corner))

    @property
    def request(self) -> ClothRequest:
        """Values of the parameters for the fabric, including a pattern's default size.

        Raises
        ------
        InputError
            If parameters contradict each other.
        """
        # Only here are the parameters' names, which users write, translated to warp and weft.
        self._refuse_alternatives()
        size = SIZE if self.draft is None else None
        each = [field.name for field in fields(ThreadsRequest)]
        warp, weft = (
            ThreadsRequest(**{name: getattr(self, parameter_name(name, family)) for name in each})
            for family in (0, 1)
        )
        own = {
            f.name: getattr(self, f.name) for f in fields(ClothRequest) if f.name in self.parameters
        }
        own |= {"ends": self.ends or size, "picks": self.picks or size}
        own["from_file"] = self.draft is not None
        return ClothRequest(**own, warp=warp, weft=weft, crimp_height=self.warp_crimp_height)

    def _refuse_alternatives(self) -> None:
        for rivals in self.alternatives:
            given = [key for key in rivals if getattr(self, key) is not None]
            if given[1:]:
                raise InputError(
                    f"{' and '.join(given)} cannot be given together",
                    key=given[1],
                    value=getattr(self, given[1]),
                    allowed=f"one of {', '.join(rivals)}",
                    cure=f"Leave out {' or '.join(given)}; on the command line: --set "
                    + " or --set ".join(f"{self.section}.{key}=auto" for key in given),
                    window_cure=f"Reset {' or '.join(given)}.",
                )

    @property
    def automatic_values(self) -> dict[str, float]:
        """Values of automatic parameters, where one value holds for all yarns."""
        cloth = self.cloth
        values = {
            "ends": cloth.size[0],
            "picks": cloth.size[1],
            "warp_crimp_height": cloth.height,
            "warp_diameter": cloth.warp.diameter,
            "weft_diameter": cloth.weft.diameter,
            "warp_spacing": cloth.warp.spacing,
            "weft_spacing": cloth.weft.spacing,
            "warp_aspect": cloth.warp.aspect,
            "weft_aspect": cloth.weft.aspect,
        }
        return {name: value for name, value in values.items() if isinstance(value, (int, float))}

    @property
    def source(self) -> Draft:
        """Draft from the file, or one repeat of the pattern."""
        if self.draft is None:
            return Draft(pattern_repeat(self.pattern))
        if self.pattern != self.parameter("pattern").default:
            raise InputError(
                "pattern and draft cannot be given together",
                key="pattern",
                value=self.pattern,
                cure=f"Leave out the pattern or the draft {self.draft}",
            )
        if why := unreadable_reason(self.draft):
            raise InputError(
                why,
                key="draft",
                value=self.draft,
                allowed=describe_readers("draft"),
            )
        if self._read is None or self._read[0] != self._draft_state:
            self._read = self._draft_state, read_draft(self.draft, self.trim)
        return self._read[1]

    @property
    def _draft_state(self) -> tuple[Any, ...]:
        """The draft's file, when it was last written, and whether it is trimmed."""
        return self.draft, modification_time(self.draft), self.trim

    def run(self, inputs: list[Any], output: vtkUnstructuredGrid, time: float) -> None:
        """Build the patches."""
        _ = self.counts
        cloth, numbers = self.cloth, np.arange(sum(self.cloth.size), dtype=np.int32)
        if self._part is not None:
            (ends, picks), part_cloth = self._part
            of_picks = numbers[cloth.size[0] :]
            numbers = np.concatenate([numbers[: cloth.size[0]][ends], of_picks[picks]])
            cloth = part_cloth
        for text in cloth.warnings:
            if not isinstance(text, InfoMessage):
                self.warn(text)
        share = (
            select_piece(cloth, self.piece.number, self.piece.total)
            if self.piece.total > 1
            else ALL_YARNS
        )
        made = weave.build_weave(cloth, share, np.float32 if self.single else np.float64)
        set_patches(output, made)
        add_array(output.GetCellData(), "yarn", numbers[made.yarn])
        add_array(output.GetCellData(), "family", made.family.astype(np.int32))
        colors = np.concatenate([cloth.warp.colors, cloth.weft.colors])
        add_array(output.GetCellData(), "color", colors[made.yarn])
        if self._part is None and share == ALL_YARNS:
            self._add_repeat(output)
        for name, crimp, height in (
            ("warp", made.warp, cloth.height),
            ("weft", made.weft, cloth.diameter_sum - cloth.height),
        ):
            for figure in ("theta", "length", "crimp"):
                add_number(output.GetFieldData(), f"{name}_{figure}", getattr(crimp, figure))
            add_number(output.GetFieldData(), f"{name}_height", height)
        add_number(output.GetFieldData(), "radial_error", made.radial_error)
        if self._whole is None or (self._whole[0] is not cloth and self._part is None):
            # Figures of all yarns, the same for each piece.
            bounds = cloth_bounds(cloth) if self.piece.total > 1 else None
            self._whole = cloth, fabric_figures(cloth)["areal_mass"], bounds
        _, mass, bounds = self._whole
        # A cage that is a sheet can weigh as much as the weave.
        add_number(output.GetFieldData(), "areal_mass", mass)
        add_cloth(output, cloth)
        made.places[:, 3] = numbers[made.places[:, 3].astype(np.int64)]
        add_array(output.GetFieldData(), PLACES, made.places)
        if self.piece.total > 1:
            store_bounds(output, cloth_bounds(cloth) if bounds is None else bounds)

    def lend(self, other: Woven, part: YarnSelection | None = None) -> None:
        """Let another source of the same class and settings make all or part of this cloth."""
        assert isinstance(other, WeaveSource)
        other._read, other._resolved, other._whole = self._read, self._resolved, self._whole
        other._part = None if part is None else (part, crop_cloth(self.cloth, part))
        other.Modified()

    def _require(self, size: int, ends: int, picks: int, pieces: int = 1) -> None:
        require_memory(
            size,
            f"a weave of {ends} x {picks} yarns"
            + (f", each of its {pieces} pieces," if pieces > 1 else ""),
            key="ends",
            value=ends,
            cure="Use fewer ends and picks.",
        )
