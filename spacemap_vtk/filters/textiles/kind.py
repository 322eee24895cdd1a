"""What a kind of textile declares: its parameters, its yarns as drawn, its piece and its figures.

A kind is a subclass of `TextileKind` with a `name`, in a module of this folder; nothing else has to
be changed. Its parameters become those of TextileSource and have an effect only if `kind` is its
name. Parameters of several kinds are declared once, in a class from which these inherit.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from spacemap_vtk import cache
from spacemap_vtk.errors import InputError
from spacemap_vtk.filters.textile import FabricFigure
from spacemap_vtk.mechanics.equilibrium.energy_terms import digest_of
from spacemap_vtk.ndarrays import AnyInts, Floats, Ints, Progress
from spacemap_vtk.parameters import Choice, Color, Integer, Parameter, Parameterised, Real, Series
from spacemap_vtk.textile.rods.energy import RodMechanics
from spacemap_vtk.textile.rods.guess import Guess, relax_guess
from spacemap_vtk.textile.rods.pieces import count_lines, cover, repeat_yarns
from spacemap_vtk.textile.rods.relax import SEARCH
from spacemap_vtk.textile.rods.tubes import PARTS
from spacemap_vtk.textile.rods.yarns import Yarn, measure_thickness, sample_yarns, unknowns
from spacemap_vtk.textile.weave.yarn import COTTON, PACKING, section_factor

#: Density of steel [kg/m³].
STEEL = 7850.0

#: Diameter of yarns, if none is given [m].
DIAMETER = 5e-4

#: Stiffness of contact of yarns in a sheet, over B and the fifth power of their diameter, as for
#: the relaxation of knits.
CONTACT = 1.2e4

#: The kinds by name.
KINDS: dict[str, type[TextileKind]] = {}


class Rest(NamedTuple):
    """Yarns at rest, in units of the kind."""

    yarns: list[Yarn]
    cell: Floats
    """(2, 3) Period vectors."""
    overlap: float
    """Largest overlap of two yarns, in diameters."""


#: What was relaxed last, by digest.
_recent: dict[str, Rest] = {}


class TextileKind(Parameterised):
    """Base of the kinds of textiles."""

    # By default a kind is drawn by `guess`, relaxed, and repeated. One that does otherwise
    # overrides `rest` or `lines`, as knits do.

    #: The value of `kind` in a scene.
    name: ClassVar[str] = ""
    #: Families of yarns.
    family_names: ClassVar[tuple[str, ...]] = ("yarns",)
    #: Colours, if none are given.
    colors: ClassVar[tuple[tuple[int, int, int], ...]] = ((200, 85, 61),)
    #: Density and packing, if none are given.
    usual_density: ClassVar[float] = COTTON
    usual_packing: ClassVar[float] = PACKING

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if cls.name:
            KINDS[cls.name] = cls

    diameter = Real(
        None,
        "Diameter of the yarns.",
        unit="m",
        above=0.0,
        plausible=(1e-6, 0.05),
        usual_units="mm",
        automatic="0.5 mm; of a file, its own",
    )
    fibre_density = Real(
        None,
        "Density of the fibres, or of the wire.",
        unit="kg/m3",
        above=0.0,
        automatic="1520 kg/m3, cotton; of a wire mesh 7850 kg/m3, steel",
    )
    packing = Real(
        None,
        "Share of fibre in a yarn's section; the rest is air.",
        above=0.0,
        maximum=1.0,
        automatic="0.6; of a wire mesh 1",
    )
    tension = Real(
        None,
        "Tensile stiffness EA of a yarn: force over strain. With bending it is the stiffness from "
        'which modal.material = "yarns" makes a sheet. Of yarns of other diameters it is in '
        "proportion to their section.",
        unit="N",
        above=0.0,
        automatic="not known",
    )
    bending = Real(
        None,
        "Bending rigidity B of a yarn: moment over curvature. Of yarns of other diameters it is in "
        "proportion to their section.",
        unit="N.m2",
        above=0.0,
        automatic="not known",
    )
    color = Series(
        Color(
            (200, 85, 61),
            "Colours; a list is repeated over the courses of a knit, the carriers of a braid, or "
            "the families of other textiles.",
        ),
        automatic="colours of the kind, or of the file",
    )

    @property
    def size(self) -> float:
        """Diameter of the yarns [m]."""
        return DIAMETER if self.diameter is None else float(self.diameter)

    @property
    def scale(self) -> float:
        """Length in which the textile is drawn and relaxed [m]."""
        return self.size

    def guess(self) -> Guess:
        """Draw a cell."""
        raise NotImplementedError(f"{type(self).__name__} must define guess")

    def families_of_cell(self, guess: Guess) -> Ints:
        """Return the family of each yarn of the cell, (Y,)."""
        return np.zeros(len(guess.yarns), dtype=np.int64)

    @property
    def cells(self) -> tuple[int, int]:
        """Number of cells along both periods."""
        return 1, 1

    def rest(self, progress: Progress | None = None) -> Rest:
        """Relax a cell, or load it."""
        guess = self.guess()
        key = digest_of(
            self.name,
            SEARCH,
            *(str(yarn.periods) for yarn in guess.yarns),
            *(yarn.diameter for yarn in guess.yarns),
            *(yarn.points for yarn in guess.yarns),
            guess.cell,
            *guess.mechanics[:-1],
            guess.free,
            str(guess.stages),
        )
        if (rest := recent(key)) is None:
            counts = np.cumsum([len(yarn.points) for yarn in guess.yarns])
            found = cache.load(key, points=(int(counts[-1]), 3), cell=(2, 3), overlap=(1,))
            if found is None:
                made = relax_guess(guess, progress)
                points = np.concatenate([yarn.points for yarn in made.yarns])
                found = {"points": points, "cell": made.cell, "overlap": np.array([made.overlap])}
                cache.store(key, **found)
            parts = np.split(found["points"], counts[:-1])
            yarns = [
                yarn._replace(points=part) for yarn, part in zip(guess.yarns, parts, strict=True)
            ]
            rest = keep_recent(key, Rest(yarns, found["cell"], float(found["overlap"][0])))
        return rest

    #: Whether yarns are loops, which lie neither along x nor along y.
    loops: ClassVar[bool] = False

    @property
    def springs(self) -> bool:
        """Whether yarns are straight if free; others keep the shape in which they were laid."""
        return False

    @property
    def set_in_use(self) -> float:
        """Share of the yarns' bending that is set."""
        return 0.0

    def cell_of_sheet(self, progress: Progress | None = None) -> Rest:
        """Return the yarns of a cell, whose stiffness is that of the textile as a sheet."""
        return self.rest(progress)

    def is_strip(self, rest: Rest) -> bool:
        """Whether the cell repeats itself along y only."""
        return not rest.cell[0].any()

    def require_bending(self) -> float:
        """Return B [N m²]; refuse a textile whose yarns have no stiffness."""
        for name in ("tension", "bending"):
            if getattr(self, name) is None:
                raise InputError(
                    "the stiffness of the yarns is not given",
                    key="material",
                    value="yarns",
                    cure=f"Give tension and bending in [textile]; {name} is missing.",
                )
        assert self.bending is not None
        return float(self.bending)

    def mechanics_of_sheet(self, rest: Rest) -> RodMechanics:
        """Return the stiffness of the yarns in units of the kind, and of B of the largest yarn."""
        diameter = np.array([yarn.diameter for yarn in rest.yarns])
        size = self.size / self.scale
        section = (diameter / size) ** 2
        spans = sample_yarns(rest.yarns).spans
        bending = self.require_bending()
        assert self.tension is not None
        stiff = self.tension * self.scale**2 / bending
        contact = CONTACT / size**5
        return RodMechanics(stiff * section, section, contact, self.lengths(rest) / spans)

    def lines(self, progress: Progress | None = None) -> list[Floats]:
        """Compute the control points of each yarn of the piece, (n, 3) each [m]."""
        found = self.rest(progress)
        lines, _ = repeat_yarns(found.yarns, found.cell, self.cells)
        return [line * self.scale for line in lines]

    @property
    def line_families(self) -> Ints:
        """The family of each yarn of the piece, (lines,)."""
        guess = self.guess()
        return self.families_of_cell(guess)[count_lines(guess.yarns, guess.cell, self.cells)]

    @property
    def line_diameters(self) -> Floats:
        """The diameter of each yarn of the piece, (lines,) [m]."""
        guess = self.guess()
        which = count_lines(guess.yarns, guess.cell, self.cells)
        return np.array([yarn.diameter for yarn in guess.yarns])[which] * self.scale

    @property
    def line_aspects(self) -> Floats:
        """Width over height of each yarn of the piece, (lines,)."""
        return np.ones(len(self.line_families))

    @property
    def notes(self) -> list[str]:
        """Sentences that are shown as warnings when the textile is made."""
        return []

    @property
    def palette(self) -> AnyInts:
        """The colours that are repeated, (k, 3)."""
        given = self.colors if self.color is None else self.color
        return np.reshape(given, (-1, 3)).astype(np.uint8)

    @property
    def line_colors(self) -> AnyInts:
        """The colour of each yarn of the piece, (lines, 3)."""
        return self.palette[self.line_families % len(self.palette)]

    @property
    def parts(self) -> int:
        """Number of parts of all tubes, for the memory that they take."""
        points = sum(len(yarn.points) for yarn in self.guess().yarns)
        return points * PARTS * self.cells[0] * self.cells[1]

    @property
    def density(self) -> float:
        """Mass of a yarn per volume of its outline [kg/m³]."""
        density = self.usual_density if self.fibre_density is None else self.fibre_density
        return float(density * (self.usual_packing if self.packing is None else self.packing))

    def mass_per_length(self, diameter: Floats) -> Floats:
        """Compute the linear density of yarns [kg/m]."""
        return np.asarray(self.density * section_factor(1.0, "circular") * diameter**2)

    def figures(self, rest: Rest) -> list[FabricFigure]:
        """Return figures of the kind; those of every cell follow."""
        return []

    def lengths(self, rest: Rest) -> Floats:
        """Return the length of each yarn of the cell until it repeats itself, (Y,)."""
        return yarn_lengths(rest)

    def largest_overlap(self, rest: Rest) -> float:
        """Return the largest overlap of two yarns of the piece, in diameters."""
        return rest.overlap

    def all_figures(self) -> list[FabricFigure]:
        """Return all figures of the textile."""
        rest, unit = self.rest(), self.scale
        lengths = self.lengths(rest)
        masses = self.mass_per_length(np.array([yarn.diameter for yarn in rest.yarns]) * unit)
        thickness = measure_thickness(rest.yarns, rest.cell) * unit
        found = self.figures(rest)
        found.append(FabricFigure("thickness", "thickness", thickness, "m"))
        area = float(np.linalg.norm(np.cross(*rest.cell))) * unit**2
        if area:
            mass = float(masses @ lengths) * unit / area
            found.append(FabricFigure("cover", "cover", cover(rest.yarns, rest.cell), "%"))
            found.append(FabricFigure("areal_mass", "areal mass", mass, "kg/m2"))
        found.append(
            FabricFigure(
                "largest_overlap",
                "largest overlap over the diameter",
                self.largest_overlap(rest),
                "%",
            )
        )
        return found


