"""Small whole files of every kind that is read, and how fuzz.py changes them."""

from __future__ import annotations

import io
import json
import re
import struct
import tempfile
import warnings
import zipfile
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

from fuzz_rare import NAMED, rare

SCENES = Path(__file__).parents[1] / "scenes"

#: What pyvista and meshio write of a small mesh, by ending, and as which of meshio's formats.
MESHIO = {
    **{".msh": "gmsh", ".inp": "abaqus", ".avs": "avsucd", ".mesh": "medit", ".bdf": "nastran"},
    **{".off": "off", ".su2": "su2", ".tec": "tecplot", ".mdpa": "mdpa", ".f3grid": "flac3d"},
    **{".vol": "netgen", ".med": "med"},
    **{".fem": "nastran", ".nas": "nastran", ".post": "permas", ".meshb": "medit", ".hmf": "hmf"},
}

LONGEST = 2**18

#: What is changed, roughly where, and into what: `changed` makes sense of any three numbers.
Step = tuple[int, int, int]

EXTREMES = [
    *(b"0", b"-1", b"1", b"2", b"-0", b"255", b"256", b"65536", b"2147483647", b"-2147483648"),
    *(
        b"4294967295",
        b"9223372036854775807",
        b"99999999999999999999",
        b"1e308",
        b"1e999",
        b"1e-320",
    ),
    *(
        b"nan",
        b"-inf",
        b"0.5",
        b"1e9",
        b"100000",
        b"0x10",
        b"1_0",
        b"9" * 5000,
        b"true",
        b"",
        b'""',
    ),
    *(b"[]", b"{}", b"null", b"'a'", b"1979-05-27", b"07:32:00", b"auto", b"\xd9\xa3", b"\xc2\xb2"),
]
WEDGES = [
    *(
        b"\0",
        b"\xff",
        b"\xc3",
        b"\xef\xbb\xbf",
        b"\xff\xfe",
        b"\r",
        b"\n",
        b"\t",
        b" ",
        b"\x0c",
        b"\x85",
    ),
    *(
        b"[" * 2000,
        b"{" * 2000,
        b"(" * 2000,
        b"a={" * 400,
        b"<a>" * 2000,
        b"\0" * 3000,
        b"A" * 9000,
    ),
    *(b"%s%n", b"../../etc/passwd", b"\\", b'"', b"'", b'"""', b"#", b";", b"=", b"]", b"}", b","),
    *(
        b"<!DOCTYPE a [<!ENTITY b 'c'>]>",
        b"&b;",
        b"\x1b[31m",
        b"\xf0\x9f\xa7\xb5",
        b"e",
        b"x",
        b"-",
    ),
]
INTEGERS = [0, 1, -1, 2, 127, 128, 255, 2**15, 2**16 - 1, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**62]
_NUMBER = re.compile(rb"[-+]?[0-9]+(?:\.[0-9]+)?(?:[eE][-+]?[0-9]+)?")
WORD = re.compile(rb"[A-Za-z_@%#:.][A-Za-z_0-9.:]+")


