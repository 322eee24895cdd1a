"""Compare cloth from its yarns with measured fabrics: python docs/measured_cloth.py

It prints the tables of `docs/explanation/measured_cloth.md` and draws its plot.
"""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spacemap_vtk.mechanics.elements.measured_fabrics import FABRICS
from spacemap_vtk.textile.crimp.contact_law import ContactLaw, VanWykContact
from spacemap_vtk.textile.crimp.interchange import YarnMechanics
from spacemap_vtk.textile.crimp.stiffness import bending_bounds, cloth_stiffness
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.figures import fabric_figures
from spacemap_vtk.textile.weave.threads import Threads
from spacemap_vtk.textile.weave.yarn_library import YARNS, Yarn, parse_yarn

#: Bending rigidity of 618 fabrics (geometric mean of warp and weft) by areal mass: bounds of the
#: class [kg/m²], number of fabrics, and 5, 50 and 95 % of them [N m]. Computed from the data set of
#: X. Feng, W. Huang, W. Xu, H. Wang, "Learning-based Bending Stiffness Parameter Estimation by a
#: Drape Tester", ACM Trans. Graph. 41 (2022) 221, github.com/DrapeTester/ClothDrapeTester
#: (cantilever tests). Its licence is not stated, so that the data themselves are not kept here.
CLASSES = (
    (0.015, 0.06, 63, 0.650e-6, 1.34e-6, 9.96e-6),
    (0.06, 0.10, 84, 0.574e-6, 3.26e-6, 11.7e-6),
    (0.10, 0.15, 90, 2.43e-6, 6.79e-6, 20.3e-6),
    (0.15, 0.20, 84, 2.06e-6, 14.3e-6, 49.5e-6),
    (0.20, 0.30, 155, 3.06e-6, 16.6e-6, 56.0e-6),
    (0.30, 0.40, 71, 9.00e-6, 32.3e-6, 83.5e-6),
    (0.40, 0.87, 71, 11.6e-6, 49.6e-6, 130e-6),
)
#: Line through their logarithms: exponent with its standard error, value at 150 g/m² [N m], and the
#: factor of one standard deviation.
EXPONENT, EXPONENT_ERROR, AT_150, SCATTER = 1.18, 0.04, 9.03e-6, 2.35

#: Specific modulus [N m/kg] and fineness [kg/m] of fibres. The moduli are those of the help of
#: yarns.modulus. Fineness is assumed: cotton of micronaire 4.3, merino of 22 µm, single flax.
FIBRES = {
    "cotton": (5.0e6, 0.17e-6),
    "worsted": (2.3e6, 0.50e-6),
    "linen": (18.0e6, 0.25e-6),
}
#: Loss of thickness of a cotton yarn between plates, and force [N]: means of four samples of the
#: data of K. Singal and others, github.com/sabetta/stitch-by-stitch (MIT), less the give of the
#: machine, which is the slope above 2 N.
PRESSED = ((0.14, 0.01), (0.30, 0.05), (0.37, 0.1), (0.43, 0.2), (0.49, 0.5), (0.53, 1.0))
#: Setts of cloth for clothing, beside the usual ones of the library's yarns [1/m].
CLOTHING = {"20 tex cotton": 2500.0, "15 tex cotton": 3000.0, "30 tex cotton": 2000.0}
#: Shear rigidity of measured woven fabrics: C33/2 of `FABRICS`.
WOVEN_FABRICS = ("denim", "trousers", "tablecloth")


class Prediction(NamedTuple):
    """A balanced plain cloth from its yarns."""

    name: str
    sett: float
    """[1/m]"""
    mass: float
    """[kg/m²]"""
    yarn: float
    """Bending rigidity of the yarn whose fibres slide freely [N m²]."""
    free: float
    """Bending rigidity of the cloth of such yarns [N m]."""
    rigid: float
    """The same if the yarns stick to those that they cross [N m]."""
    shear: float
    """Shear rigidity of the cloth of such yarns [N/m]."""

    @property
    def measured(self) -> float:
        """Bending rigidity of the mean measured fabric of this mass [N m]."""
        return AT_150 * (self.mass / 0.15) ** EXPONENT


def free_fibre_rigidity(yarn: Yarn) -> float:
    """Return the bending rigidity of a yarn whose fibres slide freely [N m²]: the least possible.

    T/t round fibres of the specific modulus E and the density ρ have E T t/(4 π ρ) together.
    """
    modulus, fineness = FIBRES[yarn.name.split()[-1]]
    return modulus * yarn.linear_density * fineness / (4 * pi * yarn.material.density)


