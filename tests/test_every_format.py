"""Every written format is read by another program, has a record, and can be repeated."""

from __future__ import annotations

import base64
import json
import re
import subprocess
import zlib
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
import pyvista as pv
from imageio_ffmpeg import get_ffmpeg_exe
from PIL import Image
from vtkmodules import vtkIOXML

from spacemap_vtk import __version__
from spacemap_vtk.cli.remake import compare_files
from spacemap_vtk.datasets.arrays import points_of
from spacemap_vtk.io import registry
from spacemap_vtk.io.provenance import NAME, Record, attach_record, read_record
from spacemap_vtk.jobs import (
    DataJob,
    Job,
    MovingJob,
    PictureJob,
    job_from_json,
    make_data_job,
    make_job,
)
from spacemap_vtk.scenes.scene import Scene
from spacemap_vtk.scenes.scene_record import restore_scene

VALUES: dict[str, Any] = {
    "title": 'Two by two, "--" (small) \\ é',
    "weave": {"ends": 2, "picks": 2, "warp_diameter": "0.2 mm"},
    "cage": {"divisions": [2, 2, 1]},
    "modal": {"modes": 3, "elements": "tetrahedra", "youngs_modulus": "1 kPa"},
    "response": {"loads": [{"pressure": "3 Pa", "on": "+z", "time": "ramp", "rise": "0.1 s"}]},
    "surface": {"subdivisions": 1},
    "view": {"size": [64, 48], "color": "displacement"},
    "animation": {"stop": 0.08},
}
#: Formats that cannot store a record.
WITHOUT_RECORD = {".bcc", ".stl", ".dtx", ".txt"}
#: Formats that are repeated in this test; the others store the same record.
REPEATED = {".png", ".glb", ".html", ".vtp", ".vtu", ".obj", ".usdc", ".pvd", ".svg"}
#: Kind of job for each kind of drawn output.
DRAWN = {
    **{"picture": "picture", "film": "film", "frames": "film"},
    **{"plot": "plot", "pages": "print", "unit_cell": "unit_cell"},
}


def jobs(folder: Path) -> list[tuple[str, Job]]:
    """Return a job for each kind and ending that can be written."""
    kinds = {
        (each, ending) for each in ("", *DRAWN) for ending in registry.writer_endings(each or None)
    }
    assert kinds == READERS.keys(), "a format without a reader that is not ours, or the other way"
    names = {"frames": "frame%02d"}
    found = []
    for kind, ending in sorted(kinds):
        if ending == ".jpeg" or (kind == "plot" and ending != ".svg"):
            continue  # as .jpg; all plots are of one figure, below
        # The grid of .yaml is a .vti of the same name.
        stem = "damask" if ending == ".yaml" else names.get(kind, kind or ending[1:])
        name = f"{stem}{ending}"
        file = folder / name
        job = make_job(DRAWN[kind], file) if kind else make_data_job(file)
        if isinstance(job, PictureJob):
            job.time = 0.03
        elif isinstance(job, (DataJob, MovingJob)):
            job.times = [0.0, 0.03] if job.is_series else [0.03]
        found.append((kind, job))
    return found


def read_draft_rows(file: Path) -> list[str]:
    """Return the rows of a draft as another library reads them, or the rows of a text."""
    import dtx_to_wif

    if file.suffix == ".txt":
        return file.read_text().split()
    found = dtx_to_wif.read_pattern_file(file)
    tied = [{s for t in pick for s in found.tieup.get(t, ())} for pick in found.treadling.values()]
    lifts = found.liftplan.values() or tied
    return ["".join("01"[bool(lift & end)] for end in found.threading.values()) for lift in lifts]


def bounds(points: Any) -> list[float]:
    ends = np.min(points, axis=0), np.max(points, axis=0)
    return np.transpose(ends).reshape(-1).tolist()


def hdf_points(file: Path) -> Any:
    import h5py

    with h5py.File(file) as made:
        root = made["VTKHDF"]
        begin, count = root["Steps/PointOffsets"][-1], root["NumberOfPoints"][-1]
        return root["Points"][begin : begin + count]


def pieces_points(file: Path) -> Any:
    kind = "PolyData" if file.suffix == ".pvtp" else "UnstructuredGrid"
    reader = getattr(vtkIOXML, f"vtkXMLP{kind}Reader")()
    reader.SetFileName(str(file))
    reader.Update()
    assert reader.GetNumberOfPieces() == 4
    return pv.wrap(reader.GetOutput()).points


def usd_points(file: Path) -> Any:
    usd, geometry = (pytest.importorskip(f"pxr.{name}") for name in ("Usd", "UsdGeom"))
    stage = usd.Stage.Open(str(file))
    return np.array(geometry.Mesh(stage.GetPrimAtPath("/Cloth/Surface")).GetPointsAttr().Get())


def collection_points(file: Path) -> Any:
    reader = pv.PVDReader(file)
    reader.set_active_time_value(0.03)
    return reader.read()[0].points


