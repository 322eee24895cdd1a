"""A scene's data in the formats of other programs."""

from __future__ import annotations

from typing import Any

from vtkmodules.vtkCommonDataModel import vtkDataSet, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkAppendFilter, vtkPolyDataNormals, vtkTriangleFilter

from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.io.polygon_files import ply, stl
from spacemap_vtk.io.wif_writer import format_wif
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


def content(scene: Scene, what: str, ending: str) -> list[Any]:
    """Return what a file holds of patches, cage or surface, or the draft."""
    if what == "draft":
        return [format_wif(scene.draft)]
    data = {
        "patches": lambda: scene.patches,
        "cage": lambda: scene.deformed_cage,
        "surface": lambda: scene.polygons,
    }[what]()
    polygons = data.GetNumberOfCells()
    require(
        _WORK.get(ending, 0) * polygons,
        f"to write {polygons} polygons as {ending}",
        cure="Lower surface.subdivisions, or write a .vtp, which needs no work.",
    )
    if ending in (".vtu", ".vtp"):
        return [_xml(data, ending)]
    if ending == ".stl":
        # The format knows triangles only; nothing but positions would arrive anyway.
        bare = vtkPolyData()
        bare.SetPoints(data.GetPoints())
        bare.SetPolys(data.GetPolys())
        return stl(_facing(_only_output(vtkTriangleFilter(), bare)))
    return ply(_facing(data))


def _xml(data: vtkDataSet, ending: str) -> bytes:
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

    writer: Any
    if ending == ".vtp":
        writer = vtkXMLPolyDataWriter()
    else:
        writer = vtkXMLUnstructuredGridWriter()
        if isinstance(data, vtkPolyData):
            data = _only_output(vtkAppendFilter(), data)
    writer.SetDataModeToBinary()
    writer.SetCompressorTypeToZLib()  # of level 5; the one it begins with is of level 6
    writer.SetInputData(data)
    writer.WriteToOutputStringOn()
    done = writer.Write()
    text = writer.GetOutputString()
    fault = writer.GetErrorCode()
    del writer  # and with it another copy
    # Bytes where a name in the data is no UTF-8.
    made = text if isinstance(text, bytes) else text.encode()
    if not done or fault or not made.endswith(b"</VTKFile>\n"):
        from vtkmodules.vtkCommonMisc import vtkErrorCode

        why = vtkErrorCode.GetStringFromErrorCode(fault)
        raise SpacemapError(f"VTK has not made the {ending} file: {why}")
    return made


def _facing(data: vtkPolyData) -> vtkPolyData:
    """Return polygons of which neighbours face the same side, as readers of such files ask for."""
    if data.GetNumberOfPolys() + data.GetNumberOfStrips() == 0:
        return data
    normals = vtkPolyDataNormals()
    normals.SplittingOff()
    return _only_output(normals, data)


def _only_output(algorithm: Any, data: vtkDataSet) -> Any:
    algorithm.AddInputData(data)
    algorithm.Update()
    return algorithm.GetOutput()