def recent(key: str) -> Rest | None:
    """Return what was relaxed for a digest not long ago."""
    return _recent.get(key)


def keep_recent(key: str, rest: Rest) -> Rest:
    """Keep a result in memory, and forget an old one."""
    if len(_recent) > 8:
        _recent.pop(next(iter(_recent)))
    _recent[key] = rest
    return rest


def yarn_lengths(rest: Rest) -> Floats:
    """Compute the length of each yarn until it repeats itself, (Y,)."""
    samples = sample_yarns(rest.yarns)
    speed = np.linalg.norm(samples.slopes(unknowns(rest.yarns, rest.cell)), axis=1)
    return np.asarray(np.bincount(samples.yarn, speed * samples.weight))


class Crossed(TextileKind):
    """Base of the kinds that have ends along y and picks along x in a given cell."""

    weft_diameter = Real(
        None,
        "Diameter of the picks.",
        unit="m",
        above=0.0,
        plausible=(1e-6, 0.05),
        usual_units="mm",
        automatic="diameter of the ends",
    )
    spacing = Real(
        None,
        "Spacing of the ends, of the pairs of a leno, or of the places of a weave in layers.",
        unit="m",
        above=0.0,
        plausible=(1e-6, 0.1),
        usual_units="mm",
        automatic="2 diameters; of a leno 4",
    )
    weft_spacing = Real(
        None,
        "Spacing of the picks, or of the columns of picks.",
        unit="m",
        above=0.0,
        plausible=(1e-6, 0.1),
        usual_units="mm",
        automatic="2 diameters; of a leno 4, in layers 2.6",
    )
    repeats_across = Integer(4, "Number of repeats along x.", minimum=1, maximum=1000)
    repeats_along = Integer(
        4, "Number of repeats along y; of a braid, of crossings.", minimum=1, maximum=10_000
    )

    #: Spacings, if none are given, in diameters.
    usual_spacings: ClassVar[tuple[float, float]] = (2.0, 2.0)

    @property
    def cells(self) -> tuple[int, int]:
        """Number of cells along both periods."""
        return self.repeats_across, self.repeats_along

    @property
    def scale(self) -> float:
        """The larger diameter [m]."""
        return float(max(self.size, self.weft_diameter or 0.0))

    @property
    def spacings(self) -> tuple[float, float]:
        """Spacings of ends and picks [units]."""
        given = (self.spacing, self.weft_spacing)
        return tuple(  # type: ignore[return-value]
            usual if value is None else value / self.scale
            for value, usual in zip(given, self.usual_spacings, strict=True)
        )

    @property
    def diameters(self) -> tuple[float, float]:
        """Diameters of ends and picks [units]."""
        return self.size / self.scale, (self.weft_diameter or self.size) / self.scale


def combine(kinds: Mapping[str, type[TextileKind]], first: Iterable[str]) -> type[Parameterised]:
    """Make a class with the parameters of several kinds; each has an effect for its kinds only."""
    # `first` names the kinds that come first in the choice, the default before all.
    names = list(dict.fromkeys([*first, *sorted(kinds)]))
    declared: dict[str, Parameter[Any]] = {
        "kind": Choice(names[0], "Kind of textile.", names),
    }
    for name in names:
        for key, parameter in kinds[name].parameters.items():
            users = [other for other in names if key in kinds[other].parameters]
            if any(kinds[other].parameters[key] is not parameter for other in users):
                raise TypeError(f"kinds {users} declare {key} more than once")
            own = copy.copy(parameter)
            if len(users) < len(names):
                own.when = {"kind": tuple(users), **parameter.when}
            declared.setdefault(key, own)
    return type("TextileParameters", (Parameterised,), declared)
