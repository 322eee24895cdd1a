"""Crimp interchange beside a published yarn-level simulation.

    python benchmarks/published_yarns.py

Sperl, Narain and Wojtan, "Mechanics-Aware Deformation of Yarn Pattern Geometry", ACM Trans.
Graph. 40 (2021), published yarn models with their code (MADYPG, MIT): a basket weave 2/2 and a
satin of 5, pulled along their two directions, yarn by yarn. The figures below are measured on these
data (models basket_9 and satin_9, no shear): the mean strain of the yarns of either direction over
that at rest, as embedded and as simulated, and the height of their axes over the yarn's radius.

In those loose weaves floats are round, and yarns touch from farther off than their radii: each is
taken as the plain cloth whose gap is half the yarn's wave and whose axes are as far apart, or as
far as Peirce's geometry can weave. One number is fitted, to all of it: the stiffness of contact
over that of the yarns.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from spacemap_vtk.textile.crimp.interchange import Interchange, YarnMechanics
from spacemap_vtk.textile.weave.cloth import Cloth
from spacemap_vtk.textile.weave.peirce import largest_diameter_sum
from spacemap_vtk.textile.weave.threads import Threads

#: Half waves along x and y, and heights at rest, over the radius.
WEAVES = {"basket": (5.3524, 5.1505, 2.80, 2.55), "satin": (5.5556, 5.5093, 3.42, 3.39)}
#: Extension along x and y; strain of yarns along x and y, embedded and simulated, in %; heights.
PUBLISHED = {
    "basket": (
        (1 / 6, 0.0, 12.05, 0.01, 3.14, 1.47, 1.87, 2.72),
        (1 / 3, 0.0, 24.39, 0.03, 12.66, 3.25, 1.24, 2.76),
        (0.0, 1 / 6, 0.04, 12.52, 1.49, 3.68, 3.00, 1.48),
        (0.0, 1 / 3, 0.08, 25.33, 3.09, 14.60, 3.02, 0.92),
        (1 / 6, 1 / 6, 12.08, 12.53, 4.92, 5.51, 2.14, 1.78),
        (1 / 3, 1 / 3, 24.45, 25.36, 15.34, 17.14, 1.86, 1.57),
    ),
    "satin": (
        (1 / 6, 0.0, 11.40, 0.26, 4.39, 0.15, 2.64, 3.33),
        (1 / 3, 0.0, 23.17, 0.56, 13.32, 0.70, 2.03, 3.30),
        (0.0, 1 / 6, 0.24, 11.39, 0.16, 4.39, 3.37, 2.60),
        (0.0, 1 / 3, 0.51, 23.16, 0.68, 13.29, 3.34, 2.01),
        (1 / 6, 1 / 6, 11.61, 11.63, 4.25, 4.24, 2.52, 2.50),
        (1 / 3, 1 / 3, 23.58, 23.61, 13.73, 13.72, 2.06, 2.03),
    ),
}
#: Nothing but their contact keeps those yarns apart.
FLATTEST = 0.3


def cloth_of(weave: str) -> tuple[Cloth, float]:
    """Return the plain cloth that stands for a weave, with its yarns along x as the warp."""
    along_x, along_y, height_x, height_y = WEAVES[weave]
    apart = height_x + height_y
    woven = min(apart, (1.0 - 1e-9) * largest_diameter_sum(along_y, along_x))
    warp, weft = (Threads(diameter=0.5 * woven, spacing=p) for p in (along_y, along_x))
    height = height_x if woven == apart else None
    return Cloth(drawdown=[[1, 0], [0, 1]], warp=warp, weft=weft, crimp_height=height), apart


def figures(weave: str, contact: float) -> np.ndarray:
    """Return strains in % along x and y and heights for each row, (rows, 4)."""
    cloth, apart = cloth_of(weave)
    crossings = Interchange(cloth, YarnMechanics((1.0, 1.0), contact, flattest=FLATTEST))
    scale = 2.0 * apart / cloth.diameter_sum
    rows = []
    for x, y, *_ in PUBLISHED[weave]:
        state = crossings.solve(np.ones((2, 2, 2)) * np.reshape([1.0 + x, 1.0 + y], (2, 1, 1)))
        rows.append([*100.0 * state.strain[:, 0, 0], *scale * state.height[:, 0, 0]])
    return np.array(rows)


def off(contact: float) -> float:
    """Return the mean square of what strains are off, in %."""
    return float(
        np.mean(
            [(figures(w, contact)[:, :2] - np.array(PUBLISHED[w])[:, 4:6]) ** 2 for w in WEAVES]
        )
    )


def main() -> None:
    contact = float(minimize_scalar(off, bounds=(0.01, 0.3), method="bounded").x)
    print(f"fitted k_D / EA = {contact:.4f}\n")
    print("                    yarn strain along x, y [%]                    heights [radii]")
    print("weave    stretch    embedded      simulated     interchange   simulated    interchange")
    for weave, rows in PUBLISHED.items():
        for (x, y, *known), ours in zip(rows, figures(weave, contact), strict=True):
            embedded, strain, height = known[:2], known[2:4], known[4:]
            columns = (embedded, strain, ours[:2], height, ours[2:])
            words = "  ".join("{:5.2f} {:5.2f} ".format(*pair) for pair in columns)
            print(f"{weave:8s} {x:.2f} {y:.2f}  {words}")
    table = np.concatenate([np.array(rows) for rows in PUBLISHED.values()])
    embedded = np.sqrt(np.mean((table[:, 2:4] - table[:, 4:6]) ** 2))
    print(
        f"\nroot mean square error of the strains: embedded {embedded:.2f} %, interchange", end=" "
    )
    print(f"{off(contact) ** 0.5:.2f} %")


if __name__ == "__main__":
    main()
