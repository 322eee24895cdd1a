"""The parameters of a weave, and the parameter types that only a weave has."""

from __future__ import annotations

from collections.abc import Iterable
from copy import copy
from typing import Any, ClassVar, TypeVar

from spacemap_vtk.errors import InputError
from spacemap_vtk.ndarrays import Bools
from spacemap_vtk.parameters import (
    Choice,
    Color,
    FilePath,
    Flag,
    Integer,
    Parameter,
    Parameterised,
    Real,
    Series,
    Text,
)
from spacemap_vtk.textile.drafts import drawdown, patterns
from spacemap_vtk.textile.weave.cloth import AXES
from spacemap_vtk.textile.weave.families import FAMILIES
from spacemap_vtk.textile.weave.resolve import WARP_COLOR, WEFT_COLOR
from spacemap_vtk.textile.weave.threads import SECTIONS
from spacemap_vtk.textile.weave.yarn import COTTON, PACKING, parse_twist, parse_yarn_count
from spacemap_vtk.textile.weave.yarn_library import GRAMMAR, YARNS, parse_yarn

_P = TypeVar("_P", bound=Parameter[Any])
#: Words for warp and weft in the parameters' texts; `crossed` is the number of the other family.
_WORDS = [
    dict(
        zip(
            ("name", "yarns", "Yarns", "number", "crossed", "color", "per_inch"), words, strict=True
        )
    )
    for words in (
        ("warp", "ends", "Ends", 1, 2, "#{:02x}{:02x}{:02x}".format(*WARP_COLOR), "epi"),
        ("weft", "picks", "Picks", 2, 1, "#{:02x}{:02x}{:02x}".format(*WEFT_COLOR), "ppi"),
    )
]

#: Sizes of yarns [m] that may be written without a unit. A user who writes 0.3 does not mean
#: 300 mm but 0.3 mm.
_YARNS = (1e-6, 0.02)


def declare_both(declared: _P) -> tuple[_P, _P]:
    """Declare a parameter for the warp and the weft, with the words of each in its texts."""
    warp, weft = copy(declared), copy(declared)
    for made, words in zip((warp, weft), _WORDS, strict=True):
        parts: list[Parameter[Any]] = [made]
        if isinstance(made, Series):
            made.component = copy(made.component)
            parts.append(made.component)
        for part in parts:
            texts = {key: text for key, text in vars(part).items() if isinstance(text, str)}
            vars(part).update({key: text.format(**words) for key, text in texts.items()})
    return warp, weft


def parameter_name(quantity: str, family: int) -> str:
    """Return the name of the parameter for a quantity of the warp (0) or the weft (1)."""
    return f"{FAMILIES[family]}_{quantity}"


class Pattern(Parameter[Any]):
    """A weave: its name, or a 0/1 matrix."""

    kind = "pattern"
    annotation = "str or sequence of rows"
    expected = (
        patterns.GRAMMAR
        + ', or a row of 0 and 1 for each pick, as in ["110", "011", "101"] (1: end over pick)'
    )

    def convert(self, value: Any) -> Any:
        """Convert to a name in canonical spelling, or to a tuple of strings of 0 and 1."""
        if isinstance(value, str):
            return patterns.normalise_name(value)
        if not isinstance(value, Iterable):
            raise InputError("a pattern must be a name or rows of 0 and 1")
        return tuple(drawdown.to_rows(drawdown.from_matrix(list(value))))

    def text(self, value: Any) -> str:
        """Format the name or the rows."""
        return f'"{value}"' if isinstance(value, str) else str(list(value))


class YarnCount(Real):
    """The linear density of a yarn, in any system of yarn counts."""

    def parse(self, text: str) -> float:
        """Convert to kg/m."""
        return parse_yarn_count(text)

    @property
    def expected(self) -> str:
        """The systems of yarn counts, with examples."""
        return (
            'a yarn count as "30 tex", "150 den", "40 Ne" or "20 Nm" (also "Ne 30/2"; "20/2" and '
            '"8/2" are cotton counts, Ne), or in kg/m, ' + self.range
        )


class YarnName(Text):
    """The name of a yarn, as in the library of yarns."""

    expected = GRAMMAR
    offered = tuple(YARNS)

    def convert(self, value: Any) -> str:
        """Return the name in canonical spelling."""
        return parse_yarn(super().convert(value)).name

    def text(self, value: str) -> str:
        """Return the name without quotes, as in lists with commas."""
        return value


