"""Small whole files of the rarer formats, and the files that some of them name."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

#: Files that are read with another one, and which: what is fuzzed is the one that is named.
NAMED = {
    "a.geo": "a.case",
    "a.xyz": "a.p3d",
    "a.mtl": "a.obj",
    "a.node": "a.ele",
    "s0.vtu": "a.pvtu",
    **dict.fromkeys((f"constant/polyMesh/{part}" for part in ("points", "faces")), "a.foam"),
    **dict.fromkeys((f"constant/polyMesh/{part}" for part in ("owner", "boundary")), "a.foam"),
}

_XML = '<VTKFile type="P{kind}"><P{kind} {extent}><PPoints>{array}</PPoints><PCoordinates>'
_XML += '{array}{array}{array}</PCoordinates><Piece {piece} Source="s0.{ending}"/></P{kind}>'
_XML += "</VTKFile>"
_FOAM = "FoamFile {{ version 2.0; format ascii; class {kind}; object {name}; }}\n"
#: Each corner and its normal.
_TRI = struct.pack(">18f", 0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 1)
_MTL = b"newmtl a\nKd 1 0 0\nnewmtl b\nKd 0.5 0.5 1\nmap_Kd -s 1 1 1 a.png\n"
_GEO = """a
b
node id off
element id off
part
         1
one
coordinates
         4
 0.00000e+00
 1.00000e+00
 0.00000e+00
 0.00000e+00
 0.00000e+00
 0.00000e+00
 1.00000e+00
 0.00000e+00
 0.00000e+00
 0.00000e+00
 0.00000e+00
 1.00000e+00
tetra4
         1
         1         2         3         4
tria3
         1
         1         2         3
"""
_CAS = """(0 "a")
(2 3)
(10 (0 1 4 0 3))
(10 (1 1 4 1 3)(
0 0 0
1 0 0
0 1 0
0 0 1
))
(12 (0 1 1 0))
(12 (2 1 1 1 2))
(13 (0 1 4 0))
(13 (3 1 4 3 3)(
1 2 3 1 0
1 2 4 1 0
1 3 4 1 0
2 3 4 1 0
))
(45 (2 fluid a)())
(45 (3 wall b)())
"""
_NEU = """        CONTROL INFO 2.3.16
** GAMBIT NEUTRAL FILE
a
PROGRAM:                Gambit     VERSION:  2.3.16
 Jan 2007
     NUMNP     NELEM     NGRPS    NBSETS     NDFCD     NDFVL
         4         1         1         0         3         3
ENDOFSECTION
   NODAL COORDINATES 2.3.16
         1   0.0 0.0 0.0
         2   1.0 0.0 0.0
         3   0.0 1.0 0.0
         4   0.0 0.0 1.0
ENDOFSECTION
      ELEMENTS/CELLS 2.3.16
       1  6  4        1       2       3       4
ENDOFSECTION
       ELEMENT GROUP 2.3.16
GROUP:          1 ELEMENTS:          1 MATERIAL:          2 NFLAGS:          1
                           fluid
       0
       1
