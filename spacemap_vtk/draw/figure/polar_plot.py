"""Polar plot of a composite's Young's modulus in the plane."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from spacemap_vtk.draw.figure.measurement_plot import COLORS, LIGHT, Ink
from spacemap_vtk.draw.figure.page import new_figure
from spacemap_vtk.scenes.composite import Composite, directional_moduli

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def polar_plot(title: str, composite: Composite) -> Figure:
    """Draw Young's modulus over the angle from the weft."""
    figure = new_figure(figsize=(6.4, 6.0), dpi=150, layout="constrained")
    figure.suptitle(title, fontsize=12)
    draw_moduli(figure.subplots(subplot_kw={"projection": "polar"}), composite)
    return figure


def draw_moduli(panel: Any, composite: Composite, ink: Ink = LIGHT) -> None:
    """Draw the moduli into a polar panel."""
    angle, modulus = directional_moduli(composite.constants.compliance)
    panel.plot(angle, modulus / 1e9, color=COLORS[0], linewidth=1.8)
    panel.fill(angle, modulus / 1e9, color=COLORS[0], alpha=0.12)
    panel.set_ylim(0, 1.12 * modulus.max() / 1e9)
    panel.set_rlabel_position(22.5)
    panel.set_title(
        "Young's modulus in GPa over the direction\nx is at 0°, y at 90°",
        fontsize=10,
        color=ink.text,
    )
    panel.set_facecolor(ink.paper)
    panel.grid(color=ink.grid, linewidth=0.8)
    panel.tick_params(colors=ink.faint, labelsize=9)
    least = np.argmin(modulus[: len(modulus) // 2])
    note = (
        f"Ex {modulus[0] / 1e9:.3g}, Ey {modulus[len(modulus) // 4] / 1e9:.3g}, least "
        f"{modulus[least] / 1e9:.3g} GPa at {np.degrees(angle[least]):.0f}°\nfibres "
        f"{composite.fibre_share:.0%} of the volume"
    )
    panel.set_xlabel(note, fontsize=9, color=ink.faint, labelpad=14)
