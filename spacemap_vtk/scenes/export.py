"""Writing a scene's data for other programs."""

from __future__ import annotations

from pathlib import Path

import pyvista as pv
from vtkmodules.vtkCommonDataModel import vtkPolyData

from spacemap_vtk.errors import SpacemapError
from spacemap_vtk.fabric.wif_writer import format_wif
from spacemap_vtk.scenes.scene import Scene

#: What each file format can hold, the default first.
FORMATS: dict[str, tuple[str, ...]] = {
    ".vtu": ("patches", "cage"),
    ".vtp": ("surface",),
    ".stl": ("surface",),
    ".ply": ("surface",),
    ".wif": ("draft",),
}


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
    if file.suffix == ".stl":
        # The format knows triangles only; nothing but positions would arrive anyway.
        bare = vtkPolyData()
        bare.SetPoints(data.GetPoints())
        bare.SetPolys(data.GetPolys())
        data = pv.wrap(bare).triangulate()
    if file.suffix == ".vtu" and isinstance(data, vtkPolyData):
        data = pv.wrap(data).cast_to_unstructured_grid()
    pv.wrap(data).save(file)
    if not file.is_file():
        raise SpacemapError(f"{file.name}: nothing was written; is the disk full?")
