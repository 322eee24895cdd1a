"""Writing a scene's data for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkDataSet, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkAppendFilter, vtkPolyDataNormals, vtkTriangleFilter

from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.fabric.wif_writer import format_wif
from spacemap_vtk.memory import require
from spacemap_vtk.scenes.scene import Scene

#: What each file format can hold, the default first.
FORMATS: dict[str, tuple[str, ...]] = {
    ".vtu": ("patches", "cage"),
    ".vtp": ("surface",),
    ".stl": ("surface",),
    ".ply": ("surface",),
    ".wif": ("draft",),
}
#: What the writers of these take beside the surface, of each of its polygons [bytes].
_WORK = {".stl": 300, ".ply": 125}


def write(scene: Scene, what: str, file: Path) -> None:
    """Write patches, cage or surface, as of the scene's last update, or the weave's draft.

    Parameters
    ----------
    scene : Scene
        Updated to the time wanted.
    what : str
        ``"patches"``, ``"cage"``, ``"surface"`` or ``"draft"``, which needs no update.
    file : Path
        Its ending, a key of `FORMATS`, names the format.

    Raises
    ------
    InputError
        If the scene has no cage, and the cage is wanted.
    SizeError
        If the work would not fit into memory.
    SpacemapError
        If nothing was written.
    """
    if what == "draft":
        file.write_bytes(format_wif(scene.draft))
        return
    data = {
        "patches": lambda: scene.patches,
        "cage": lambda: scene.deformed_cage,
        "surface": lambda: scene.polygons,
    }[what]()
    require(
        _WORK.get(file.suffix, 0) * data.GetNumberOfCells(),
        f"{file.name}: to write {data.GetNumberOfCells()} polygons",
        cure="Lower surface.subdivisions, or write a .vtp, which needs no work.",
    )
    _write(data, file)
    if not file.is_file():
        raise SpacemapError(f"{file.name}: nothing was written; is the disk full?")


def _write(data: vtkDataSet, file: Path) -> None:
    """Write with VTK's writer for the ending."""
    writer: Any
    if file.suffix in (".vtu", ".vtp"):
        from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

        if file.suffix == ".vtp":
            writer = vtkXMLPolyDataWriter()
        else:
            writer = vtkXMLUnstructuredGridWriter()
            if isinstance(data, vtkPolyData):
                data = _only_output(vtkAppendFilter(), data)
        writer.SetDataModeToBinary()
        writer.SetCompressorTypeToZLib()  # of level 5; the one it begins with is of level 6
    else:
        if file.suffix == ".stl":
            from vtkmodules.vtkIOGeometry import vtkSTLWriter

            # The format knows triangles only; nothing but positions would arrive anyway.
            bare = vtkPolyData()
            bare.SetPoints(data.GetPoints())
            bare.SetPolys(data.GetPolys())
            data = _only_output(vtkTriangleFilter(), bare)
            writer = vtkSTLWriter()
        else:
            from vtkmodules.vtkIOPLY import vtkPLYWriter

            writer = vtkPLYWriter()
        writer.SetFileTypeToBinary()
        if data.GetNumberOfPolys() + data.GetNumberOfStrips():
            # Neighbours that face the same side: what these files are read for asks for it.
            normals = vtkPolyDataNormals()
            normals.SplittingOff()
            data = _only_output(normals, data)
    writer.SetFileName(str(file))
    writer.SetInputData(data)
    writer.Write()


def _only_output(algorithm: Any, data: vtkDataSet) -> Any:
    algorithm.AddInputData(data)
    algorithm.Update()
    return algorithm.GetOutput()
