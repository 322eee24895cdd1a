"""Errors of the frequencies in the modes tab, estimated in the background on demand."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spacemap_vtk.app.work.slices import in_slices
from spacemap_vtk.cancel import Cancelled
from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.scenes.report import report_modes
from spacemap_vtk.scenes.scene import Scene


@dataclass(frozen=True)
class ModeErrors:
    """Errors of all frequencies of a scene."""

    #: Frequencies in Hz, by which the modes are recognised; empty if the solution failed.
    frequencies: list[float]
    #: Their errors in Hz; None if unknown.
    errors: list[float | None]
    #: Sentence about figures that are not converged, or about why there are no errors.
    note: str


def compute_errors(
    _drawn: Scene, values: Mapping[str, Any], base: Path
) -> Generator[float | None, None, ModeErrors]:
    """Solve a scene again in wider cells, and return the errors of its frequencies."""
    # The scene is another one than that which is drawn meanwhile.
    return in_slices(lambda _: _compute_errors(values, base))


def _compute_errors(values: Mapping[str, Any], base: Path) -> ModeErrors:
    try:
        figures = report_modes(Scene(values, base), True)
    except Cancelled:
        raise
    except SpacemapError as error:
        return ModeErrors([], [], f"No errors: {error}")
    frequencies = [mode["frequency_hz"] for mode in figures["modes"]]
    errors = [
        None if mode["error"] is None else mode["error"] * mode["frequency_hz"]
        for mode in figures["modes"]
    ]
    missing = figures["errors_missing"]
    note = f"No errors: {missing}." if missing else ""
    if not missing and figures["unconverged"]:
        note = f"{figures['unconverged'][0].upper()}{figures['unconverged'][1:]}."
    return ModeErrors(frequencies, errors, note)