def predict(name: str, sett: float) -> Prediction:
    """Return a balanced plain cloth of a yarn at a sett."""
    yarn = parse_yarn(name)
    diameter = float(np.sqrt(4 * yarn.linear_density / (pi * yarn.bulk_density)))
    threads = Threads(diameter=diameter, spacing=1 / sett)
    cloth = Cloth(drawdown=[[1, 0], [0, 1]], warp=threads, weft=threads, density=yarn.bulk_density)
    bending = free_fibre_rigidity(yarn)
    stretching = FIBRES[yarn.name.split()[-1]][0] * yarn.linear_density
    yarns = YarnMechanics((stretching, stretching), stretching / 10, (bending, bending))
    bounds = bending_bounds(cloth, yarns)
    shear = float(cloth_stiffness(cloth, yarns).membrane[2, 2])
    mass = fabric_figures(cloth)["areal_mass"]
    return Prediction(yarn.name, sett, mass, bending, bounds.free[0], bounds.rigid[0], shear)


def predictions() -> list[Prediction]:
    """Return the predictions of the page, light cloth first."""
    usual = {
        name: known.plain_sett
        for name, known in YARNS.items()
        if known.plain_sett is not None and name.split()[-1] in FIBRES
    }
    found = [predict(name, sett) for name, sett in {**usual, **CLOTHING}.items()]
    return sorted(found, key=lambda each: each.mass)


def table_of_fabrics() -> list[str]:
    """Return the rows of the table of measured fabrics."""
    return [
        f"| {1e3 * low:.0f} to {1e3 * high:.0f} | {count} | {1e6 * least:.3g} | {1e6 * middle:.3g} "
        f"| {1e6 * most:.3g} |"
        for low, high, count, least, middle, most in CLASSES
    ]


def table_of_predictions() -> list[str]:
    """Return the rows of the table of predictions."""
    return [
        f"| {each.name} | {each.sett / 100:.1f} | {1e3 * each.mass:.0f} | {1e9 * each.yarn:.2f} | "
        f"{1e6 * each.free:.2f} | {1e6 * each.rigid:.2f} | {1e6 * each.measured:.1f} | "
        f"{each.measured / each.free:.1f} | {each.shear:.1f} |"
        for each in predictions()
    ]


def table_of_pressing() -> list[str]:
    """Return the rows of the table of a pressed yarn: for each law, its constant at each point.

    A law is right if its constant is one number.
    """
    loss, force = np.array(PRESSED).T
    linear, van_wyk = (
        force / -law.evaluate(1 - loss)[1] for law in (ContactLaw(), VanWykContact())
    )
    rows = {
        "force, mN": 1e3 * force,
        "loss of thickness, %": 100 * loss,
        "force over loss, mN (linear law)": 1e3 * linear,
        "force over x⁻³ - 1, mN (van Wyk)": 1e3 * van_wyk,
    }
    return [
        f"| {name} | " + " | ".join(f"{v:.0f}" for v in row) + " |" for name, row in rows.items()
    ]


def draw(file: Path) -> None:
    """Draw bending rigidity over areal mass."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log")
    edges = np.array([low for low, *_ in CLASSES] + [CLASSES[-1][1]]) * 1e3
    shown = np.array([row[3:] for row in CLASSES]) * 1e6
    axes.stairs(
        shown[:, 2],
        edges,
        baseline=shown[:, 0],
        fill=True,
        color="#c9d8e6",
        label="618 fabrics: 5 to 95 %",
    )
    axes.hlines(shown[:, 1], edges[:-1], edges[1:], color="#1f5f8b", label="their median")
    mass = np.array([edges[0], edges[-1]])
    axes.plot(
        mass,
        1e6 * AT_150 * (mass / 150) ** EXPONENT,
        color="#1f5f8b",
        linestyle="--",
        linewidth=1,
        label=f"mass to the power {EXPONENT:g}",
    )
    fabrics = [
        (1e3 * f.areal_mass, 1e6 * (f.bending[0] * f.bending[2]) ** 0.5, n in WOVEN_FABRICS)
        for n, f in FABRICS.items()
    ]
    for woven, marker, label in ((True, "s", "woven"), (False, "o", "knitted or other")):
        points = [(x, y) for x, y, kind in fabrics if kind == woven]
        axes.plot(
            *zip(*points, strict=True),
            marker,
            color="#444444",
            markerfacecolor="#444444" if woven else "white",
            markersize=5,
            label=f"Wang et al. 2011, {label}",
        )
    for material, colour in zip(FIBRES, ("#c0392b", "#d68910", "#1e8449"), strict=True):
        points = [(1e3 * p.mass, 1e6 * p.free) for p in predictions() if material in p.name]
        axes.plot(
            *zip(*points, strict=True), "^", color=colour, label=f"{material} yarns, free fibres"
        )
    axes.set_xlabel("areal mass in g/m²")
    axes.set_ylabel("bending rigidity in µN·m")
    ticks = [20, 50, 100, 200, 500]
    axes.set_xticks(ticks, map(str, ticks))
    axes.minorticks_off()
    axes.set_yticks([1, 10, 100], ["1", "10", "100"])
    axes.set_ylim(0.4, 300)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=8, loc="upper left")
    figure.savefig(file, dpi=150)


if __name__ == "__main__":
    print("\n".join([*table_of_fabrics(), "", *table_of_predictions(), "", *table_of_pressing()]))
    draw(Path(__file__).with_suffix(".png"))
