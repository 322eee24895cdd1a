"""Settings of a weaving plan. The module imports no VTK, so that a command's help is quick."""

from __future__ import annotations

from typing import Any

from spacemap_vtk.filters.weave_parameters import PerYarn, YarnName
from spacemap_vtk.parameters import Choice, Integer, Parameterised, Real, Series
from spacemap_vtk.textile.plan.sett import USUAL_SHARE


class Reeds(Series):
    """The dents of one reed, or of several."""

    list_meaning = "of which the best is chosen"


def _length(default: Any, help: str, group: str) -> Real:
    return Real(
        default,
        help,
        unit="m",
        minimum=0.0,
        plausible=(0.0, 5.0),
        usual_units="cm, in",
        group=group,
    )


def _share(default: Any, help: str, **more: Any) -> Real:
    return Real(default, f"{help}, as 0.1 or 10%.", minimum=0.0, **more)


class PlanSettings(Parameterised):
    """Settings of a weaving plan: size, yarns, loom and finishing."""

    width = Real(
        None,
        "Finished width.",
        unit="m",
        above=0.0,
        plausible=(0.005, 10.0),
        usual_units="cm, in",
        automatic="one repeat of the draft",
        group="Size",
    )
    length = Real(
        None,
        "Finished length of a piece, without fringes.",
        unit="m",
        above=0.0,
        plausible=(0.005, 1000.0),
        usual_units="cm, in",
        automatic="one repeat of the draft",
        group="Size",
    )
    pieces = Integer(1, "Number of pieces on one warp.", minimum=1, maximum=10_000, group="Size")
    hem = _length(0.0, "Length of the hem at each end of a piece.", group="Size")
    fringe = _length(0.0, "Length of unwoven warp at each end of a piece.", group="Size")
    ends = Integer(
        None,
        "Number of ends, instead of the width.",
        minimum=1,
        maximum=1_000_000,
        automatic="whole repeats that come nearest to the width",
        group="Size",
    )
    picks = Integer(
        None,
        "Number of picks of a piece, instead of the length.",
        minimum=1,
        maximum=1_000_000,
        automatic="whole repeats that come nearest to the length",
        group="Size",
    )
    warp_yarn = PerYarn(
        YarnName("20/2 cotton", 'Yarn of the warp, as "20/2 cotton" (see "spacemap yarns").'),
        automatic="that of the scene",
        group="Yarn and sett",
    )
    weft_yarn = PerYarn(
        YarnName(
            "16/2 linen",
            'Yarn of the weft, as "16/2 linen"; for a pattern weft over tabby two yarns in turn, '
            'as "2/8 worsted, 20/2 cotton".',
        ),
        automatic="that of the scene, or that of the warp",
        group="Yarn and sett",
    )
    sett = Real(
        None,
        'Ends per length in the reed, as "24 epi" or "9 /cm".',
        unit="1/m",
        above=0.0,
        plausible=(50.0, 1e5),
        usual_units="/cm, epi",
        automatic="that of the yarn for this weave, or that of the scene or the draft",
        group="Yarn and sett",
    )
    weft_sett = Real(
        None,
        'Picks per length on the loom, as "20 ppi" or "8 /cm".',
        unit="1/m",
        above=0.0,
        plausible=(50.0, 1e5),
        usual_units="/cm, ppi",
        automatic="as for the warp",
        group="Yarn and sett",
    )
    firmness = Real(
        None,
        "Share of the closest sett that the yarns allow by Ashenhurst's rule: 0.6 for a shawl, 0.8 "
        "for common cloth, 0.9 and more for upholstery.",
        minimum=0.2,
        maximum=1.2,
        automatic=f"as for the yarn's usual setts, or {USUAL_SHARE:g}",
        group="Yarn and sett",
    )
    reed = Reeds(
        Real(
            None,
            'Dents per length of the reed, as "12 dpi" or "50 /10cm", or a list of reeds.',
            unit="1/m",
            above=0.0,
            plausible=(50.0, 5000.0),
            usual_units="/10cm, dpi",
        ),
        automatic="the best of the common reeds",
        group="Loom",
    )
    draw_in = _share(
        None,
        "Share by which the cloth on the loom is narrower than the warp in the reed",
        below=1.0,
        automatic="a usual one for the material of the weft",
        group="Loom",
    )
    waste = _length(
        0.7,
        "Length of warp that cannot be woven: the knots in front, and what remains behind the "
        "heddles. 27 in are usual for a floor loom.",
        group="Loom",
    )
    sample = _length(0.0, "Length of warp for a sample.", group="Loom")
    floating = Integer(
        None,
        "Number of floating selvedge ends, beside those of the pattern.",
        minimum=0,
        maximum=100,
        automatic="2 if the weft does not bind the outer ends, otherwise 0",
        group="Loom",
    )
    heddles = Integer(
        None,
        "Number of heddles on each shaft of the loom, to see how many are to spare.",
        minimum=1,
        maximum=1_000_000,
        automatic="not compared",
        group="Loom",
    )
    shrinkage = _share(
        None,
        "Share by which the cloth becomes shorter when it is washed",
        below=1.0,
        automatic="a usual one for the material of the warp",
        group="Finishing",
    )
    width_shrinkage = _share(
        None,
        "Share by which the cloth becomes narrower when it is washed",
        below=1.0,
        automatic="a usual one for the material of the weft",
        group="Finishing",
    )
    take_up = _share(
        None,
        "Length of the warp over that of the cloth on the loom, minus 1",
        maximum=10.0,
        automatic="crimp of round yarns in this weave",
        group="Finishing",
    )
    weft_take_up = _share(
        None,
        "Length of a pick over the width in the reed, minus 1",
        maximum=10.0,
        automatic="crimp of round yarns in this weave",
        group="Finishing",
    )
    allowance = _share(
        0.1, "Share of yarn that is bought in addition", maximum=10.0, group="Finishing"
    )
    units = Choice(
        "metric",
        "Units of the plan: centimetres, metres and grams, or inches, yards and ounces.",
        ["metric", "imperial"],
        group="Finishing",
    )