def changed(data: bytes, steps: Sequence[Step], words: Sequence[bytes], other: bytes) -> bytes:
    """Change a file in steps, with words of its kind and another file to take parts from."""
    for what, where, which in steps:
        size = len(data)
        at, far = where % (size + 1), (where >> 20) % (size + 1)
        low, high = min(at, far), max(at, far)
        kind = what % 18
        if kind == 0:
            data = data[:at] + bytes([which & 255]) + data[at + 1 :]
        elif kind == 1 and at < size:
            data = data[:at] + bytes([data[at] ^ 1 << which % 8]) + data[at + 1 :]
        elif kind == 2:
            number = INTEGERS[which % len(INTEGERS)] & 2**64 - 1
            width, order = 1 << which // 16 % 4, ("little", "big")[which // 64 % 2]
            put = (number & (1 << 8 * width) - 1).to_bytes(width, order)  # type: ignore[arg-type]
            data = data[:at] + put + data[at + width :]
        elif kind == 3:
            data = data[:at] + data[at + 1 + which % 64 :]
        elif kind == 4:
            data = data[:low] + data[high:] if which % 2 else data[:at]
        elif kind == 5 and high > low:
            times = (1, 1, 2, 50)[which % 4]
            data = data[:high] + (data[low:high] * times)[:LONGEST] + data[high:]
        elif kind in (6, 7, 8):  # most of what these files say are numbers
            data = _replaced(_NUMBER, data, where, EXTREMES[which % len(EXTREMES)])
        elif kind in (9, 10):
            data = _replaced(WORD, data, where, words[which % len(words)])
        elif kind == 11:
            data = data[:at] + WEDGES[which % len(WEDGES)] + data[at:]
        elif kind == 12:
            data = data[:at] + words[which % len(words)] + data[at:]
        elif kind == 13:
            begin = which % (len(other) + 1)
            data = data[:at] + other[begin : begin + 1 + (which >> 16) % 400] + data[far:]
        elif kind in (14, 15, 16):
            lines = data.split(b"\n")
            one, two = at % len(lines), far % len(lines)
            if kind == 14:
                lines[one], lines[two] = lines[two], lines[one]
            elif kind == 15:
                lines.insert(two, lines[one])
            else:
                del lines[one]
            data = b"\n".join(lines)
        elif which % 4 == 0:
            text = data.decode("latin-1")
            data = text.encode(("utf-16", "utf-8", "utf-32", "utf-8-sig")[which // 4 % 4])
        data = data[:LONGEST]
    return data


def _replaced(pattern: re.Pattern[bytes], data: bytes, where: int, put: bytes) -> bytes:
    begin = where % (len(data) + 1)
    found = pattern.search(data, begin) or pattern.search(data)
    return data[: found.start()] + put + data[found.end() :] if found else data + put


def seeds(kind: str) -> list[bytes]:
    """Return small whole files of an ending or another kind, or the one that others name."""
    if kind in quick():
        return quick()[kind]
    return [beside()[kind]] if kind in NAMED else meshes()[kind]


@cache
def quick() -> dict[str, list[bytes]]:
    """Return drafts, pictures and kept modes, which need no VTK, by ending."""
    import numpy as np
    from PIL import Image

    from spacemap_vtk.io.drafts.draft_file import format_rows
    from spacemap_vtk.io.drafts.dtx import format_dtx
    from spacemap_vtk.io.drafts.wif import parse_wif

    texts = [SHORT_WIF, *(path.read_bytes() for path in sorted(SCENES.glob("*.wif")))]
    found: dict[str, list[bytes]] = {
        # the short one is read soonest
        ".wif": [*[SHORT_WIF] * 5, *texts],
        ".txt": [b"1,3\n2,4\n1,2\n3,4\n", b"1: 1 3\n2: 2 4\n", b"#.#.\n.#.#\n", SHORT_WIF],
        ".wpo": [_wpo(kind, version) for kind in (100, 101, 102) for version in (3, 7)],
        ".dtx": [format_dtx(parse_wif(text)) for text in texts],
        ".twa": [],
        "picture": [],
        "modes": [],
        "scene": [path.read_bytes() for path in sorted(SCENES.glob("*.toml"))],
        "table": [b"0,0\n0.1,1\n0.5,0\n", b"time;factor\n0;1,5\n1;2\n", b"# a\n1\n2\n3\n"],
    }
    found[".txt"] += [format_rows(parse_wif(text))[:900] for text in texts]
    found[".wifw"] = found[".plm"] = found[".wif"]
    found["set"] = assignments()
    for packing in (zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED):
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", packing) as archive:
            archive.writestr("TWAmain.waf", SHORT_WIF)
        found[".twa"].append(packed.getvalue())
    cells = Image.fromarray(np.arange(64).reshape(8, 8) % 3 == 0)
    for kind in ("PNG", "GIF", "BMP", "TIFF", "JPEG"):
        packed = io.BytesIO()
        cells.convert("L" if kind == "JPEG" else "1").save(packed, kind)
        found["picture"].append(packed.getvalue())
    found["texture"] = found["picture"]
    modes = {"eigenvalues": np.ones(3), "shapes": np.ones((3, 8, 3)), "rounding": np.ones(3)}
    writers: Any = (np.savez, np.savez_compressed)
    for write, given in product(writers, (modes, {"rows": np.ones((4, 6))})):
        packed = io.BytesIO()
        write(packed, **given)
        found["modes"].append(packed.getvalue())
    return found


def meshes() -> dict[str, list[bytes]]:
    """Return meshes, motions and files with records, by ending."""
    return _made()[0]


def beside() -> dict[str, bytes]:
    """Return the files that these name, by name."""
    return _made()[1]


@cache
def _made() -> tuple[dict[str, list[bytes]], dict[str, bytes]]:
    printed = io.StringIO()  # what meshio leaves out
    with (
        tempfile.TemporaryDirectory() as name,
        redirect_stdout(printed),
        redirect_stderr(printed),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")  # some tetrahedra are inverted
        return _meshes(Path(name))


def _meshes(folder: Path) -> tuple[dict[str, list[bytes]], dict[str, bytes]]:
    import numpy as np
    import pyvista as pv
    from vtkmodules.vtkIOExodus import vtkExodusIIWriter
    from vtkmodules.vtkIOHDF import vtkHDFWriter

    from spacemap_vtk import MotionReader
    from spacemap_vtk.io.provenance import Record, attach_record, record_comments
    from spacemap_vtk.io.registry import writer

    found: dict[str, list[bytes]] = {}

    def take(path: Path, ending: str = "") -> None:
        if path.is_file():
            found.setdefault(ending or path.suffix, []).append(path.read_bytes())

    solid = pv.ImageData(dimensions=(3, 2, 2)).to_tetrahedra()
    solid["displacement"] = 0.1 * solid.points
    solid["part"] = np.arange(solid.n_cells)
    ball = pv.Sphere(theta_resolution=6, phi_resolution=5)
    ball["heat"] = ball.points[:, 2]
    ball.active_texture_coordinates = ball.points[:, :2].astype(np.float32)
    for binary in (True, False):
        for ending in (".ply", ".stl", ".vtk", ".vtp"):
            ball.save(folder / f"b{ending}", binary=binary)
            take(folder / f"b{ending}")
        for ending in (".vtk", ".vtu"):
            solid.save(folder / f"c{ending}", binary=binary)
            take(folder / f"c{ending}")
    small = {
        ".vti": pv.ImageData(dimensions=(3, 3, 2)),
        ".vtr": pv.RectilinearGrid([0, 1], [0, 2], [0, 3]),
    }
    small |= {".vts": small[".vti"].cast_to_structured_grid()}
    for ending, grid in small.items():
        for ascii_ in (True, False):
            grid["a"] = np.arange(grid.n_points)
            grid.save(folder / f"d{ending}", binary=not ascii_)
            take(folder / f"d{ending}")
            grid.save(folder / "d.vtk", binary=not ascii_)
            take(folder / "d.vtk")
    pv.MultiBlock([ball, solid]).save(folder / "e.vtm")
    take(folder / "e.vtm")
    # of what lies beside
    found[".vtm"] = [re.sub(rb'"[^"]*[.](vtp|vtu)"', b'"s0.vtu"', found[".vtm"][0])]
    obj = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\n"
    found[".obj"] = [obj + b"usemtl a\nf 1/1/1 2/2/1 3/3/1\nusemtl b\nf 2/1 3/2 4/3\nl 1 2\n"]
    found[".obj"] += [obj + b"f -1 -2 -3\ng a\np 1\n"]
    found[".gltf"], found[".glb"] = _gltf()
    for ending, kind in MESHIO.items():
        grid = ball if ending == ".off" else solid.copy()
        if ending in (".med", ".mdpa", ".vol", ".bdf", ".nas", ".fem"):
            grid.clear_data()
        pv.save_meshio(folder / f"m{ending}", grid, file_format=kind)
        take(folder / f"m{ending}")
    found[".vtmb"] = found[".vtm"]
    found[".wrl"] = [
        b"#VRML V2.0 utf8\nShape { geometry IndexedFaceSet { coord Coordinate { point "
        b"[0 0 0, 1 0 0, 0 1 0] } coordIndex [0 1 2 -1] } }\n"
    ]
    found[".nrrd"] = [
        b"NRRD0004\ntype: float\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n\n" + b"\0" * 32
    ]
    found[".mha"] = [
        b"ObjectType = Image\nNDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\n"
        b"ElementDataFile = LOCAL\n" + b"\1" * 8
    ]
    found[".vrml"] = found[".wrl"]

    # motions: what they name lies beside them where they are read
    steps = []
    for step in range(3):
        grid = solid.copy()
        grid["displacement"] = 0.1 * step * grid.points
        grid.save(folder / f"s{step}.vtu")
        steps.append(f"s{step}.vtu")
    listed = "".join(f'<DataSet timestep="{k}" part="0" file="{n}"/>' for k, n in enumerate(steps))
    collection = f'<VTKFile type="Collection"><Collection>{listed}</Collection></VTKFile>'
    found["motion.pvd"] = [collection.encode()]
    entries = [{"name": name, "time": k} for k, name in enumerate(steps)]
    found["motion.series"] = [json.dumps({"file-series-version": "1.0", "files": entries}).encode()]
    (folder / "m.pvd").write_bytes(found["motion.pvd"][0])
    for ending, made in ((".vtkhdf", vtkHDFWriter()), (".e", vtkExodusIIWriter())):
        source = MotionReader(file=folder / "m.pvd")
        made.SetFileName(str(folder / f"n{ending}"))
        made.SetInputConnection(source.GetOutputPort())
        made.SetWriteAllTimeSteps(True)
        if ending == ".vtkhdf":
            made.SetChunkSize(8)  # of 25000, a file of more than `LONGEST`
        made.Write()
        take(folder / f"n{ending}")
        take(folder / f"n{ending}", f"motion{ending}")
    writer(Path("a.vtkhdf"), "surface").write(folder / "o.vtkhdf", iter([(0.0, ball), (1.0, ball)]))
    take(folder / "o.vtkhdf")
    for ending in (".ex2", ".exo", ".exii"):
        found[ending], found[f"motion{ending}"] = found[".e"], found["motion.e"]

    scene = "[weave]\nends = 3\npicks = 3\n"
    record = Record("1.0", {"what": "surface", "times": [0.0]}, scene, "a.toml", (0.0,))
    with attach_record(record):
        comment = "\n".join(record_comments(";")).encode()
        found["record.wif"] = [SHORT_WIF + comment]
        for ending in (".vtp", ".png"):
            data = ball if ending == ".vtp" else np.zeros((4, 4, 3), np.uint8)
            kind = "surface" if ending == ".vtp" else "picture"
            writer(Path(f"a{ending}"), kind).write(folder / f"r{ending}", data)
            take(folder / f"r{ending}", f"record{ending}")
    found["record.html"] = [
        b'<script type="application/json" id="scene">{"spacemap-record": %s}</script>'
        % record.text.encode()
    ]
    found["record.glb"] = _gltf({"spacemap-record": json.loads(record.text)})[1]
    others, beside = rare(folder, solid, ball)
    return found | others, beside | {name: (folder / name).read_bytes() for name in steps}


SHORT_WIF = b"""[WIF]
Version=1.1
[CONTENTS]
COLOR PALETTE=true
[WEAVING]
Shafts=2
Treadles=2
Rising Shed=true
[WARP]
Threads=4
Color=1
Units=centimeters
Spacing=0.1
[WEFT]
Threads=2
Color=2
Units=centimeters
Thickness=.05
[COLOR PALETTE]
Entries=2
Range=0,255
[COLOR TABLE]
1=0,0,255
2=255,0,0
[THREADING]
1=1
2=2
3=1
4=2
[TIEUP]
1=1
2=2
[TREADLING]
1=1
2=2
[LIFTPLAN]
1=1
[WARP COLORS]
1=2
[WEFT SPACING]
2=0.3
[TEXT]
Title=t
"""


def _wpo(kind: int, version: int) -> bytes:
    head = bytearray(24)
    head[:3], head[4], head[5], head[9], head[10] = bytes([123, version, kind]), 4, 4, 10, 12
    head[13:17], head[17] = struct.pack(">HH", 6, 4), 1

    def listed(numbers: Sequence[int]) -> bytes:
        return struct.pack(">H", len(numbers)) + bytes(numbers)

    colors = bytes([2, 10, 20, 30, 40, 50, 60])
    tieup = b"" if kind == 100 else bytes([1, 2, 4, 8])
    picks = listed([1, 2, 3, 4])
    threading = listed([1, 2, 3, 4, 1, 2]) + listed([0] * 6) + listed([1] * 4)
    return bytes(head) + threading + tieup + picks + bytes(66) + colors


def _gltf(extras: dict[str, Any] | None = None) -> tuple[list[bytes], list[bytes]]:
    import base64

    places = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0) + struct.pack("<6f", 0, 0, 1, 0, 0, 1)
    packed = places + struct.pack("<3H", 0, 1, 2) + b"\0\0"
    scene: dict[str, Any] = {
        "asset": {"version": "2.0", "extras": extras or {}},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [0, 0, 1]}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
             "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 3, "type": "SCALAR"}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 24},
            {"buffer": 0, "byteOffset": 60, "byteLength": 6}],
        "buffers": [{"byteLength": len(packed)}],
    }  # fmt: skip
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    whole = 12 + 8 + len(text) + 8 + len(packed)
    binary = b"glTF" + struct.pack("<II", 2, whole) + struct.pack("<I", len(text)) + b"JSON" + text
    binary += struct.pack("<I", len(packed)) + b"BIN\0" + packed
    uri = "data:application/octet-stream;base64," + base64.b64encode(packed).decode()
    scene["buffers"][0]["uri"] = uri
    return [json.dumps(scene).encode(), json.dumps(scene, indent=1).encode()], [binary]