def collected_points(file: Path) -> Any:
    """Return the points of a collection of open curves, by its description."""
    data = np.fromfile(file, "<f4", offset=64)
    counts, place, found = np.fromfile(file, "<i4", offset=64), 0, []
    while place < len(data):
        end = place + 1 + 3 * int(counts[place])
        found.append(data[place + 1 : end].reshape(-1, 3))
        place = end
    return np.concatenate(found)


def texgen_points(file: Path) -> Any:
    """Return the points of a textile of TexGen in metres."""
    nodes = ElementTree.parse(file).iter("MasterNode")
    return np.array([node.attrib["Position"].split(",") for node in nodes], float) * 1e-3


def page_points(file: Path) -> Any:
    """Return the points of a web page; test_html.py opens it in a browser."""
    text = file.read_text("utf-8")
    content = json.loads(text.partition('id="content">')[2].partition("<")[0])
    parts = re.findall(r'class="data">(.*?)<', text)
    data = zlib.decompress(b"".join(map(base64.b64decode, parts)), -zlib.MAX_WBITS)
    first = content["arrays"][0]
    (count, columns), width = first["shape"], int(first["kind"][1:])
    planes = np.frombuffer(data, np.uint8, count * columns * width).reshape(width, -1)
    steps = np.ascontiguousarray(planes.T).view(f"<u{width}").reshape(columns, count)
    places = steps.cumsum(axis=1, dtype=steps.dtype).view(f"<i{width}").T
    return content["middle"] + content["unit"] * places


def picture_size(file: Path) -> tuple[int, int]:
    with Image.open(file) as image:
        image.load()
        return image.size


