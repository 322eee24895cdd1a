"""Tensile tests of a scene's cloth by its yarns, as a figure and as a table."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import TYPE_CHECKING

from spacemap_vtk.draw.plots import figure_about, handy, write_figure
from spacemap_vtk.errors import InputError
from spacemap_vtk.fabric.biaxial import Tensile, tensile_tests
from spacemap_vtk.fabric.interchange import Interchange
from spacemap_vtk.filters.yarn_parameters import YarnParameters
from spacemap_vtk.io.output import write
from spacemap_vtk.scenes.scene import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: How far past the extension that straightens a yarn cloth is pulled.
_PAST = 0.02
_COLORS = ("#c8502a", "#2c5f9e")
_COLUMNS = (
    "test",
    "extension along warp",
    "extension along weft",
    "force along warp [N/m]",
    "force along weft [N/m]",
    "strain of warp yarns",
    "strain of weft yarns",
)


def crossings_of(scene: Scene) -> Interchange:
    """Return the crossings of a scene's cloth, with what its yarns resist."""
    stage = scene.stage("crimp")
    if not isinstance(stage, YarnParameters) or stage.inextensible:
        raise InputError(
            f"{scene.file}: this scene does not say what its yarns resist",
            key="yarns.inextensible",
            allowed="false, with a tension or a modulus",
            cure="For example --set yarns.inextensible=false --set yarns.modulus='500 cN/tex'",
        )
    return Interchange(scene.weave.cloth, stage.yarns(scene.weave.cloth))


def biaxial_plot(scene: Scene, file: Path) -> None:
    """Plot force per width against extension, of strips and pulled both ways; or write a table."""
    crossings = crossings_of(scene)
    crimp = max(float(family.crimp.crimp) for family in scene.weave.cloth.families)
    tests = tensile_tests(crossings, crimp + _PAST)
    if file.suffix.lower() == ".csv":
        write(file, [_table(tests).encode()])
        return
    write_figure(_figure(scene.title, tests), file)


def _table(tests: list[Tensile]) -> str:
    stream = io.StringIO()
    rows = csv.writer(stream, lineterminator="\n")
    rows.writerow(_COLUMNS)
    for test in tests:
        for values in zip(*test.extension, *test.force, *test.strain, strict=True):
            rows.writerow([test.name, *(format(float(value), ".9g") for value in values)])
    return stream.getvalue()


def _figure(title: str, tests: list[Tensile]) -> Figure:
    figure = figure_about(f"{title}\nforce per width of its yarns")
    force, width = figure.subplots(2, 1, height_ratios=(2, 1), sharex=True)
    unit, size = "N/m", 1.0
    largest = max(float(test.force.max()) for test in tests)
    if largest >= 1e4:
        unit, size = "kN/m", 1e3
    elif largest < 0.1:
        unit, size = handy("N/m", largest)
    for family, name in enumerate(("warp", "weft")):
        # the warp's are seen beside the weft's where both are the same
        strip, both, color, wide = tests[family], tests[2], _COLORS[family], 3.0 - 1.6 * family
        pulled = 100.0 * strip.extension[family]
        force.plot(pulled, strip.force[family] / size, color=color, label=f"strip along the {name}")
        force.plot(
            100.0 * both.extension[family],
            both.force[family] / size,
            color=color,
            linewidth=wide,
            linestyle="--",
            label=f"1 : 1, {name}",
        )
        width.plot(pulled, 100.0 * strip.extension[1 - family], color=color, linewidth=wide)
    force.set(ylabel=f"force per width [{unit}]")
    width.set(xlabel="extension [%]", ylabel="change of width [%]", xlim=(0.0, pulled[-1]))
    return figure