def assignments() -> list[bytes]:
    """Return ``--set`` for every parameter, with its default and with what its kind may be."""
    from spacemap_vtk.scenes.pipeline import section_classes

    usual = {
        "real": ["0.3 mm", "12 kPa", "linspace(1, 2, 5)", "1,2,3", "50%", "1e-3"],
        "integer": ["12", "5,7,9", "[1, 2]"],
        "vector": ["[1, 2, 3]", "[[1, 2, 3], [3, 2, 1]]", '["1 mm", 0, 0]'],
        "color": ["#d9642c", "[1, 2, 3]", "#fff000,#000fff"],
        "file": ["model.ply"],
        "flag": ["true", "false"],
    }
    found = []
    for section, part in section_classes().items():
        for name, parameter in part.parameters.items():
            values = [parameter.format(parameter.default), *usual.get(parameter.kind, [])]
            values += list(getattr(parameter, "choices", ()))[:3]
            found += [f"{section}.{name}={value}" for value in values]
    places = ["+y", "sphere(0, 0, 0, 1 mm):z", "box(0, 0, 0, 1, 1, 1)", "mask(a)", "+x:n(1,0,0)"]
    loads = ['{pressure="3 Pa", on="+z", time="ramp", rise="0.1 s"}', "{gravity=[0,0,-9.8]}"]
    loads += ['{force=[1,0,0], at=[0,0,0], time="table", times=[0,1], values=[0,1]}']
    found += [f"modal.fixed=[{', '.join(repr(place) for place in places)}]"]
    found += [f"modal.fixed={place}" for place in places]
    found += [f"response.loads=[{load}]" for load in loads] + [f"response.loads={loads[0]}"]
    found += ['modal.springs=["+x: 3 N/m"]', 'modal.masses=["nearest(0,0,0): 3 g"]']
    return [each.encode() for each in found]
