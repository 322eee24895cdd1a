"""VTK's files in HDF5, with one time or many."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from spacemap_vtk.io.registry import reads

if TYPE_CHECKING:
    from spacemap_vtk.io.series import MeshSeries


@reads(".vtkhdf", label="VTK HDF5", holds="mesh")
def read_hdf(path: Path) -> Any:
    """Read the first step."""
    from spacemap_vtk.io.reading import read_with_vtk

    return read_with_vtk(path, "vtkIOHDF", "vtkHDFReader")


@reads(".vtkhdf", label="VTK HDF5", holds="motion")
def open_hdf(path: Path) -> MeshSeries:
    """Open all steps."""
    from vtkmodules.vtkIOHDF import vtkHDFReader

    from spacemap_vtk.io.series import ReaderSeries

    return ReaderSeries(path, vtkHDFReader())