ENDOFSECTION
"""
_XDMF = """<Xdmf Version="2.0"><Domain><Grid Name="a"><Topology TopologyType="Tetrahedron"
NumberOfElements="1"><DataItem Dimensions="1 4" NumberType="Int">0 1 2 3</DataItem></Topology>
<Geometry GeometryType="XYZ"><DataItem Dimensions="4 3">0 0 0 1 0 0 0 1 0 0 0 1</DataItem>
</Geometry><Attribute Name="u" Center="Node"><DataItem Dimensions="4">0 1 2 3</DataItem></Attribute>
</Grid></Domain></Xdmf>"""


def rare(folder: Path, solid: Any, ball: Any) -> tuple[dict[str, list[bytes]], dict[str, bytes]]:
    """Return files by ending, and by their names those that they name."""
    import pyvista as pv
    from vtkmodules.vtkIOGeometry import vtkBYUWriter

    found: dict[str, list[bytes]] = {
        ".case": [b"FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: a.geo\n"],
        ".cas": [_CAS.encode()],
        ".neu": [_NEU.encode()],
        ".3ds": [_3ds()],
        ".tri": [_TRI],
        ".facet": [b"FACET FILE\n1\na\n0\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n1\na\n1 3\n1 2 3 0 0\n"],
        ".pts": [b"%d\n" % len(rows) + b"\n".join(rows) for rows in _clouds()],
        ".ugrid": [b"4 1 0 1 0 0 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 2 3\n5\n1 2 3 4\n"],
        ".p3d": [json.dumps({"auto-detect-format": True,
                             "filenames": [{"time": 0, "xyz": "a.xyz"}]}).encode()],
        ".dem": [_dem()],
        ".foam": [b"\n"],
        ".pvtk": [b'<File version="pvtk-1.0" dataType="vtkUnstructuredGrid" numberOfPieces="1">'
                  b'<Piece fileName="s0.vtk"/></File>'],
        ".vtpd": [b'<VTKFile type="vtkPartitionedDataSet"><vtkPartitionedDataSet>'
                  b'<DataSet index="0" file="s0.vtu"/></vtkPartitionedDataSet></VTKFile>'],
    }  # fmt: skip
    beside = {"a.geo": _GEO.encode(), "a.mtl": _MTL, "a.xyz": _plot3d(), **_foam()}
    beside["a.obj"] = (
        b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
        b"usemtl a\nf 1 2 3\nusemtl b\nf 1/1 2/2 3/3\n"
    )
    for name in {*NAMED.values()} - {"a.obj", "a.ele", "a.pvtu"}:
        beside[name] = found[Path(name).suffix][0]
    solid.save(folder / "s0.vtk")
    ball.save(folder / "s0.vtp")
    image = pv.ImageData(dimensions=(2, 2, 2))
    image.save(folder / "s0.vti")
    image.cast_to_structured_grid().save(folder / "s0.vts")
    image.cast_to_rectilinear_grid().save(folder / "s0.vtr")
    array = '<PDataArray type="Float32" NumberOfComponents="{}"/>'
    kinds = {"i": "ImageData", "s": "StructuredGrid", "r": "RectilinearGrid"}
    for letter, kind in (kinds | {"u": "UnstructuredGrid", "p": "PolyData"}).items():
        lattice = letter in kinds
        extent = 'WholeExtent="0 1 0 1 0 1" Spacing="1 1 1" Origin="0 0 0"' if lattice else ""
        piece = 'Extent="0 1 0 1 0 1"' if lattice else ""
        row = array.format(1 if letter == "r" else 3)
        text = _XML.format(kind=kind, ending=f"vt{letter}", extent=extent, piece=piece, array=row)
        found[f".pvt{letter}"] = [text.encode()]
    beside["a.pvtu"] = found[".pvtu"][0]
    beside |= {f.name: f.read_bytes() for f in folder.glob("s0.vt?")}
    write = vtkBYUWriter()
    write.SetInputData(ball)
    write.SetGeometryFileName(str(folder / "r.g"))
    write.Write()
    bare = solid.copy()
    bare.clear_data()
    for ending, kind in ((".node", "tetgen"), (".h5m", "h5m")):
        pv.save_meshio(folder / f"r{ending}", bare, file_format=kind)
    pv.save_meshio(folder / "r.xdmf", solid, file_format="xdmf", data_format="XML")
    _cgns(folder / "r.cgns")
    for file in folder.glob("r.*"):
        found[file.suffix] = [file.read_bytes()]
    beside["a.node"], beside["a.ele"] = found[".node"][0], found[".ele"][0]
    found[".xdmf"].append(_XDMF.encode())
    found[".xmf"] = found[".xdmf"]
    return found, beside


def _3ds() -> bytes:
    def chunk(kind: int, content: bytes) -> bytes:
        return struct.pack("<HI", kind, 6 + len(content)) + content

    points = struct.pack("<H9f", 3, 0, 0, 0, 1, 0, 0, 0, 1, 0)
    faces = struct.pack("<H4H", 1, 0, 1, 2, 7)
    mesh = chunk(0x4100, chunk(0x4110, points) + chunk(0x4120, faces))
    return chunk(0x4D4D, chunk(0x3D3D, chunk(0x4000, b"one\0" + mesh)))


def _clouds() -> list[list[bytes]]:
    return [[b"%d 0 1" % n + b" 7" * more for n in range(9)] for more in (0, 1, 3, 4)]


def _cgns(path: Path) -> None:
    """Write a tetrahedron: meshio's own files are read by meshio alone."""
    import h5py
    import numpy as np

    def node(above: Any, name: str, label: str, value: Any = None) -> Any:
        made = above.create_group(name)
        value = None if value is None else np.asarray(value)
        kinds = {"i": "I4", "f": "R8", "u": "C1"}
        kind = "MT" if value is None else kinds[value.dtype.kind]
        for key, text, size in (("name", name, 33), ("label", label, 33), ("type", kind, 3)):
            made.attrs[key] = np.array(text.encode(), f"S{size}")
        made.attrs["flags"] = np.array([1], np.int32)
        if value is not None:
            made[" data"] = value.T
        return made

    def letters(word: str) -> Any:
        return np.frombuffer(word.encode(), np.uint8).astype(np.int8).view("u1")

    with h5py.File(path, "w") as made:
        made.attrs["name"] = np.array(b"HDF5 MotherNode", "S33")
        made.attrs["label"] = np.array(b"Root Node of HDF5 File", "S33")
        made.attrs["type"] = np.array(b"MT", "S3")
        made[" format"] = np.frombuffer(b"IEEE_LITTLE_32\0", np.int8)
        made[" hdf5version"] = np.frombuffer(b"HDF5 Version 1.10.4".ljust(33, b"\0"), np.int8)
        node(made, "CGNSLibraryVersion", "CGNSLibraryVersion_t", np.array([3.3], np.float32))
        made["CGNSLibraryVersion"].attrs["type"] = np.array(b"R4", "S3")
        base = node(made, "Base", "CGNSBase_t", np.array([3, 3], np.int32))
        zone = node(base, "Zone", "Zone_t", np.array([[4, 1, 0]], np.int32))
        node(zone, "ZoneType", "ZoneType_t", letters("Unstructured"))
        places = node(zone, "GridCoordinates", "GridCoordinates_t")
        for axis, row in zip("XYZ", np.eye(4, 3, -1).T, strict=True):
            node(places, f"Coordinate{axis}", "DataArray_t", row)
        cells = node(zone, "Cells", "Elements_t", np.array([10, 0], np.int32))
        node(cells, "ElementRange", "IndexRange_t", np.array([1, 1], np.int32))
        node(cells, "ElementConnectivity", "DataArray_t", np.array([1, 2, 3, 4], np.int32))
        values = node(zone, "Solution", "FlowSolution_t")
        node(values, "GridLocation", "GridLocation_t", letters("Vertex"))
        node(values, "Heat", "DataArray_t", np.arange(4.0))


