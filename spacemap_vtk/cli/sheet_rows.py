"""What ``modes`` and ``info`` print of the sheet that a cage is to mechanics."""

from __future__ import annotations

from typing import Any

from spacemap_vtk.filters.modal_solver import ModalSolver


def sheet_rows(figures: dict[str, Any]) -> list[tuple[str, str]]:
    """Return labels and values, of figures of `spacemap_vtk.scenes.report.sheet_figures`."""
    rows = [("elements of the cage", figures["elements"])] if "elements" in figures else []
    for name, value in (figures.get("sheet") or {}).items():
        if name == "poissons_ratio_in_plane":
            value = tuple(figures["poissons_ratios"])
        tell = ModalSolver.parameter(name).tell
        label = "  " + name.replace("_", " ").replace("poissons", "Poisson's")
        told = [tell(each) for each in value] if isinstance(value, tuple) else [tell(value)]
        several = len(set(told)) > 1
        for side, text in zip(("warp", "weft"), told if several else told[:1], strict=False):
            rows.append((label + f", {side}" * several, text))
    return rows
