"""Read meshes of other programs with VTK or, through pyvista, with meshio."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

from spacemap_vtk.errors import InputError, MissingLibraryError
from spacemap_vtk.io.file_references import names_in_hdf, names_in_xml, pattern_names
from spacemap_vtk.io.registry import reader_endings, reads, truncated_error

#: Patterns of file names in text formats. The last word of an EnSight line often names no file,
#: which does no harm.
_NAME_PATTERNS = {
    ".case": rb"(?m)^[^#\n]*:.*?(\S+|\"[^\"\n]*\")\s*$",
    ".inp": rb"(?im)^\*INCLUDE\s*,.*?INPUT\s*=\s*([^,\n]*)",
    ".nek5000": rb"(?m)^filetemplate:\s*(\S+)",
    ".p3d": rb"\"([^\"\n]*)\"",
    **dict.fromkeys((".mha", ".mhd"), rb"(?m)^\s*ElementDataFile\s*=(.*)$"),
    **dict.fromkeys((".nrrd", ".nhdr"), rb"(?im)^data ?file:(.*)$"),
}
#: TetGen writes two files that belong together.
_PARTNERS = {".ele": ".node", ".node": ".ele"}
#: Formats in XML.
_XML = (".pvtk", ".xdmf", ".xmf", ".pvd")


def _referenced_names(path: Path) -> list[str]:
    ending = path.suffix.lower()
    found = pattern_names(_NAME_PATTERNS[ending])(path) if ending in _NAME_PATTERNS else []
    if ending in _XML:
        found = names_in_xml(path)
    if ending == ".inp":  # a name is looked up in the working folder first
        found += [str(Path(word).absolute()) for word in found if os.path.isfile(word)]
    if ending in _PARTNERS:
        found += [f"{path.stem}{_PARTNERS[ending]}"]
    if ending == ".foam":
        found += [str(each.relative_to(path.parent)) for each in _foam_files(path.parent)]
    return found + names_in_hdf(path)


def _foam_files(folder: Path) -> list[Path]:
    """Return the files that OpenFOAM's reader looks for next to a .foam file, which is empty."""
    places = "system/controlDict", "constant/polyMesh/*", "[0-9]*/*"
    return sorted(file for place in places for file in folder.glob(place))


@reads(
    *(".pvtk", ".case", ".cas", ".cgns", ".neu", ".g", ".tri", ".facet"),
    *(".pts", ".p3d", ".foam", ".xdmf", ".xmf", ".dem", ".nrrd", ".mha"),
    *(".msh", ".inp", ".avs", ".med", ".mesh", ".meshb", ".bdf", ".fem", ".nas", ".vol", ".off"),
    *(".post", ".su2", ".tec", ".ele", ".node", ".ugrid", ".mdpa", ".f3grid", ".h5m", ".hmf"),
    label="Meshes of other programs",
    holds="mesh",
    common=False,
    rest=True,
    names=_referenced_names,
)
def read_with_pyvista(path: Path) -> Any:
    """Read a file; raise clear errors in place of what pyvista and meshio print."""
    from spacemap_vtk.datasets.vtk_messages import raise_vtk_errors
    from spacemap_vtk.io.crash_check import check_in_child
    from spacemap_vtk.io.reading import check_point_ids, read_with_vtk

    other = _format_option(path)
    if path.suffix.lower() in (".xdmf", ".xmf") and not other:
        # pyvista raises an error if such a file has no times
        return read_with_vtk(path, "vtkIOXdmf2", "vtkXdmfReader")
    try:
        import pyvista as pv
    except ImportError:
        raise MissingLibraryError(
            f"{path}: reading {path.suffix} needs pyvista", cure='Run "pip install pyvista".'
        ) from None
    printed = StringIO()
    try:
        check_in_child(path, f"{__name__}:read_with_pyvista")
        # meshio prints messages, and ends the program if it cannot read a file
        with (
            raise_vtk_errors(path),
            redirect_stdout(printed),
            redirect_stderr(printed),
            _quiet_logging(),
        ):
            # Absolute, because pyvista expands a relative path that begins with a folder "~".
            made = pv.read(path.absolute(), **other)
    except InputError:
        raise
    except ImportError as error:
        raise MissingLibraryError(
            f"{path}: {error}", cure=f'Run "pip install {error.name}".' if error.name else None
        ) from None
    except (Exception, SystemExit) as error:
        # pyvista and meshio raise many types: for unknown endings, broken headers, missing parts
        why = printed.getvalue() if isinstance(error, SystemExit) else str(error)
        meshes = reader_endings("mesh")
        raise InputError(
            f"{path}: cannot be read: {' '.join(why.split())[:200]}"
            if path.suffix.lower() in meshes
            else f"{path}: the ending is not that of a mesh",
            key="file",
            allowed="a complete file of a format that pyvista reads: " + ", ".join(meshes),
        ) from None
    if "not closed" in printed.getvalue():  # meshio continues with what it has read
        raise truncated_error(path)
    check_point_ids(made, path)
    return made


#: VTK's importers of whole scenes, of which only the surfaces are used.
_IMPORTERS = {".3ds": "vtk3DSImporter", ".wrl": "vtkVRMLImporter", ".vrml": "vtkVRMLImporter"}


@reads(*_IMPORTERS, label="Scenes of other programs", holds="mesh", common=False)
def read_scene(path: Path) -> Any:
    """Read the surfaces of a scene, also where no window can be opened."""
    # pyvista would open a plotter, which crashes where there are no OpenGL libraries.
    from spacemap_vtk.datasets.vtk_messages import raise_vtk_errors
    from spacemap_vtk.io.crash_check import check_in_child
    from spacemap_vtk.io.reading import check_point_ids

    check_in_child(path, f"{__name__}:read_scene")
    with raise_vtk_errors(path):
        from vtkmodules import vtkIOImport
        from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet
        from vtkmodules.vtkRenderingCore import vtkRenderer
        from vtkmodules.vtkRenderingOpenGL2 import vtkGenericOpenGLRenderWindow

        # An importer needs a window to fill. This one has no OpenGL context and is never drawn.
        window, renderer = vtkGenericOpenGLRenderWindow(), vtkRenderer()
        window.AddRenderer(renderer)
        importer = getattr(vtkIOImport, _IMPORTERS[path.suffix.lower()])()
        importer.SetFileName(str(path))
        importer.SetRenderWindow(window)
        importer.Update()
        made, actors = vtkMultiBlockDataSet(), renderer.GetActors()
        actors.InitTraversal()
        for number in range(actors.GetNumberOfItems()):
            mapper = actors.GetNextActor().GetMapper()
            mapper.Update()
            made.SetBlock(number, mapper.GetInput())
    check_point_ids(made, path)
    return made


@contextmanager
def _quiet_logging() -> Iterator[None]:
    """Suppress what pyvista logs about VTK's errors, which are raised as exceptions."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)


def _format_option(path: Path) -> dict[str, str]:
    """Return pyvista's option for a file that has the ending of another format."""
    with path.open("rb") as file:
        begin = file.read(256).lstrip()
    ending = path.suffix.lower()
    if ending == ".msh":
        # meshio tries its reader of ANSYS first, which takes Gmsh's files for its own.
        gmsh = begin.startswith(b"$MeshFormat")
        return {"file_format": "gmsh"} if gmsh else {"force_ext": ".cas"}
    if ending == ".inp" and begin.startswith(b"*"):
        return {"file_format": "abaqus"}  # otherwise VTK reads it as AVS
    if ending in (".xdmf", ".xmf") and b'Version="3' in begin:
        return {"file_format": "xdmf"}  # VTK's reader knows version 2 only
    return {}
