"""Read knits from machine knitting files (.k) in the format knitout."""

from __future__ import annotations

from spacemap_vtk.io.registry import lazy_function, reads

reads(".k", ".knitout", label="Machine knitting in knitout", holds="knit")(
    lazy_function("yarns.knitout", "read_knitout")
)
