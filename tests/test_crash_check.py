"""Files that crash VTK's readers are refused by a child process. All were found by fuzzing."""

from __future__ import annotations

import gc
import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

import fuzz_rare
import h5py
import pytest

from spacemap_vtk.errors import GeometryError, InputError
from spacemap_vtk.io import crash_check
from spacemap_vtk.io.reading import read_object
from spacemap_vtk.io.series import open_series

VTU = b"""<VTKFile type="UnstructuredGrid"><UnstructuredGrid>
<Piece NumberOfPoints="99999999999999" NumberOfCells="0"><Points>
<DataArray type="Float32" NumberOfComponents="3" format="ascii">0 0 0</DataArray>
</Points></Piece></UnstructuredGrid></VTKFile>"""
PVTU = b"""<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid GhostLevel="0"><PPoints>
<PDataArray type="Float32" NumberOfComponents="-3"/></PPoints><Piece Source="a.vtu"/>
</PUnstructuredGrid></VTKFile>"""
PLY = b"""ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y
property float z\nelement face 1\nproperty int vertex_indices\nend_header\n0 0 0\n3 0 0 0\n"""
VTK = b"# vtk DataFile Version 3.0\na\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n0 0 0\n"
OFFSETS = b"OFFSETS vtktypeint64\n0 99999 2\nCONNECTIVITY vtktypeint64\n0 0\n"
OBJ = b"v 0 0 0\nf 2/1 3/2 4/3\n"


@pytest.mark.parametrize(
    ("ending", "content"),
    [
        (".obj", OBJ),
        pytest.param(".vtu", VTU, marks=pytest.mark.nightly),
        pytest.param(".ply", PLY, marks=pytest.mark.nightly),
        pytest.param(".pvtu", PVTU, marks=pytest.mark.nightly),
        pytest.param(".vtk", VTK + b"POLYGONS 1 2\n99999 0\n", marks=pytest.mark.nightly),
    ],
)
def test_a_file_that_crashes_its_reader_is_refused(
    tmp_path: Path, ending: str, content: bytes
) -> None:
    file = tmp_path / f"a{ending}"
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"damaged or too large: .* SIG(SEGV|ABRT|BUS)"):
        read_object(file)


def test_a_library_that_exits_is_reported(tmp_path: Path) -> None:
    file = tmp_path / "a.cgns"
    fuzz_rare._cgns(file)
    with h5py.File(file, "a") as made:
        del made["Base/Zone/ data"]
    with pytest.raises(InputError, match=r"its reader ended by status 255\. Write the file"):
        read_object(file)


@pytest.mark.nightly
def test_a_mesh_with_uninitialised_points_is_refused(tmp_path: Path) -> None:
    # VTK reads uninitialised memory, which makes a mesh or crashes, depending on its content.
    faces = "1 2 3 1e-320 0\n1 2 4 1  4 3 3)(\n1 2 3 1 0\n1 2 4 1 0\n1 3 4 1 0\n2 3 4 1 0\n"
    points = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
    text = f"(2 3)\n(10 (0 1 4 0 3))\n(10 (1 1 4 1 3)(\n{points}))\n(12 (0 1 1 0))\n"
    text += f"(12 (2 1 1 1 2))\n(13 (0 1 4 0))\n(13 (3 1 4 3 3)(\n{faces}))\n"
    file = tmp_path / "a.cas"
    file.write_text(f'(0 "a")\n{text}(45 (2 fluid a)())\n(45 (3 wall b)())\n')
    with pytest.raises(InputError, match=r"a cell refers to point -?\d+|damaged or too large"):
        read_object(file)


@pytest.mark.parametrize("read", [read_object, open_series])
def test_a_path_that_is_not_utf_8_is_refused(
    tmp_path: Path, read: Callable[[Path], object]
) -> None:
    file = tmp_path / "b\udcff.e"
    file.write_bytes(b"CDF")
    with pytest.raises(InputError, match=r"the path is not UTF-8. Rename the file"):
        read(file)


