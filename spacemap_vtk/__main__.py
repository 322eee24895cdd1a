"""``python -m spacemap_vtk``: the command line."""

from spacemap_vtk.cli.main import main

main()
