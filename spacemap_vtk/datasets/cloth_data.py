"""Store the cloth of a data set in field arrays, so that filters and files pass it on.

The arrays, where NaN means unknown:

- ``cloth_drawdown``: uint8, pick by pick.
- ``cloth_warp_diameter``, ``cloth_warp_spacing``: m, one value or one for each yarn or pair.
- ``cloth_warp_section``: index into `SECTIONS`, and width over height.
- ``cloth_warp_twist``, ``cloth_warp_plies``: turns per metre, positive for Z, and number of plies;
  one value or one for each yarn.
- ``cloth_warp_float_width``: m, only where floats swell to given widths; one value or one for each
  yarn.
- ``cloth_weft_...``: the same for the weft.
- ``cloth_measures``: number of ends, number of picks, crimp height (m), overhang (m), density of
  the yarns (kg/m3), 0 or 1 for closed ends, 0 or 1 for rational patches, index of the axis in
  `AXES`, and the middle of the ends and of the picks (m; older files lack these two: 0).
- ``cloth_layers``: for double weaves, uint8 for each end and then each pick: 1 if it belongs to the
  second cloth, 2 if it changes between the cloths.
- ``cloth_layer_gap``: for double weaves, m.

The colours of yarns are cell arrays. Warnings are not stored: the stage that made the cloth has
reported them.
"""

from __future__ import annotations

from math import inf, nan
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import (
    VTK_BEZIER_QUADRILATERAL,
    vtkDataObject,
    vtkUnstructuredGrid,
)

from spacemap_vtk.datasets.arrays import add_array, array_of, to_array, to_cells, to_points
from spacemap_vtk.errors import InputError
from spacemap_vtk.textile.weave.cloth import AXES, FAMILIES, Cloth
from spacemap_vtk.textile.weave.double_weave import Layers
from spacemap_vtk.textile.weave.threads import SECTIONS, Lengths, Threads

if TYPE_CHECKING:
    from spacemap_vtk.textile.geometry.sweep import SweptTubes
from spacemap_vtk.textile.geometry.weave import Weave

#: Prefix of the names of all field arrays of a cloth.
_PREFIX = "cloth_"
#: Name of the array that holds `spacemap_vtk.textile.geometry.weave.Weave.places` of the patches.
PLACES = "yarn_places"
#: Point array of yarns that crimp interchange has moved: the point of the cage [m] that the ring of
#: a control point moves with.
FOOT = "foot"
#: Point array of the same yarns: the control point relative to that moved point [m].
OFFSET = "interchange"

#: Field arrays of patches: the two vectors after which the textile repeats itself, and a corner of
#: a repeat that lies inside the piece [m].
REPEAT, CORNER = "repeat", "repeat_corner"

_DRAWDOWN = _PREFIX + "drawdown"
_MEASURES = _PREFIX + "measures"
_LAYERS = _PREFIX + "layers"
_GAP = _PREFIX + "layer_gap"


def set_patches(grid: vtkUnstructuredGrid, made: Weave | SweptTubes) -> None:
    """Set the points and cells of a grid to the patches of yarns."""
    grid.SetPoints(to_points(made.points))
    grid.SetCells(VTK_BEZIER_QUADRILATERAL, to_cells(made.patches))
    if made.weights is not None:
        grid.GetPointData().SetRationalWeights(to_array(made.weights, "RationalWeights"))


def add_cloth(data: vtkDataObject, cloth: Cloth) -> None:
    """Write the field arrays of a cloth, whose yarns must fit, with one byte for each crossing."""
    field = data.GetFieldData()
    add_array(field, _DRAWDOWN, np.ascontiguousarray(cloth.drawdown).view(np.uint8).ravel())
    for family, threads in zip(FAMILIES, cloth.threads, strict=True):
        name = _PREFIX + family
        add_array(field, f"{name}_diameter", np.array(threads.diameter, np.float64, ndmin=1))
        # A single yarn may have an empty list of spacings; an array needs at least one value.
        spacing = np.array(threads.spacing, np.float64, ndmin=1)
        add_array(field, f"{name}_spacing", spacing if spacing.size else np.array([nan]))
        kind = SECTIONS.index(threads.section)
        add_array(field, f"{name}_section", np.array([kind, threads.aspect]))
        if threads.float_width is not None:
            wide = np.array(threads.float_width, np.float64, ndmin=1)
            add_array(field, f"{name}_float_width", wide)
        twist = nan if threads.twist is None else threads.twist
        for key, seen in (("twist", twist), ("plies", threads.plies)):
            add_array(field, f"{name}_{key}", np.array(seen, np.float64, ndmin=1))
    measures = (
        *cloth.size,
        cloth.height,
        nan if cloth.overhang is None else cloth.overhang,
        nan if cloth.densities is None else cloth.densities[0],
        cloth.caps,
        cloth.exact,
        AXES.index(cloth.axis),
        *cloth.middle,
        nan if cloth.densities is None else cloth.densities[1],
    )
    add_array(field, _MEASURES, np.array(measures, np.float64))
    if cloth.layers is not None:
        second = [
            np.full(count, 2 if one is None else one, np.uint8)
            for one, count in zip((cloth.layers.ends, cloth.layers.picks), cloth.size, strict=True)
        ]
        add_array(field, _LAYERS, np.concatenate(second))
        add_array(field, _GAP, np.array([nan if cloth.layer_gap is None else cloth.layer_gap]))