class Twist(Real):
    """The twist of a yarn, in turns per metre."""

    def parse(self, text: str) -> float:
        """Convert to turns per metre, positive for Z."""
        return parse_twist(text)

    @property
    def expected(self) -> str:
        """The accepted spellings, with examples."""
        return (
            'turns per length and direction, as "600 Z" (per metre) or "15 /in S", at most '
            f"{self.maximum:g} per metre"
        )

    def text(self, value: Any) -> str:
        """Format the turns per metre and their direction."""
        return f"{abs(value):.6g} {'S' if value < 0 else 'Z'}"


class PerYarn(Series):
    """One value for all yarns of a family, or a list of values that is repeated over them."""

    list_meaning = "repeated over the yarns"


def pattern_repeat(pattern: Any) -> Bools:
    """Return one repeat of a pattern."""
    read = patterns.build_pattern if isinstance(pattern, str) else drawdown.from_matrix
    return read(pattern)


class WeaveParameters(Parameterised):
    """The parameters of a weave."""

    #: Groups of parameters that follow from each other, so that only one of a group may be given.
    alternatives: ClassVar = (
        ("warp_diameter", "warp_count", "warp_yarn"),
        ("weft_diameter", "weft_count", "weft_yarn"),
        ("warp_spacing", "warp_sett"),
        ("weft_spacing", "weft_sett"),
        ("warp_crimp_height", "warp_crimp", "weft_crimp"),
    )
    pattern = Pattern("plain", "The weave, repeated over the cloth.", when={"draft": (None,)})
    draft = FilePath(
        None,
        "Draft file that replaces the pattern: WIF, Fiberworks (.dtx), WeavePoint (.wpo), "
        "TempoWeave (.twa), text or picture. A text (.txt, .csv) has one row for each pick, the "
        "first pick first: 0 and 1, or the raised shafts (1,3). A black-and-white picture (.png "
        "and others) has one pixel for each crossing, black where the end lies over the pick, the "
        "first pick at the bottom.",
        automatic="no draft",
    )
    trim = Flag(
        False,
        "Remove unthreaded ends at the sides of a draft, and picks without a shed at its beginning "
        "and end. In a .wpo file they are always removed.",
        when={"draft": ()},
    )
    ends, picks = declare_both(
        Integer(
            None,
            "Number of {name} yarns.",
            minimum=1,
            maximum=100_000,
            automatic="the draft's own number, or 7",
        )
    )
    warp_diameter, weft_diameter = declare_both(
        PerYarn(
            Real(
                "0.25 mm",
                "Diameter d{number} of the {name} yarns; the height, if they are flattened.",
                unit="m",
                above=0.0,
                plausible=_YARNS,
                usual_units="mm",
            ),
            automatic="from the yarn or its count, the draft's thickness, or half the spacing",
            group="Yarn",
        )
    )
    warp_count, weft_count = declare_both(
        PerYarn(
            YarnCount(
                "30 tex",
                "Yarn count of the {name}, instead of its diameter.",
                unit="kg/m",
                above=0.0,
                maximum=1.0,
                plausible=(1e-7, 1e-2),
                usual_units="tex, Ne, Nm",
            ),
            automatic="from the diameter",
            group="Yarn",
        )
    )
    warp_yarn, weft_yarn = declare_both(
        PerYarn(
            YarnName(
                "20/2 cotton",
                'Yarn of the {name} by its name, as "20/2 cotton", instead of its count: it also '
                'sets the density of the fibres, their packing and the plies (see "spacemap '
                'yarns").',
            ),
            automatic="no yarn is named",
            group="Yarn",
        )
    )
    fibre_density = Real(
        COTTON,
        "Density of the fibres; the default is that of cotton.",
        unit="kg/m3",
        above=0.0,
        group="Yarn",
    )
    packing = Real(
        PACKING,
        "Share of fibre in a yarn's section; the rest is air.",
        above=0.0,
        maximum=1.0,
        group="Yarn",
    )
    warp_spacing, weft_spacing = declare_both(
        PerYarn(
            Real(
                "0.5 mm",
                "Distance p{number} between neighbouring {yarns}.",
                unit="m",
                above=0.0,
                plausible=_YARNS,
                usual_units="mm",
            ),
            automatic="from the sett, the draft's spacing, or 0.5 mm",
            group="Spacing",
        )
    )
    warp_sett, weft_sett = declare_both(
        Real(
            None,
            '{Yarns} per length, instead of their spacing: "20 /cm" or "50 {per_inch}".',
            unit="1/m",
            above=0.0,
            plausible=(200.0, 1e5),
            usual_units="/cm, {per_inch}",
            automatic="from the spacing",
            group="Spacing",
        )
    )
    warp_crimp_height = Real(
        None,
        "Crimp height h1 of the warp, from trough to crest of its axis; that of the weft is "
        "d1 + d2 - h1.",
        unit="m",
        minimum=0.0,
        plausible=_YARNS,
        usual_units="mm",
        automatic="from the crimp, or the middle of the feasible range",
        group="Crimp",
    )
    warp_crimp, weft_crimp = declare_both(
        Real(
            None,
            "Crimp c{number} = l{number} / p{crossed} - 1 of the {name} where it changes side, as "
            '0.09 or "9 %".',
            minimum=0.0,
            automatic="from the crimp height",
            group="Crimp",
        )
    )
    warp_section, weft_section = declare_both(
        Choice(
            None,
            "Section of the {name} yarns; a racetrack is a rectangle between two half circles, a "
            "lenticular section (a lens) lies between two arcs.",
            SECTIONS,
            automatic="lenticular for a draft file or a yarn count, otherwise circular",
            group="Section",
        )
    )
    warp_aspect, weft_aspect = declare_both(
        Real(
            None,
            "Width over height of the {name}'s section.",
            minimum=1.0,
            automatic="1 for circular yarns, 1.5 for others; a lens closes the cloth",
            group="Section",
        )
    )
    thick_yarns = Choice(
        "lens",
        "How to treat yarns of a draft that are too thick to interlace. lens: lenticular yarns "
        "that close the cloth, also for yarn counts of a pattern; scale: thinner, round yarns (an "
        "open cloth); flatten: flat yarns that fill their spacing; refuse: report an error.",
        ["lens", "scale", "flatten", "refuse"],
        group="Section",
    )
    warp_layer, weft_layer = declare_both(
        PerYarn(
            Integer(
                None,
                "Cloth of a double weave, 1 or 2, to which each of the {yarns} belongs, repeated "
                "over them; a single 1 draws one layer.",
                minimum=1,
                maximum=2,
            ),
            automatic="found from the weave",
            group="Layers",
        )
    )
    layer_gap = Real(
        None,
        "Gap between the two cloths of a double weave.",
        unit="m",
        above=0.0,
        plausible=_YARNS,
        usual_units="mm",
        automatic="a tenth of d1 + d2",
        group="Layers",
    )
    overhang = Real(
        None,
        "Length of the yarns past their last crossing.",
        unit="m",
        above=0.0,
        plausible=(1e-6, 0.1),
        usual_units="mm",
        automatic="half the spacing of the crossed yarns",
        group="Cut ends",
    )
    caps = Flag(True, "Close the cut ends of the yarns.", group="Cut ends")
    exact = Flag(
        False,
        "Make rational patches, which represent round yarns exactly.",
        group="Patches",
    )
    precision = Choice(
        "double",
        "Precision of the control points. Single precision needs half the memory and is enough for "
        "pictures; figures of the cloth are always computed in double precision.",
        ["double", "single"],
        group="Patches",
    )
    axis = Choice(
        "arcs",
        "Shape of a yarn's axis: Peirce's arcs and straight lines, or a spline without jumps in "
        "curvature, with which yarns may overlap.",
        AXES,
        group="Patches",
    )
    warp_twist, weft_twist = declare_both(
        PerYarn(
            Twist(
                None,
                "Twist of the {name} (of the plies, if it is plied): turns per length, positive "
                "for Z, negative for S. It affects only the appearance.",
                unit="1/m",
                minimum=-20_000,
                maximum=20_000,
            ),
            automatic="Z, outer fibres inclined by 24 degrees; S for plied yarns",
            group="Twist and colour",
        )
    )
    warp_plies, weft_plies = declare_both(
        PerYarn(
            Integer(
                None,
                "Number of plies (singles twisted together) of the {name}, within the section of "
                "the yarn. It affects only the appearance.",
                minimum=1,
                maximum=12,
            ),
            automatic="those of the yarn, or 1: singles",
            group="Twist and colour",
        )
    )
    warp_color, weft_color = declare_both(
        PerYarn(
            Color("{color}", "Colour of the {name}."),
            automatic="the draft's, or {color}",
            group="Twist and colour",
        )
    )
