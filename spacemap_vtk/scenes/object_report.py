"""The figures of an object or of a textile that is not woven, and of its cage."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from vtkmodules import vtkCommonDataModel
from vtkmodules.vtkCommonDataModel import vtkFieldData, vtkPointSet, vtkUnstructuredGrid

from spacemap_vtk.cage.split import count_parts, tetrahedron_volumes
from spacemap_vtk.datasets.arrays import points_of, tetrahedra_of
from spacemap_vtk.datasets.extent import filled_share
from spacemap_vtk.datasets.outline import count_edge_faults, extract_outline
from spacemap_vtk.embedding.locate import locate
from spacemap_vtk.errors import add_section_to_errors
from spacemap_vtk.filters.cage_material import WOVEN
from spacemap_vtk.filters.modal_solver import ModalSolver
from spacemap_vtk.filters.patch_tessellator import polygons_of
from spacemap_vtk.filters.textile_sheet import sheet_of_textile, textile_of
from spacemap_vtk.ndarrays import Floats
from spacemap_vtk.scenes.report import report_law, report_sheet
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.valid_ranges import collect_findings

#: Class with the names of cell types; it was replaced in VTK 9.6.
_NAMES: Any = getattr(vtkCommonDataModel, "vtkCellTypeUtilities", vtkCommonDataModel.vtkCellTypes)


def report_object(scene: Scene) -> dict[str, Any]:
    """Return the figures of a scene's object or textile, and of its cage if it has one."""
    scene.update_stage(scene.source)
    data, picture = scene.source.GetOutputDataObject(0), scene.picture
    places = points_of(data).astype(np.float64, copy=False)
    low, high = places.min(axis=0), places.max(axis=0)
    points, triangles = extract_outline(data, polygons_of(data))
    triangles = triangles[triangles[:, 1] != triangles[:, 2]]
    open_, branching = count_edge_faults(triangles, points)
    figures: dict[str, Any] = {
        "textile": report_textile(scene),
        "file": str(scene.object.file) if scene.source is scene.object else None,
        "type": data.GetClassName(),
        "points": data.GetNumberOfPoints(),
        "cells": data.GetNumberOfCells(),
        "cell_types": _count_cell_types(data),
        "bounds": [low.tolist(), high.tolist()],
        "size": (high - low).tolist(),
        "arrays": _list_arrays(data.GetPointData(), "points")
        + _list_arrays(data.GetCellData(), "cells"),
        "triangles": len(triangles),
        "open_edges": open_,
        "branching_edges": branching,
        "picture": None if picture is None else list(picture.GetDimensions()[:2]),
        "cage": None,
        "steps": None,
        "time_range": None,
    }
    if scene.moves:
        made = scene.stage("cage")
        stage = made or scene.cage_stage
        scene.update_stage(stage)
        figures["cage"] = _report_cage(stage.output, places)
        if made is None:
            times = stage.time_steps([])
            figures |= {"steps": len(times), "time_range": [times[0], times[-1]]}
        solver = scene.stage("solver")
        if made is not None and isinstance(solver, ModalSolver):
            with add_section_to_errors(solver.section):
                sheet = solver.sheet_figures(made.output)
                figures |= report_sheet(sheet) | report_law(scene, sheet is not None)
                if sheet is not None and solver.material == WOVEN:
                    figures |= _report_curl(made.output)
    figures["applicability"] = [finding.as_json() for finding in collect_findings(scene)]
    figures["warnings"] = scene.warnings
    return figures


def _report_curl(cage: vtkUnstructuredGrid) -> dict[str, Any]:
    """Return how the sheet of a textile curls, and what its stiffness assumes."""
    textile = textile_of(cage)
    if textile is None:
        return {}
    (plate, notes), curls = sheet_of_textile(textile), None
    if plate.curvature is not None:
        curls = plate.curvature[[1, 0]].tolist()  # of the warp first, as other figures
    return {"natural_curvature": curls, "sheet_notes": notes}


def report_textile(scene: Scene) -> dict[str, Any] | None:
    """Return the figures that a scene's source declares for its yarns; None for an object."""
    made = scene.textile
    if made is None:
        return None
    diameters, extent, masses = made.yarn_diameters, made.extent, made.linear_densities
    return {
        "kind": getattr(scene.source, "kind", scene.source.section),
        "yarns": len(diameters),
        "families": dict(made.families),
        "diameters": [float(diameters.min()), float(diameters.max())],
        "extent": None if extent is None else extent.tolist(),
        "cell": None if made.cell is None else made.cell.tolist(),
        "linear_densities": None if masses is None else [float(masses.min()), float(masses.max())],
        **{measure.key: measure.value for measure in made.figures},
    }


def _report_cage(grid: vtkUnstructuredGrid, points: Floats) -> dict[str, Any]:
    vertices, tetrahedra = points_of(grid).astype(np.float64), tetrahedra_of(grid)
    where = locate(points, vertices, tetrahedra)
    return {
        "vertices": len(vertices),
        "tetrahedra": len(tetrahedra),
        "quadratic": grid.GetCells().GetMaxCellSize() > 4,
        "volume": float(np.abs(tetrahedron_volumes(vertices, tetrahedra)).sum()),
        "filled": filled_share(grid),
        "pieces": count_parts(tetrahedra)[0],
        "points_outside": where.outside,
        "largest_distance": where.largest_distance,
    }


def _count_cell_types(data: vtkPointSet) -> dict[str, int]:
    counts = Counter(data.GetCellType(i) for i in range(data.GetNumberOfCells()))
    return {
        _NAMES.GetClassNameFromTypeId(kind).removeprefix("vtk"): count
        for kind, count in sorted(counts.items())
    }


def _list_arrays(data: vtkFieldData, on: str) -> list[dict[str, Any]]:
    found = []
    for i in range(data.GetNumberOfArrays()):
        array = data.GetAbstractArray(i)
        role = data.IsArrayAnAttribute(i)
        found.append(
            {
                "name": array.GetName(),
                "on": on,
                "components": array.GetNumberOfComponents(),
                "type": array.GetDataTypeAsString(),
                "role": data.GetAttributeTypeAsString(role) if role >= 0 else None,
            }
        )
    return found