def film_size(file: Path) -> tuple[int, int]:
    words = [get_ffmpeg_exe(), "-i", str(file), "-f", "framemd5", "-"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    frames = [line for line in done.stdout.splitlines() if not line.startswith("#")]
    assert len(frames) == 2
    width, height = re.search(r", (\d+)x(\d+)", done.stderr).groups()  # type: ignore[union-attr]
    return int(width), int(height)


def drawing_size(file: Path) -> str:
    return str(ElementTree.parse(file).getroot().attrib["viewBox"])


def page_size(file: Path) -> str:
    """Return the size of a page from the table at the end of a PDF."""
    content = file.read_bytes()
    table = int(content.rpartition(b"startxref")[2].split()[0])
    assert content[table : table + 4] == b"xref"
    return re.search(rb"/MediaBox \[(.*?)\]", content)[1].decode()  # type: ignore[index]


def grid_corners(file: Path) -> Any:
    """Return two opposite corners of the grid that a file for FANS describes."""
    import h5py

    cell = json.loads(file.read_text())["microstructure"]
    with h5py.File(file.parent / cell["filepath"]) as made:
        assert made[cell["datasetname"]].ndim == 3
    return np.array([[0.0, 0.0, 0.0], cell["L"]])


#: A reader of another program for each written format; the test fails for a format without one.
READERS: dict[tuple[str, str], Callable[[Path], Any]] = {
    **{("", ending): read_draft_rows for ending in (".dtx", ".txt", ".wif")},
    **{("", ending): lambda file: pv.read(file).points for ending in (".vtp", ".vtu")},
    **{
        ("", ending): lambda file: meshio.read(file).points[:, :3]
        for ending in (".obj", ".ply", ".stl")
    },
    ("", ".inp"): lambda file: meshio.read(file, "abaqus").points,
    ("", ".csv"): lambda file: np.loadtxt(file, delimiter=",", skiprows=1)[:, 2:5],
    ("", ".bcc"): collected_points,
    ("", ".tg3"): texgen_points,
    ("", ".glb"): lambda file: pv.read(file).combine().points,
    ("", ".html"): page_points,
    ("", ".pvd"): collection_points,
    **{("", ending): pieces_points for ending in (".pvtp", ".pvtu")},
    ("", ".vtkhdf"): hdf_points,
    **{("", ending): usd_points for ending in (".usda", ".usdc")},
    **{("picture", ending): picture_size for ending in (".png", ".jpg", ".jpeg")},
    ("film", ".gif"): picture_size,
    ("film", ".mp4"): film_size,
    ("frames", ".png"): picture_size,
    **{("plot", ending): picture_size for ending in (".png", ".jpg", ".jpeg")},
    ("plot", ".svg"): drawing_size,
    ("plot", ".pdf"): page_size,
    ("pages", ".pdf"): page_size,
    **{("unit_cell", ending): lambda file: pv.read(file).points for ending in (".vti", ".vtu")},
    ("unit_cell", ".yaml"): lambda file: pv.read(file.with_suffix(".vti")).points,
    ("unit_cell", ".json"): grid_corners,
    # The last three nodes drive the strains.
    ("unit_cell", ".inp"): lambda file: meshio.read(file, "abaqus").points[:-3],
}


def expected_content(kind: str, job: Job) -> Any:
    """Return the content that a reader must find."""
    scene = Scene(VALUES)
    if job.kind == "draft":
        return ["10", "01"]
    if kind == "unit_cell":
        weave = Scene(VALUES).source.cloth
        width, depth = (2 * family.spacing for family in weave.families)
        scene.update(0.0)
        return [0.0, width, 0.0, depth, 0.0, float(np.ptp(points_of(scene.patches)[:, 2]))]
    if kind:
        return (32, 24) if job.output.suffix == ".gif" else (64, 48)
    first = job.kind == "moving"
    scene.update(0.0 if first else 0.03)
    if job.kind == "analysis":
        return bounds(points_of(scene.deformed_cage))
    return bounds(points_of(scene.patches if job.kind == "patches" else scene.polygons))


def check_content(kind: str, job: Job, file: Path) -> None:
    """Compare the content that another program reads with the scene."""
    found = READERS[kind, file.suffix](file)
    if job.kind == "plot":
        assert found == "0 0 691.2 518.4"
    elif job.kind == "print":
        width, height = map(float, found.split()[2:])
        assert (25.4 * width / 72, 25.4 * height / 72) == pytest.approx((210, 297))
    elif file.suffix in (".csv", ".bcc", ".tg3"):  # inside the yarns
        outer = np.reshape(expected_content(kind, job), (3, 2))
        assert (found >= outer[:, 0] - 1e-9).all()
        assert (found <= outer[:, 1] + 1e-9).all()
    elif isinstance(found, np.ndarray):
        near = 1e-6 if file.suffix == ".html" else 2e-9  # of a tolerance of 4e-6
        np.testing.assert_allclose(bounds(found), expected_content(kind, job), atol=near)
    else:
        assert found == expected_content(kind, job), file


def read_foreign_record(file: Path) -> str:
    """Return the record as another program finds it."""
    ending = file.suffix
    if ending in (".png", ".gif", ".jpg", ".jpeg"):
        with Image.open(file) as image:
            return str(image.info.get(NAME) or image.info["comment"])
    if ending == ".mp4":
        words = [get_ffmpeg_exe(), "-hide_banner", "-i", str(file)]
        return subprocess.run(words, capture_output=True, text=True).stderr
    if ending in (".vti", ".vtp", ".vtu"):
        return bytes(pv.read(file).field_data[NAME]).decode()
    if ending in (".usda", ".usdc"):
        sdf = pytest.importorskip("pxr.Sdf")
        return str(sdf.Layer.FindOrOpen(str(file)).customLayerData[NAME])
    if ending == ".vtkhdf":
        import h5py

        with h5py.File(file) as made:
            return str(made[NAME].asstr()[()])
    if ending == ".glb":
        head = file.read_bytes()[20:]
        return json.dumps(json.JSONDecoder().raw_decode(head.decode("latin-1"))[0]["asset"])
    if ending == ".csv":
        return file.with_name(f"{file.name}-metadata.json").read_text()
    if ending == ".svg":
        ElementTree.parse(file)
    return file.read_bytes().decode("latin-1")


def test_every_format_is_read_by_other_programs_and_can_be_repeated(
    tmp_path: Path,
) -> None:
    (tmp_path / "new").mkdir()
    without_record = set()
    for kind, job in jobs(tmp_path):
        if job.output.suffix in (".usda", ".usdc") and find_spec("pxr") is None:
            continue
        job.run(Scene(VALUES, tmp_path / "two.toml"))
        name = job.output.name % 1 if job.is_numbered else job.output.name
        check_content(kind, job, tmp_path / name)
        record = read_record(tmp_path / name)
        if record is None:
            without_record.add(job.output.suffix)
            continue
        assert "Two by two" in read_foreign_record(tmp_path / name), name
        assert record.version == __version__
        scene, inputs = restore_scene(record, [tmp_path])
        assert scene.title == VALUES["title"]
        assert inputs == []
        assert scene.response.loads == Scene(VALUES).response.loads
        if job.output.suffix not in REPEATED:
            continue
        job_from_json(record.order, tmp_path / "new" / name).run(scene)
        if job.is_numbered:  # seen from where its film is
            assert record.times == (0.04,)
        made, was = ((folder / name).read_bytes() for folder in (tmp_path / "new", tmp_path))
        assert made == was, name
        assert list(compare_files(tmp_path / name, tmp_path / "new" / name)) == []
    assert without_record == WITHOUT_RECORD


def test_a_plot_stores_its_record_in_any_format(tmp_path: Path) -> None:
    from matplotlib.figure import Figure

    record = Record(__version__, {"what": "plot"}, 'title = "a (b) \\\\ <&> -- Two by two"', "é")
    for ending in registry.writer_endings("plot"):
        file = tmp_path / f"a{ending}"
        with attach_record(record):
            registry.writer(file, "plot").write(file, Figure((1, 1)))
        READERS["plot", ending](file)
        assert read_record(file) == record
        assert "Two by two" in read_foreign_record(file)
