"""The errors of a scene's figures, and a sentence about those that are not converged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import takewhile
from typing import Any

import numpy as np

from spacemap_vtk.filters.error_estimates import ErrorEstimates
from spacemap_vtk.filters.tetra_cage import TetraCage
from spacemap_vtk.mechanics.modal.convergence import TOLERANCE, Estimate

#: Figures of an equilibrium that have an error, with their names in sentences.
_OF_EQUILIBRIUM = {
    "sag": "the sag",
    "shadow_area": "the shadow",
    "drape_coefficient": "the drape coefficient",
}
#: The same for the contact with an obstacle, and for a body that holds the cage.
_OF_CONTACT = {"force": "the force on obstacle {obstacle}"}
_OF_REACTION = {
    "force": "the force of {kind} {name}",
    "moment": "the moment of {kind} {name}",
}
#: A moment below this share of the force times a metre is rounding.
_NOTHING = 1e-9
#: Suggested divisions are at most this many times the present ones: errors of several hundred per
#: cent are too rough to tell more.
_FINER = 4.0


def add_errors(
    figures: dict[str, Any],
    wider: Sequence[dict[str, Any]] = (),
    estimates: ErrorEstimates | None = None,
) -> None:
    """Add an error to each figure of `scenes.report` that depends on a cage's cells."""
    # Each mode gets ``error``, relative, and each other figure ``…_error`` in its unit; and each
    # table ``converged``. The error of a force or moment is the size of a vector. `wider` are the
    # figures of the coarser cages; without `estimates` all errors are None.
    for number, mode in enumerate(figures.get("modes", ())):
        estimate = None if estimates is None else estimates.frequencies[number]
        mode["error"] = None if estimate is None else estimate.error
        mode["converged"] = None if estimate is None else estimate.converged
    alone = len(figures.get("reactions") or ()) == 1
    states = [figures, *({key: each.get(key) for key in figures} for each in wider)]
    columns = zip(*map(_tables, states), strict=True)
    for (table, keys), *others in columns:
        converged = []
        for key in [key for key in keys if key in table]:
            values = [_value(each, key, table) for each in (table, *(other for other, _ in others))]
            known = list(takewhile(lambda value: value is not None, values))
            found: Estimate | None = None
            if estimates is not None and len(known) > 1:
                found = estimates.compare(*known, balanced=alone and key == "force")
                if key == "moment" and table["name"] in estimates.hidden_arms:
                    arm = estimates.hidden_arms[table["name"]]
                    error = max(found.error, arm * float(np.linalg.norm(table["force"])))
                    found = Estimate(error, converged=False)
                converged.append(found.converged)
            table[f"{key}_error"] = None if found is None else found.error
        table["converged"] = all(converged) if converged else None


def describe_unconverged(figures: dict[str, Any], cage: TetraCage) -> str:
    """Describe the figures that are not converged in a sentence, and suggest a cage."""
    # It is empty if all figures are converged, or have no error.
    parts, errors, modes = [], [], figures.get("modes", ())
    numbers = [n for n, mode in enumerate(modes, 1) if mode["converged"] is False]
    if numbers:
        worst = [modes[number - 1]["error"] for number in numbers]
        which = f"the frequencies of modes {numbers[0]} to {numbers[-1]}"
        if len(numbers) == 1:
            which = f"the frequency of mode {numbers[0]}"
        elif len(numbers) <= numbers[-1] - numbers[0]:
            which = f"the frequencies of {len(numbers)} of the modes {numbers[0]} to {numbers[-1]}"
        parts.append(f"{which} (± {_format_range(worst)})")
        errors += worst
    for table, keys in _tables(figures):
        for key, name in keys.items():
            error, value = table.get(f"{key}_error"), table.get(key)
            if error is None or value is None:
                continue
            size = float(np.linalg.norm(value))
            if error <= TOLERANCE * size or size <= _least(table, key):
                continue
            share = error / size
            parts.append(f"{name.format(**table)} (± {_format_range([share])})")
            errors.append(share)
    if not parts:
        return ""
    return f"the cage's cells are too wide for {', '.join(parts)}; {_suggest(cage, max(errors))}"


def _tables(figures: dict[str, Any]) -> list[tuple[dict[str, Any], dict[str, str]]]:
    """Return each table of figures that have errors, with the names of its figures."""
    found = []
    if figures.get("hung") is not None:
        found.append((figures["hung"], _OF_EQUILIBRIUM))
    for key, names in (("contact", _OF_CONTACT), ("reactions", _OF_REACTION)):
        found += [(table, names) for table in figures.get(key) or ()]
    return found


def _value(table: dict[str, Any], key: str, finest: dict[str, Any]) -> Any:
    """Return a figure; a moment about the same point as in the finest cage."""
    if key != "moment":
        return table[key]
    arm = np.subtract(table["point"], finest["point"])
    return np.add(table[key], np.cross(arm, table["force"]))


def _least(table: dict[str, Any], key: str) -> float:
    """Return the size below which a figure is rounding."""
    return _NOTHING * float(np.linalg.norm(table["force"])) if key == "moment" else 0.0


def _format_range(errors: list[float]) -> str:
    least, most = (f"{min(each, 9.99):.0%}" for each in (min(errors), max(errors)))
    return most if least == most else f"{least} to {most}"


def _suggest(cage: TetraCage, error: float) -> str:
    """Suggest a finer cage for an error that falls as the square of its cells' width."""
    factor = min(math.sqrt(max(error / TOLERANCE, 1.0)), _FINER)
    if cage.method == "tetwild":
        return "decrease cage.edge_length"
    divisions = cage.divisions or cage.values_in_use["divisions"]
    finer = [math.ceil(factor * count) if count > 1 else 1 for count in divisions]
    return f"increase cage.divisions, for example to {finer}"