@pytest.mark.nightly
def test_offsets_outside_the_connectivity_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.vtk"
    file.write_bytes(VTK.replace(b"3.0", b"5.1") + b"POLYGONS 3 2\n" + OFFSETS)
    with pytest.raises(GeometryError, match="do not have the numbers of corners"):
        read_object(file)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (
            "STRUCTURED_GRID\nDIMENSIONS 9 1 1\nPOINTS 2 float\n0 0 0 1 1 1\n",
            "do not fill .* 9 x 1",
        ),
        ("STRUCTURED_POINTS\nDIMENSIONS 9999 9999 9\n", "would need about"),
        (
            "RECTILINEAR_GRID\nDIMENSIONS 2 1 1\nX_COORDINATES 1 float\n0\n"
            "Y_COORDINATES 1 float\n0\nZ_COORDINATES 1 float\n0\n",
            "do not fill .* 2 x 1 x 1",
        ),
    ],
)
def test_grids_with_missing_points_are_refused(tmp_path: Path, content: str, why: str) -> None:
    file = tmp_path / "a.vtk"
    file.write_bytes(VTK.partition(b"DATASET")[0] + f"DATASET {content}".encode())
    with pytest.raises(InputError, match=why):
        read_object(file)


def test_a_grid_of_negative_size_has_no_points(tmp_path: Path) -> None:
    file = tmp_path / "a.vti"
    file.write_text(
        '<VTKFile type="ImageData"><ImageData WholeExtent="65536 2 0 2 0 1" Origin="0 0 0" '
        'Spacing="1 1 1"><Piece Extent="0 2 0 2 0 1"></Piece></ImageData></VTKFile>'
    )
    with pytest.raises(GeometryError, match="the file has no points"):
        read_object(file)


def test_a_reader_that_never_ends_is_stopped(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(crash_check, "_MOST_SECONDS", 1)
    with pytest.raises(InputError, match="SIGXCPU"):
        crash_check.check_in_child(tmp_path, f"{__name__}:busy")


def busy(path: Path) -> None:
    while time.process_time():
        pass


def test_an_interrupted_check_leaves_no_process(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Python warns about processes and pipes that are left, and warnings are errors here."""
    monkeypatch.setattr(crash_check, "_child", None)
    crash_check.check_in_child(tmp_path, "os:stat")
    monkeypatch.setattr(crash_check, "_MOST_SECONDS", 1)
    # Like Ctrl-C, it interrupts the wait for an answer, which would come after a second.
    stop = threading.Timer(0.5, signal.pthread_kill, (threading.get_ident(), signal.SIGINT))
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)
    stop.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            crash_check.check_in_child(tmp_path, f"{__name__}:busy")
    finally:
        stop.join()
        signal.signal(signal.SIGINT, usual)
    assert crash_check._child is None
    gc.collect()


def test_a_file_is_checked_again_only_after_a_change(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("SPACEMAP_CACHE", str(tmp_path / "cache"))
    asked = []
    monkeypatch.setattr(crash_check, "_run_in_child", asked.append)
    file = tmp_path / "a.obj"
    file.write_bytes(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    for known in ({"this process"}, {"the cache"}):
        crash_check._checked.clear()
        assert read_object(file).data.GetNumberOfPoints() == 3
        assert read_object(file).data.GetNumberOfPoints() == 3
        assert len(asked) == 1, known
    os.utime(file, (1, 1))
    read_object(file)
    assert [task[1] for task in asked] == [file, file]


@pytest.mark.nightly
def test_a_file_is_checked_again_if_a_referenced_file_changed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The referenced file may be damaged and crash this process."""
    (tmp_path / "a.ele").write_text("1 4 0\n1 1 2 3 4\n")
    (tmp_path / "a.node").write_text("4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n")
    assert read_object(tmp_path / "a.ele").data.GetNumberOfCells() == 1
    (tmp_path / "a.node").write_text("# a file without an end")
    monkeypatch.setattr(crash_check, "_MOST_SECONDS", 1)
    with pytest.raises(InputError, match="SIGXCPU"):
        read_object(tmp_path / "a.ele")


def test_a_grid_without_cells_is_read_as_points(tmp_path: Path) -> None:
    file = tmp_path / "a.vtk"
    file.write_bytes(VTK.replace(b"POLYDATA", b"UNSTRUCTURED_GRID"))
    assert read_object(file).data.GetNumberOfCells() == 1
