"""Report whether the plugin works in this ParaView; pvpython runs this file."""

import sys


def main() -> None:
    """Connect the six filters as ParaView's proxies, run them, and report the result."""
    from paraview import simple
    from vtkmodules.vtkCommonCore import vtkVersion

    if not hasattr(simple, "WeaveSource"):
        sys.exit("ParaView has not loaded the plugin: is PV_PLUGIN_CONFIG_FILE set?")
    from spacemap_vtk.paraview.stages import PROXIES

    weave = simple.WeaveSource(Ends=3, Picks=3)
    cage = simple.TetraCage(Input=weave, Divisions=[2, 2, 1], Order=2)
    modal = simple.ModalSolver(Input=cage, Modes=20)
    response = simple.ModalResponse(Input=modal)
    warp = simple.BarycentricWarp(Input=weave, Cage=response)
    surface = simple.PatchTessellator(Input=warp)
    surface.UpdatePipeline(0.1)
    cells = surface.GetDataInformation().GetNumberOfCells()
    missing = [name for name in PROXIES if not hasattr(simple, name)]
    if cells == 0 or missing:
        sys.exit(f"the pipeline made {cells} polygons; missing proxies: {missing}")
    version = simple.GetParaViewVersion()
    print(
        f"ParaView {version.major}.{version.minor}, VTK {vtkVersion.GetVTKVersion()}, "
        f"Python {sys.version.split()[0]}: {', '.join(PROXIES)} work"
    )


if __name__ == "__main__":
    main()
