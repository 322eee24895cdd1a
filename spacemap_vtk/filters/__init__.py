"""The filters: thin VTK algorithms over the kernels. No pyvista here."""