def cloth_of(data: vtkDataObject) -> Cloth | None:
    """Return the cloth of a data set, with its crimp as a crimp height; None without a cloth."""
    field = data.GetFieldData()
    if not field.HasArray(_MEASURES):
        return None

    def values(name: str, *counts: int) -> NDArray[Any]:
        found = array_of(field, name, "a cloth").ravel()
        if len(found) not in counts:
            message = f'the field array "{name}" has {len(found)} values'
            raise InputError(message, allowed=" or ".join(map(str, counts)))
        return found

    def lengths(name: str) -> Lengths:
        found = array_of(field, name, "a cloth").ravel().astype(np.float64)
        return found if len(found) > 1 else float(found[0])

    # Older files have no middle, and one density for warp and weft.
    measures = values(_MEASURES, 11, 10, 8)
    measures = np.append(measures, [0.0, 0.0, measures[4]][len(measures) - 8 :])
    ends, picks, height, overhang, density, caps, exact, axis, *middle, other = measures.tolist()
    threads = []
    for family in FAMILIES:
        name = _PREFIX + family
        kind, aspect = values(f"{name}_section", 2).tolist()
        spacing = lengths(f"{name}_spacing")
        # Older files have no twist and no plies.
        twist, plies = (
            lengths(f"{name}_{key}") if field.HasArray(f"{name}_{key}") else usual
            for key, usual in (("twist", nan), ("plies", 1.0))
        )
        threads.append(
            Threads(
                diameter=lengths(f"{name}_diameter"),
                spacing=spacing if np.all(np.isfinite(spacing)) else np.empty(0),
                section=SECTIONS[int(kind)],
                aspect=aspect,
                twist=None if np.isnan(twist).any() else twist,
                plies=plies,
                float_width=lengths(wide)
                if field.HasArray(wide := f"{name}_float_width")
                else None,
            )
        )
    drawdown = values(_DRAWDOWN, int(ends) * int(picks)).reshape(int(picks), int(ends)) != 0
    layers, gap = None, nan
    if field.HasArray(_LAYERS):
        second = np.split(values(_LAYERS, int(ends) + int(picks)), [int(ends)])
        layers = Layers(drawdown, *(None if (one == 2).any() else one == 1 for one in second))
        gap = float(values(_GAP, 1)[0])
    return Cloth(
        drawdown=drawdown,
        warp=threads[0],
        weft=threads[1],
        crimp_height=height,
        overhang=overhang if overhang < inf else None,
        density=None if not density < inf else density if density == other else (density, other),
        caps=bool(caps),
        exact=bool(exact),
        axis=AXES[int(axis)],
        layers=layers,
        layer_gap=gap if gap < inf else None,
        middle=(middle[0], middle[1]),
    )


def cloth_stamp(data: vtkDataObject) -> int | None:
    """Return VTK's time of the last change of a data set's cloth; None without a cloth."""
    # No two arrays of a process have the same time, and all arrays of a cloth are made together.
    array = data.GetFieldData().GetArray(_MEASURES)
    return None if array is None else int(array.GetMTime())


def cloth_arrays(data: vtkDataObject) -> dict[str, NDArray[Any]]:
    """Return the field arrays of a cloth by name, without copies."""
    field = data.GetFieldData()
    names = [field.GetArrayName(index) for index in range(field.GetNumberOfArrays())]
    return {n: vtk_to_numpy(field.GetArray(n)) for n in names if n.startswith(_PREFIX)}


def copy_cloth(source: vtkDataObject, target: vtkDataObject) -> None:
    """Pass the field arrays of a cloth to another data set, without copies."""
    field = source.GetFieldData()
    for index in range(field.GetNumberOfArrays()):
        if field.GetArrayName(index).startswith(_PREFIX):
            target.GetFieldData().AddArray(field.GetAbstractArray(index))