def _dem() -> bytes:
    head = f"{'a':144}" + "".join(f"{n:6}" for n in (1, 1, 1, 10))
    head += "".join(f"{'0.000000000000000D+00':>24}" for _ in range(15))
    head += "".join(f"{n:6}" for n in (2, 2, 4))
    corners = 0, 0, 0, 30, 30, 30, 30, 0
    head += "".join(f"{f'0.{n:02}0000000000000D+02':>24}" for n in corners)
    head += "".join(f"{f'0.{n:02}0000000000000D+02':>24}" for n in (1, 9, 0)) + f"{0:6}"
    # VTK divides by 0 where a side has fewer than 100 heights
    head += "".join(f"{'0.300000E+00':>12}" for _ in range(2)) + f"{'0.100000E+01':>12}"
    head += f"{1:6}{2:6}"
    rows = ""
    for column in (1, 2):
        row = f"{1:6}{column:6}{2:6}{1:6}"
        row += "".join(
            f"{f'0.{n:02}0000000000000D+02':>24}" for n in (30 * column - 30, 0, 0, 1, 9)
        )
        rows += f"{row}{1:6}{9:6}\n"
    return f"{head:1024}{rows}".encode()


def _plot3d() -> bytes:
    lattice = [(i, j, k) for k in range(2) for j in range(2) for i in range(2)]
    places = [point[axis] for axis in range(3) for point in lattice]
    return struct.pack("<3i24f", 2, 2, 2, *places)


def _foam() -> dict[str, bytes]:
    points = "4\n(\n(0 0 0)\n(1 0 0)\n(0 1 0)\n(0 0 1)\n)\n"
    faces = "4\n(\n3(0 2 1)\n3(0 1 3)\n3(0 3 2)\n3(1 2 3)\n)\n"
    boundary = "1\n(\nwall { type wall; nFaces 4; startFace 0; }\n)\n"
    parts = {
        "points": ("vectorField", points),
        "faces": ("faceList", faces),
        "owner": ("labelList", "4\n(\n0\n0\n0\n0\n)\n"),
        "neighbour": ("labelList", "0\n(\n)\n"),
        "boundary": ("polyBoundaryMesh", boundary),
    }
    made = {
        f"constant/polyMesh/{name}": (_FOAM.format(kind=kind, name=name) + text).encode()
        for name, (kind, text) in parts.items()
    }
    control = "startTime 0;\nendTime 1;\ndeltaT 1;\nwriteControl timeStep;\nwriteInterval 1;\n"
    control += "timePrecision 6;\nwriteFormat ascii;\n"
    head = _FOAM.format(kind="dictionary", name="controlDict")
    return made | {"system/controlDict": (head + control).encode()}
